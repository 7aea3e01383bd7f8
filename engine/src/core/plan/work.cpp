#include "plan/work.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

namespace dermis {

// -- Windows.

namespace {

/// Bytes that two adjacent windows share.
std::uint64_t windowOverlap(std::uint64_t range) {
  return range / 16;
}

/// Maximum bytes of a run: half of the overlap. A run that begins in a window then ends in it, even
/// if an attribute begins up to that many bytes after the first.
std::uint64_t longestRun(std::uint64_t range) {
  return windowOverlap(range) / 2;
}

/// Returns whether the run lies in the windows that it begins in.
bool chooseWindows(const OutputStreams& streams, const OutputWindows& windows, VertexRun& run) {
  std::uint64_t common = std::numeric_limits<std::uint64_t>::max();
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (streams[stream].size == 0 || !windows.oversized[stream]) continue;
    const std::uint64_t window = streams[stream].begin(run.firstVertex) / windows.step;
    run.windows[stream] = static_cast<std::uint32_t>(window);
    common = std::min(common, window);
  }
  bool isInCommon = true;
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (streams[stream].size != 0 && windows.oversized[stream] &&
        streams[stream].end(run.vertexEnd) > common * windows.step + windows.range)
      isInCommon = false;
  }
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (streams[stream].size == 0 || !windows.oversized[stream]) continue;
    if (isInCommon) run.windows[stream] = static_cast<std::uint32_t>(common);
    if (streams[stream].end(run.vertexEnd) > run.windows[stream] * windows.step + windows.range)
      return false;
  }
  return true;
}

}  // namespace

std::uint64_t outputWindowStep(const DeviceLimits& limits) {
  const std::uint64_t step =
      limits.maxStorageBufferRange - windowOverlap(limits.maxStorageBufferRange);
  // A multiple of everything that one store may write.
  return step - step % (3 * std::max<std::uint64_t>(limits.minStorageBufferOffsetAlignment, 32));
}

OutputWindows::OutputWindows(const ByStream<std::uint64_t>& outputSizes, const DeviceLimits& limits)
    : range(limits.maxStorageBufferRange), step(outputWindowStep(limits)) {
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    oversized[stream] = outputSizes[stream] > range;
    isAnyOversized = isAnyOversized || oversized[stream];
  }
}

namespace {

/// Cuts the vertices of a job into runs: one if each attribute lies in one window. Attributes that
/// are near each other get windows of the same number.
void cutIntoRuns(const OutputStreams& streams, std::uint32_t vertexCount,
                 const OutputWindows& windows, std::vector<VertexRun>& runs) {
  runs.clear();
  VertexRun& whole = runs.emplace_back();
  whole.vertexEnd = vertexCount;
  if (!windows.isAnyOversized || chooseWindows(streams, windows, whole)) return;
  runs.clear();
  std::uint64_t longest = vertexCount;
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (streams[stream].size == 0 || !windows.oversized[stream]) continue;
    longest = std::min(longest,
                       (longestRun(windows.range) - streams[stream].size) / streams[stream].stride +
                           std::uint64_t{1});
  }
  for (std::uint64_t vertex = 0; vertex < vertexCount; vertex += longest) {
    VertexRun run;
    run.firstVertex = static_cast<std::uint32_t>(vertex);
    run.vertexEnd =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(vertex + longest, vertexCount));
    chooseWindows(streams, windows, run);
    runs.push_back(run);
  }
}

/// Whether a kernel can see all windows that a run is written to.
Result<void> checkWindows(const OutputStreams& streams, const VertexRun& run,
                          const OutputWindows& windows, const Subject& subject,
                          const DeviceLimits& limits) {
  const bool hasFewBuffers = limits.maxStorageBuffersPerStage < storageBuffersWanted;
  if (!hasFewBuffers && limits.separateRanges) return {};
  std::optional<std::uint32_t> common;
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (streams[stream].size == 0 || !windows.oversized[stream]) continue;
    if (common.value_or(run.windows[stream]) != run.windows[stream]) {
      return Error{ErrorCode::limitExceeded,
                   subject.name() + ": its " + streamName(stream) +
                       " are too far from the preceding attribute for a device " +
                       (hasFewBuffers ? "with " + std::to_string(limits.maxStorageBuffersPerStage) +
                                            " storage buffers per stage"
                                      : "that cannot bind a separate range of the output for each "
                                        "attribute (DeviceLimits::separateRanges)")};
    }
    common = run.windows[stream];
  }
  return {};
}

}  // namespace

// -- Groups.

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

// -- Work.

namespace {

auto dispatchOf(const GroupKey& key) {
  return std::tie(key.isCulled, key.windows, key.pipeline);
}

}  // namespace

void assignActive(std::span<const MorphWeight> morphs, std::vector<MorphWeight>& active) {
  active.assign(morphs.begin(), morphs.end());
  std::erase_if(active, [](const MorphWeight& morph) { return morph.weight == 0; });
  std::ranges::sort(active, {}, &MorphWeight::target);
}

void Work::begin(Groups& groupsInUse) {
  groups_ = &groupsInUse;
  ++number_;
  for (Poses& of : poses) {
    for (; of.filled != 0; of.filled &= of.filled - 1) {
      Poses::List& list = of.lists[static_cast<std::size_t>(std::countr_zero(of.filled))];
      list.records.clear();
      list.driven.clear();
    }
  }
  banks.clear();
  rigs.clear();
  for (std::vector<abi::FigureRecord>& records : figures) records.clear();
  figurePlaces.clear();
  poseCount = 0;
  clearedResults.clear();
  instances.clear();
  culled.clear();
  morphLists.clear();
  groups.clear();
}

void Work::addFigure(std::uint32_t poseBuffer, const Bank& bank, abi::FigureRecord record) {
  // Mostly that of the figure before.
  if (banks.empty() || banks.back().clips != bank.clips) {
    const auto known = std::ranges::find(banks, bank.clips, &Bank::clips);
    if (known == banks.end()) {
      banks.push_back(bank);
    } else {
      record.bank = static_cast<std::uint32_t>(known - banks.begin());
    }
  }
  if (record.bank == notUsed) record.bank = static_cast<std::uint32_t>(banks.size() - 1);
  while (figures.size() <= poseBuffer) figures.emplace_back();
  figurePlaces.push_back({poseBuffer, static_cast<std::uint32_t>(figures[poseBuffer].size())});
  figures[poseBuffer].push_back(record);
}

void Work::addRig(std::uint32_t words, const PoseSource& source, const abi::RigRecord& record,
                  std::uint32_t figure) {
  const auto isOf = [&](const Rig& rig) {
    return rig.words == words && rig.buffer == source.buffer &&
           rig.drivenBuffer == source.drivenBuffer;
  };
  // Mostly that of the pose before.
  auto rig =
      !rigs.empty() && isOf(rigs.back()) ? std::prev(rigs.end()) : std::ranges::find_if(rigs, isOf);
  if (rig == rigs.end()) {
    rigs.push_back({words, source.buffer, source.drivenBuffer, source.role, {}, {}});
    rig = std::prev(rigs.end());
  }
  rig->poses.push_back(record);
  rig->figures.push_back(figure);
}

void Work::startGroup(Groups::Entry& entry) {
  entry.plan = number_;
  entry.planGroup = static_cast<std::uint32_t>(groups.size());
  groups.push_back(entry.group);
}

bool Work::shareDispatch(std::uint32_t group, std::uint32_t other) const {
  return dispatchOf(groups[group].key) == dispatchOf(groups[other].key);
}

void Work::arrange() {
  order.resize(groups.size());
  for (std::uint32_t index = 0; index < order.size(); ++index) order[index] = index;
  // Stable. std::stable_sort would allocate.
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple_cat(dispatchOf(groups[a].key), std::tie(a)) <
           std::tuple_cat(dispatchOf(groups[b].key), std::tie(b));
  });
  std::uint32_t first = 0;
  for (const std::uint32_t index : order) {
    groups[index].firstInstance = first;
    first += groups[index].instances;
  }
}

}  // namespace dermis
