#include "system/frame_builder.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "plan/instances.h"

namespace dermis {

std::uint32_t FrameGroups::acquire(const GroupKey& key, const Variant& variant,
                                   std::uint32_t maxInfluences, bool scales) {
  const auto [found, isNew] = find_.try_emplace(key, 0);
  if (isNew) {
    if (free_.empty()) {
      found->second = static_cast<std::uint32_t>(entries_.size());
      entries_.emplace_back();
    } else {
      found->second = free_.back();
      free_.pop_back();
    }
    Entry& entry = entries_[found->second];
    entry = {};
    entry.group.key = key;
    entry.group.variant = variant;
  }
  Entry& entry = entries_[found->second];
  entry.group.maxInfluences = std::max(entry.group.maxInfluences, maxInfluences);
  entry.group.scales |= scales;
  ++entry.users;
  return found->second;
}

void FrameGroups::release(std::uint32_t group) {
  Entry& entry = entries_[group];
  if (--entry.users != 0) return;
  find_.erase(entry.group.key);
  free_.push_back(group);
}

void FrameBuilder::begin(const Sizes& sizes) {
  Plan::State& state = *plan_.state_;
  state.clear();
  state.limits = limits_;
  state.meshesSize = sizes.meshes;
  state.matricesSize = sizes.matrices;
  state.palettesSize = sizes.palettes;
  state.resultCount = static_cast<std::uint32_t>(sizes.results / sizeof(InstanceResult));
  state.outputs = sizes.outputs;
  ++frame_;
  paletteCount_ = 0;
  cleared_.clear();
  entries_.clear();
  candidates_.clear();
  culled_ = {};
}

void FrameBuilder::startGroup(FrameGroups::Entry& entry) {
  Plan::State& state = *plan_.state_;
  entry.frame = frame_;
  entry.frameGroup = static_cast<std::uint32_t>(state.groups.size());
  state.groups.push_back(entry.group);
}

Result<void> FrameBuilder::finish() {
  Plan::State& state = *plan_.state_;
  if (Result<void> good = state.addPaletteDispatch(tuning_, paletteCount_, cleared_); !good)
    return good;
  if (Result<void> good = state.placeGroups(tuning_); !good) return good;
  writeInstances(static_cast<std::uint32_t>(state.tables.size()));
  firstIndirect_ = state.dispatches.size();
  if (!candidates_.empty()) {
    appendCandidates();
    appendCulledDispatches();
  }
  if (state.tables.size() * 4 > limits_.maxStorageBufferRange) {
    return Error{ErrorCode::limitExceeded,
                 "the tables of the frame are larger than a storage buffer range"};
  }
  state.chooseTexels();
  state.listVariants();
  return {};
}

std::uint32_t FrameBuilder::appendExtension(const InstanceExtras& extras) {
  std::vector<std::uint32_t>& tables = plan_.state_->tables;
  const auto place = static_cast<std::uint32_t>(tables.size());
  tables.resize(tables.size() + abi::EXTENSION_WORDS, 0u);
  const auto morphs = static_cast<std::uint32_t>(tables.size());
  for (const MorphWeight& morph : extras.morphs) {
    tables.push_back(morph.target);
    tables.push_back(std::bit_cast<std::uint32_t>(morph.weight));
  }
  std::uint32_t* extension = &tables[place];
  extension[abi::EXTENSION_MORPHS] = morphs;
  extension[abi::EXTENSION_MORPH_COUNT] = static_cast<std::uint32_t>(extras.morphs.size());
  if (extras.result != notUsed)
    extension[abi::EXTENSION_RESULT] = extras.result * abi::RESULT_WORDS;
  if (extras.hasBox) writeBox(extension, extras.box);
  return place;
}

void FrameBuilder::writeInstances(std::uint32_t firstRecord) {
  Plan::State& state = *plan_.state_;
  state.instanceCount = static_cast<std::uint32_t>(entries_.size());
  state.tables.resize(firstRecord + entries_.size() * abi::INSTANCE_WORDS);
  culledPlaces_.resize(candidates_.size());
  auto candidate = candidates_.begin();
  for (std::uint32_t number = 0; number < entries_.size(); ++number) {
    const Entry& entry = entries_[number];
    Group& group = state.groups[groups_.entries_[entry.run->group].frameGroup];
    const std::uint32_t place = group.firstInstance + group.filled++;
    const std::uint32_t extension = entry.extras != nullptr ? appendExtension(*entry.extras) : 0;
    std::uint32_t* record = &state.tables[firstRecord + std::size_t{place} * abi::INSTANCE_WORDS];
    std::memcpy(record, entry.run->record.data(), sizeof(entry.run->record));
    record[abi::INSTANCE_PALETTE] = entry.palette;
    record[abi::INSTANCE_FLAGS] = entry.flags;
    record[abi::INSTANCE_EXTENSION] = extension;
    if (candidate != candidates_.end() && candidate->entry == number)
      culledPlaces_[static_cast<std::size_t>(candidate++ - candidates_.begin())] = place;
  }
  culled_.instances = firstRecord;
}

/// In the order of the instance records, which are the last.
void FrameBuilder::appendCandidates() {
  std::vector<std::uint32_t>& tables = plan_.state_->tables;
  culled_.candidateCount = static_cast<std::uint32_t>(candidates_.size());
  culled_.firstInstance = static_cast<std::uint32_t>(entries_.size() - candidates_.size());
  culled_.candidates = static_cast<std::uint32_t>(tables.size());
  tables.resize(tables.size() + candidates_.size() * abi::CANDIDATE_WORDS);
  for (std::size_t index = 0; index < candidates_.size(); ++index) {
    const Candidate& candidate = candidates_[index].candidate;
    std::uint32_t* record =
        &tables[culled_.candidates +
                std::size_t{culledPlaces_[index] - culled_.firstInstance} * abi::CANDIDATE_WORDS];
    record[abi::CANDIDATE_SLOT] = candidate.slot;
    record[abi::CANDIDATE_VERSION] = candidate.version;
  }
}

void FrameBuilder::appendCulledDispatches() {
  Plan::State& state = *plan_.state_;
  std::vector<std::uint32_t>& tables = state.tables;
  // Groups that are culled come last, and so do their dispatches.
  std::size_t first = state.dispatches.size();
  std::uint32_t groupsBegin = notUsed, groupsEnd = 0;
  while (first > 0) {
    const Dispatch& dispatch = state.dispatches[first - 1];
    if (dispatch.variant.kernel != Kernel::skin ||
        tables[dispatch.constants.firstRecord + abi::GROUP_FIRST_INSTANCE] < culled_.firstInstance)
      break;
    --first;
    groupsBegin = dispatch.constants.firstRecord;
    groupsEnd = std::max(groupsEnd, dispatch.constants.firstRecord +
                                        dispatch.constants.recordCount * abi::GROUP_WORDS);
  }
  firstIndirect_ = first;
  culled_.groups = groupsBegin;
  culled_.groupCount = (groupsEnd - groupsBegin) / abi::GROUP_WORDS;
  culled_.dispatchCount = static_cast<std::uint32_t>(state.dispatches.size() - first);
  culled_.dispatches = static_cast<std::uint32_t>(tables.size());
  culled_.arguments = culled_.dispatches + culled_.dispatchCount * abi::CULLED_DISPATCH_WORDS;
  tables.resize(culled_.arguments + std::size_t{culled_.dispatchCount} * abi::INDIRECT_WORDS, 0u);
  for (std::size_t index = first; index < state.dispatches.size(); ++index) {
    Dispatch& dispatch = state.dispatches[index];
    std::uint32_t* record =
        &tables[culled_.dispatches + (index - first) * abi::CULLED_DISPATCH_WORDS];
    record[abi::CULLED_DISPATCH_GROUPS] = dispatch.constants.firstRecord;
    record[abi::CULLED_DISPATCH_GROUP_COUNT] = dispatch.constants.recordCount;
    record[abi::CULLED_DISPATCH_INSTANCES] = dispatch.variant.instancesPerInvocation;
    // Only the GPU will know how many there are. Those too many find no instance in the last group.
    dispatch.constants.workgroupCount = notUsed;
  }
}

}  // namespace dermis
