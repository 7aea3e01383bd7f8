#include "plan/groups.h"

#include <algorithm>
#include <bit>
#include <string>
#include <utility>

namespace dermis {

/// Sets `lastVariant_` and `lastPipeline_`.
void Groups::chooseVariant(const Job& job, const OutputStreams& streams, bool mayScale,
                           const DeviceLimits& limits, const Tuning& tuning) {
  const FormNeeds form = formNeeds(job, mayScale);
  const bool hasLayout = lastPipeline_ != PipelineId{} && lastLayout_.areThoseOf(job, streams);
  if (hasLayout && form == lastForm_) return;
  if (!hasLayout) {
    lastVariant_ = layoutVariant(job, limits, tuning);
    lastLayout_ = LayoutNeeds(job, streams);
  }
  chooseForm(form, lastVariant_);
  lastForm_ = form;
  lastPipeline_ = lastVariant_.id();
}

Result<void> Groups::place(const Job& job, const OutputStreams& streams, const Placing& placing,
                           const DeviceLimits& limits, const Tuning& tuning,
                           std::vector<PlacedRun>& runs) {
  const OutputWindows& windows = placing.windows;
  cutIntoRuns(streams, job.mesh.vertexCount, windows, vertexRuns_);
  if (windows.isAnyOversized) {
    for (const VertexRun& run : vertexRuns_) {
      if (Result<void> good = checkWindows(streams, run, windows, placing.subject, limits); !good)
        return good;
    }
  }
  if (placing.isCulled && vertexRuns_.size() > 1) {
    return Error{
        ErrorCode::limitExceeded,
        placing.subject.name() +
            " is culled on the GPU, so its output must lie in one storage buffer range of " +
            std::to_string(limits.maxStorageBufferRange) + " bytes, but it does not"};
  }
  chooseVariant(job, streams, placing.mayScale, limits, tuning);
  GroupKey key;
  key.mesh = job.meshOffset;
  key.pipeline = lastPipeline_;
  key.isCulled = placing.isCulled;
  for (std::size_t stream = 0; stream < streamCount; ++stream)
    key.strides[stream] = streams[stream].stride;
  for (const VertexRun& run : vertexRuns_) {
    key.windows = run.windows;
    key.firstVertex = run.firstVertex;
    key.vertexEnd = run.vertexEnd;
    const auto place = [&](std::size_t stream) {
      return static_cast<std::uint32_t>(streams[stream].begin(run.firstVertex) -
                                        run.windows[stream] * windows.step);
    };
    PlacedRun& placed = runs.emplace_back();
    placed.group = acquire(key, lastVariant_);
    placed.joints = placing.jointCount;
    for (std::size_t stream = 0; stream < streamCount; ++stream)
      placed.offsets[stream] = place(stream);
  }
  return {};
}

std::uint32_t Groups::acquire(const GroupKey& key, const Variant& variant) {
  if (last_ == notUsed || entries_[last_].users == 0 || !(entries_[last_].group.key == key))
    last_ = findOrAdd(key, variant);
  ++entries_[last_].users;
  return last_;
}

std::uint32_t Groups::findOrAdd(const GroupKey& key, const Variant& variant) {
  if (heads_.size() <= entries_.size()) growHeads();
  std::uint32_t& head = headOf(key);
  for (std::uint32_t group = head; group != notUsed; group = entries_[group].next) {
    if (entries_[group].group.key == key) return group;
  }
  auto group = static_cast<std::uint32_t>(entries_.size());
  if (free_.empty()) {
    entries_.emplace_back();
  } else {
    group = free_.back();
    free_.pop_back();
  }
  Entry& entry = entries_[group];
  entry = {};
  entry.group.key = key;
  entry.group.variant = variant;
  entry.next = head;
  head = group;
  return group;
}

std::uint32_t& Groups::headOf(const GroupKey& key) {
  // Groups of one mesh and variant mostly differ by their first window and stride, if at all.
  constexpr std::uint64_t odd[] = {0x9e3779b97f4a7c15u, 0xc2b2ae3d27d4eb4fu, 0x165667b19e3779f9u};
  const std::uint64_t hash =
      key.mesh * odd[0] + static_cast<std::uint64_t>(key.pipeline) * odd[1] +
      ((std::uint64_t{key.windows[0]} << 32 | key.strides[0]) ^ key.firstVertex) * odd[2];
  return heads_[static_cast<std::size_t>(hash >> 32) & (heads_.size() - 1)];
}

void Groups::growHeads() {
  heads_.assign(std::bit_ceil(2 * entries_.size() + 16), notUsed);
  for (std::uint32_t group = 0; group < entries_.size(); ++group) {
    if (entries_[group].users == 0) continue;
    entries_[group].next = std::exchange(headOf(entries_[group].group.key), group);
  }
}

void Groups::release(std::uint32_t group) {
  Entry& entry = entries_[group];
  if (--entry.users != 0) return;
  std::uint32_t* link = &headOf(entry.group.key);
  while (*link != group) link = &entries_[*link].next;
  *link = entry.next;
  free_.push_back(group);
}

void Groups::clear() {
  entries_.clear();
  free_.clear();
  std::ranges::fill(heads_, notUsed);
  last_ = notUsed;
  lastPipeline_ = {};
}

}  // namespace dermis
