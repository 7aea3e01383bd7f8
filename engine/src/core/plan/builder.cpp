#include "plan/builder.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

namespace dermis {
namespace {

/// Kernels count workgroups in 32 bits, including those that fill the last row: up to twice as
/// many.
constexpr std::uint64_t maxWorkgroups = std::uint64_t{1} << 31;

std::uint64_t divideUp(std::uint64_t value, std::uint64_t divisor) {
  return (value + divisor - 1) / divisor;
}

std::uint32_t wordsOf(const std::vector<std::uint32_t>& tables) {
  return static_cast<std::uint32_t>(tables.size());
}

/// Records begin at multiples of four words.
void alignToUnit(std::vector<std::uint32_t>& tables) {
  tables.resize((tables.size() + 3) / 4 * 4);
}

using abi::store;

void setBox(abi::ExtensionRecord& extension, const Box& box) {
  const BoxScale scale = boxScale(box);
  extension.centerX = scale.center[0];
  extension.centerY = scale.center[1];
  extension.centerZ = scale.center[2];
  extension.inverseX = scale.inverse[0];
  extension.inverseY = scale.inverse[1];
  extension.inverseZ = scale.inverse[2];
}

}  // namespace

void assignActive(std::span<const MorphWeight> morphs, std::vector<MorphWeight>& active) {
  active.assign(morphs.begin(), morphs.end());
  std::erase_if(active, [](const MorphWeight& morph) { return morph.weight == 0; });
  std::ranges::sort(active, {}, &MorphWeight::target);
}

// -- Groups.

/// Sets `lastVariant_` and `lastKey_`.
void Groups::chooseVariant(const Job& job, const OutputStreams& streams, bool mayScale,
                           const DeviceLimits& limits, const Tuning& tuning) {
  const FormNeeds form = formNeeds(job, mayScale);
  const bool hasLayout = lastKey_ != 0 && lastLayout_.areThoseOf(job, streams);
  if (hasLayout && form == lastForm_) return;
  if (!hasLayout) {
    lastVariant_ = layoutVariant(job, limits, tuning);
    lastLayout_ = LayoutNeeds(job, streams);
  }
  chooseForm(form, lastVariant_);
  lastForm_ = form;
  lastKey_ = lastVariant_.key();
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
  key.variant = lastKey_;
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
    placed.record.joints = placing.jointCount;
    placed.record.positions = place(0);
    placed.record.normals = place(1);
    placed.record.tangents = place(2);
    placed.record.previousPositions = place(3);
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
      key.mesh * odd[0] + key.variant * odd[1] +
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
  lastKey_ = 0;
}

// -- Plans.

void PlanData::clear() {
  commands.clear();
  variants.clear();
  tables.clear();
  for (std::vector<std::uint32_t>& units : paletteUnits) units.clear();
  results.clear();
  sizes = {};
  instanceCount = 0;
  vertexCount = 0;
  candidateCount = 0;
}

void PlanBuilder::begin(PlanData& plan, Groups& groups, const DeviceLimits& limits,
                        const Tuning& tuning, const PlanSizes& sizes) {
  plan_ = &plan;
  groups_ = &groups;
  limits_ = limits;
  tuning_ = tuning;
  plan.clear();
  plan.limits = limits;
  plan.sizes = sizes;
  ++number_;
  paletteCount_ = 0;
  for (PaletteLists& lists : palettes_) {
    for (auto& ofForm : lists.records) {
      for (std::vector<abi::PaletteRecord>& records : ofForm) records.clear();
    }
  }
  cleared_.clear();
  entries_.clear();
  candidates_.clear();
  planGroups_.clear();
  dispatches_.clear();
}

void PlanBuilder::startGroup(Groups::Entry& entry) {
  entry.plan = number_;
  entry.planGroup = static_cast<std::uint32_t>(planGroups_.size());
  planGroups_.push_back(entry.group);
}

Result<void> PlanBuilder::finish(const FrameWork* frame) {
  if (Result<void> good = addPaletteDispatches(); !good) return good;
  if (Result<void> good = addClearDispatch(); !good) return good;
  if (Result<void> good = addDispatches(); !good) return good;
  writeInstances();
  if (!candidates_.empty()) {
    appendCandidates();
    appendCulledDispatches();
    if (Result<void> good = addVisibilityDispatches(frame->frame); !good) return good;
  } else {
    plan_->sizes.slots = 0;
  }
  if (plan_->tables.size() * 4 > limits_.maxStorageBufferRange) {
    return tooLargeForRange("tables", plan_->tables.size() * 4, limits_);
  }
  plan_->instanceCount = static_cast<std::uint32_t>(entries_.size());
  plan_->candidateCount = static_cast<std::uint32_t>(candidates_.size());
  if (frame != nullptr) {
    listFrame(*frame);
  } else {
    listDispatches();
  }
  for (const Command& command : plan_->commands) {
    const auto* dispatch = std::get_if<DispatchCommand>(&command);
    if (dispatch != nullptr &&
        std::ranges::find(plan_->variants, dispatch->variant) == plan_->variants.end())
      plan_->variants.push_back(dispatch->variant);
  }
  return {};
}

namespace {

template <typename Push>
void setConstants(DispatchCommand& dispatch, const Push& push) {
  static_assert(sizeof(Push) <= sizeof(dispatch.constants));
  dispatch.constantCount = sizeof(Push) / 4;
  store(dispatch.constants, 0, push);
}

}  // namespace

/// Sets the number of workgroups in the push constants too.
template <typename Push>
Result<void> PlanBuilder::addDispatch(const Variant& variant, std::uint64_t workgroups, Push push) {
  const std::uint64_t maximum = std::min(
      std::uint64_t{limits_.maxWorkgroupCountX} * limits_.maxWorkgroupCountY, maxWorkgroups);
  if (workgroups > maximum) {
    return Error{ErrorCode::limitExceeded, "the batch needs " + std::to_string(workgroups) +
                                               " workgroups in one dispatch; the maximum is " +
                                               std::to_string(maximum) + "; split the batch"};
  }
  DispatchCommand& dispatch = dispatches_.emplace_back().command;
  dispatch.variant = variant;
  dispatch.workgroupCount = push.workgroupCount = static_cast<std::uint32_t>(workgroups);
  setConstants(dispatch, push);
  dispatch.groupCountY =
      static_cast<std::uint32_t>(divideUp(workgroups, limits_.maxWorkgroupCountX));
  dispatch.groupCountX = static_cast<std::uint32_t>(divideUp(workgroups, dispatch.groupCountY));
  return {};
}

Result<void> PlanBuilder::addPaletteDispatches() {
  for (std::uint32_t buffer = 0; buffer < palettes_.size(); ++buffer) {
    const PaletteLists& lists = palettes_[buffer];
    for (std::size_t form = 0; form < paletteFormCount; ++form) {
      for (const bool mayScale : {false, true}) {
        const std::span<const abi::PaletteRecord> records = lists.records[form][mayScale];
        if (records.empty()) continue;
        const Variant variant = paletteVariant(static_cast<PaletteForm>(form), mayScale, tuning_);
        if (Result<void> good = addPaletteDispatch(variant, records, lists.joints, buffer); !good)
          return good;
      }
    }
  }
  return {};
}

/// One workgroup per palette.
Result<void> PlanBuilder::addPaletteDispatch(const Variant& variant,
                                             std::span<const abi::PaletteRecord> records,
                                             BufferRole joints, std::uint32_t buffer) {
  std::vector<std::uint32_t>& tables = plan_->tables;
  const std::uint32_t first = wordsOf(tables);
  tables.resize(first + records.size() * abi::PALETTE_WORDS);
  std::memcpy(&tables[first], records.data(), records.size_bytes());
  if (Result<void> good = addDispatch(variant, records.size(), abi::PalettePush{first, 0}); !good)
    return good;
  DispatchCommand& dispatch = dispatches_.back().command;
  dispatch.joints = joints;
  dispatch.poseBuffer = buffer;
  return {};
}

/// One invocation per result.
Result<void> PlanBuilder::addClearDispatch() {
  if (cleared_.empty()) return {};
  std::vector<std::uint32_t>& tables = plan_->tables;
  const std::uint32_t first = wordsOf(tables);
  tables.insert(tables.end(), cleared_.begin(), cleared_.end());
  alignToUnit(tables);
  return addDispatch(clearVariant(tuning_), divideUp(cleared_.size(), tuning_.workgroupSize),
                     abi::ClearPush{first, static_cast<std::uint32_t>(cleared_.size()), 0});
}

/// Workgroups that process each vertex of a group once.
std::uint64_t PlanBuilder::vertexGroupsOf(const Group& group) const {
  return divideUp(group.key.vertexEnd - group.key.firstVertex,
                  std::uint64_t{tuning_.workgroupSize} * verticesPerInvocation_);
}

/// For one dispatch, given its groups. An invocation with few instances skins several vertices, so
/// that what is the same for all vertices of a group is read less often.
void PlanBuilder::chooseVerticesPerInvocation(std::span<const std::uint32_t> groups) {
  // Enough for the threads of a CPU. A guess: measured with two threads only.
  constexpr std::uint64_t minWorkgroups = 32;
  verticesPerInvocation_ = 1;
  if (!limits_.texelBuffers) return;
  std::uint64_t instances = 0;
  for (const std::uint32_t group : groups) instances += planGroups_[group].instances;
  const auto workgroups = [&] {
    std::uint64_t count = 0;
    for (const std::uint32_t group : groups) count += vertexGroupsOf(planGroups_[group]);
    return count;
  };
  while (verticesPerInvocation_ * 2 <= tuning_.verticesPerInvocation &&
         instances * verticesPerInvocation_ * 2 <= groups.size() * tuning_.instancesPerInvocation) {
    verticesPerInvocation_ *= 2;
    if (workgroups() >= minWorkgroups) continue;
    verticesPerInvocation_ /= 2;
    break;
  }
}

/// Instances per invocation of a dispatch with these groups: fewer than the tuning says if there
/// would be too few workgroups.
std::uint32_t PlanBuilder::instancesPerInvocation(std::span<const std::uint32_t> groups) const {
  std::uint32_t instances = tuning_.instancesPerInvocation;
  for (; instances > 1 && tuning_.minWorkgroups > 0; instances = (instances + 1) / 2) {
    std::uint64_t workgroups = 0;
    for (const std::uint32_t group : groups)
      workgroups +=
          vertexGroupsOf(planGroups_[group]) * divideUp(planGroups_[group].instances, instances);
    if (workgroups >= tuning_.minWorkgroups) break;
  }
  return instances;
}

/// A record for each group, and a dispatch for groups of one variant and output range.
Result<void> PlanBuilder::addDispatches() {
  const auto dispatchOrder = [&](std::uint32_t index) {
    const GroupKey& key = planGroups_[index].key;
    return std::tie(key.isCulled, key.windows, key.variant);
  };
  order_.resize(planGroups_.size());
  for (std::uint32_t index = 0; index < order_.size(); ++index) order_[index] = index;
  // Stable. std::stable_sort would allocate.
  std::sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple_cat(dispatchOrder(a), std::tie(a)) <
           std::tuple_cat(dispatchOrder(b), std::tie(b));
  });

  std::vector<std::uint32_t>& tables = plan_->tables;
  const std::uint32_t groupRecords = wordsOf(tables);
  tables.resize(groupRecords + planGroups_.size() * abi::GROUP_WORDS);
  const std::uint32_t instanceRecords = wordsOf(tables);
  const bool palettesRun = !dispatches_.empty();

  std::uint32_t firstInstance = 0;
  for (std::size_t begin = 0; begin < order_.size();) {
    std::size_t end = begin;
    while (end < order_.size() && dispatchOrder(order_[end]) == dispatchOrder(order_[begin])) ++end;
    chooseVerticesPerInvocation(std::span(order_).subspan(begin, end - begin));
    const std::uint32_t instancesEach =
        instancesPerInvocation(std::span(order_).subspan(begin, end - begin));
    std::uint64_t workgroups = 0;
    for (std::size_t index = begin; index < end; ++index) {
      Group& group = planGroups_[order_[index]];
      group.firstInstance = firstInstance;
      firstInstance += group.instances;
      const std::uint64_t vertexGroups = vertexGroupsOf(group);
      workgroups += vertexGroups * divideUp(group.instances, instancesEach);
      abi::GroupRecord record{};
      record.workgroupEnd =
          static_cast<std::uint32_t>(std::min<std::uint64_t>(workgroups, notUsed));
      record.mesh = static_cast<std::uint32_t>(group.key.mesh / 4);
      record.firstVertex = group.key.firstVertex;
      record.vertexEnd = group.key.vertexEnd;
      record.vertexGroups = static_cast<std::uint32_t>(vertexGroups);
      record.firstInstance = group.firstInstance;
      record.instanceCount = group.instances;
      record.positionStride = group.key.strides[0];
      record.normalStride = group.key.strides[1];
      record.tangentStride = group.key.strides[2];
      record.previousStride = group.key.strides[3];
      store(tables, groupRecords + index * abi::GROUP_WORDS, record);
    }
    const Group& group = planGroups_[order_[begin]];
    const Variant& variant = group.variant;
    const abi::SkinPush push{static_cast<std::uint32_t>(groupRecords + begin * abi::GROUP_WORDS),
                             static_cast<std::uint32_t>(end - begin),
                             0,
                             instanceRecords,
                             instancesEach,
                             verticesPerInvocation_};
    if (Result<void> good = addDispatch(variant, workgroups, push); !good) return good;
    Dispatch& dispatch = dispatches_.back();
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      const std::uint32_t window = group.key.windows[stream];
      dispatch.command.windows[stream] = {window, window * outputWindowStep(limits_)};
    }
    const bool readsPoses = variant.method == Method::linear && !plan_->sizes.isScene;
    dispatch.command.joints = readsPoses ? BufferRole::poses : BufferRole::palettes;
    // A kernel that may name the results counts as one that reads them.
    dispatch.isAfterPalettes =
        palettesRun && (!readsPoses || variant.motion != Motion::none || hasResults(variant));
    begin = end;
  }
  return {};
}

/// Returns the word of the first. Needs no alignment.
std::uint32_t PlanBuilder::appendMorphs(std::span<const MorphWeight> morphs) {
  std::vector<std::uint32_t>& tables = plan_->tables;
  const std::uint32_t first = wordsOf(tables);
  for (const MorphWeight& morph : morphs)
    tables.insert(tables.end(), {morph.target, std::bit_cast<std::uint32_t>(morph.weight)});
  return first;
}

std::uint32_t PlanBuilder::appendExtension(const InstanceExtras& extras) {
  std::vector<std::uint32_t>& tables = plan_->tables;
  alignToUnit(tables);
  const std::uint32_t place = wordsOf(tables);
  tables.resize(tables.size() + abi::EXTENSION_WORDS);
  abi::ExtensionRecord extension{};
  extension.morphs = appendMorphs(extras.morphs);
  extension.morphCount = static_cast<std::uint32_t>(extras.morphs.size());
  if (extras.result != notUsed) extension.result = extras.result;
  if (extras.hasBox) setBox(extension, extras.box);
  store(tables, place, extension);
  return place;
}

void PlanBuilder::writeInstances() {
  std::vector<std::uint32_t>& tables = plan_->tables;
  const std::uint32_t firstRecord = wordsOf(tables);
  tables.resize(firstRecord + entries_.size() * abi::INSTANCE_WORDS);
  culledPlaces_.resize(candidates_.size());
  auto candidate = candidates_.begin();
  for (std::uint32_t number = 0; number < entries_.size(); ++number) {
    const Entry& entry = entries_[number];
    Group& group = planGroups_[groups_->entries_[entry.run->group].planGroup];
    const std::uint32_t place = group.firstInstance + group.filled++;
    const std::uint32_t extension = entry.extras != nullptr ? appendExtension(*entry.extras) : 0;
    const abi::InstanceRecord& run = entry.run->record;
    const abi::InstanceRecord record{.palette = entry.palette,
                                     .positions = run.positions,
                                     .normals = run.normals,
                                     .tangents = run.tangents,
                                     .previousPositions = run.previousPositions,
                                     .joints = run.joints | entry.flags,
                                     .extension = extension,
                                     .reserved = 0};
    store(tables, firstRecord + std::size_t{place} * abi::INSTANCE_WORDS, record);
    if (candidate != candidates_.end() && candidate->entry == number)
      culledPlaces_[static_cast<std::size_t>(candidate++ - candidates_.begin())] = place;
  }
  culled_.instances = firstRecord;
  markEvenlySpaced(firstRecord);
}

namespace {

/// Whether the difference of each word from record to record is constant.
bool areEvenlySpaced(std::span<const std::uint32_t> records) {
  if (records.size() < 2 * abi::INSTANCE_WORDS) return false;
  std::array<std::uint32_t, abi::INSTANCE_WORDS> expected, step;
  for (std::size_t word = 0; word < expected.size(); ++word) {
    expected[word] = records[expected.size() + word];
    step[word] = records[expected.size() + word] - records[word];
  }
  for (std::size_t record = 2; record < records.size() / expected.size(); ++record) {
    for (std::size_t word = 0; word < expected.size(); ++word) expected[word] += step[word];
    if (std::memcmp(expected.data(), &records[record * expected.size()], sizeof(expected)) != 0)
      return false;
  }
  return true;
}

/// Whether the instances have the same box for positions in snorm16.
bool haveOneBox(std::span<const std::uint32_t> tables, std::span<const std::uint32_t> records) {
  constexpr std::size_t box = offsetof(abi::ExtensionRecord, centerX) / 4, boxWords = 6;
  const auto boxOf = [&](std::size_t record) {
    const auto instance = abi::load<abi::InstanceRecord>(records, record);
    return tables.subspan(instance.extension + box, boxWords);
  };
  for (std::size_t record = 0; record < records.size(); record += abi::INSTANCE_WORDS) {
    if (!std::ranges::equal(boxOf(record), boxOf(0))) return false;
  }
  return true;
}

}  // namespace

/// Instances that the GPU chooses are not: their records are moved.
void PlanBuilder::markEvenlySpaced(std::uint32_t firstRecord) {
  std::vector<std::uint32_t>& tables = plan_->tables;
  const std::size_t groups = firstRecord - planGroups_.size() * abi::GROUP_WORDS;
  for (std::size_t place = 0; place < order_.size(); ++place) {
    const Group& group = planGroups_[order_[place]];
    if (group.key.isCulled) continue;
    const auto records =
        std::span(std::as_const(tables))
            .subspan(firstRecord + std::size_t{group.firstInstance} * abi::INSTANCE_WORDS,
                     std::size_t{group.instances} * abi::INSTANCE_WORDS);
    if (!areEvenlySpaced(records)) continue;
    // The kernel reads the box once for all instances that it counts up.
    if (isSnormPosition(group.variant.positions) && !haveOneBox(tables, records)) continue;
    const std::size_t word = groups + place * abi::GROUP_WORDS;
    auto record = abi::load<abi::GroupRecord>(tables, word);
    record.evenlySpaced = 1;
    store(tables, word, record);
  }
}

/// In the order of the instance records, which are the last.
void PlanBuilder::appendCandidates() {
  std::vector<std::uint32_t>& tables = plan_->tables;
  culled_.firstInstance = static_cast<std::uint32_t>(entries_.size() - candidates_.size());
  culled_.candidates = wordsOf(tables);
  tables.resize(tables.size() + candidates_.size() * abi::CANDIDATE_WORDS);
  for (std::size_t index = 0; index < candidates_.size(); ++index) {
    const Candidate& candidate = candidates_[index].candidate;
    const std::size_t number = culledPlaces_[index] - culled_.firstInstance;
    store(tables, culled_.candidates + number * abi::CANDIDATE_WORDS,
          abi::CandidateRecord{candidate.slot, candidate.version});
  }
}

/// Groups that are culled come last, and so do their dispatches: these get their arguments from the
/// GPU.
void PlanBuilder::appendCulledDispatches() {
  std::vector<std::uint32_t>& tables = plan_->tables;
  culledGroups_ = static_cast<std::uint32_t>(
      std::ranges::count_if(planGroups_, [](const Group& group) { return group.key.isCulled; }));
  const std::uint32_t groupsEnd = culled_.instances;  // instance records follow the groups
  culled_.groups = groupsEnd - culledGroups_ * abi::GROUP_WORDS;
  const auto pushOf = [](const Dispatch& dispatch) {
    return abi::load<abi::SkinPush>(dispatch.command.constants, 0);
  };
  std::size_t first = dispatches_.size();
  while (first > 0 && dispatches_[first - 1].command.variant.kernel == Kernel::skin &&
         pushOf(dispatches_[first - 1]).groups >= culled_.groups)
    --first;
  const std::size_t count = dispatches_.size() - first;
  alignToUnit(tables);
  culled_.dispatches = wordsOf(tables);
  culled_.arguments =
      static_cast<std::uint32_t>(culled_.dispatches + count * abi::CULLED_DISPATCH_WORDS);
  tables.resize(culled_.arguments + count * abi::INDIRECT_WORDS, 0u);
  for (std::size_t index = 0; index < count; ++index) {
    DispatchCommand& dispatch = dispatches_[first + index].command;
    abi::SkinPush push = pushOf(dispatches_[first + index]);
    store(tables, culled_.dispatches + index * abi::CULLED_DISPATCH_WORDS,
          abi::CulledDispatchRecord{push.groups, push.groupCount, push.instancesPerInvocation, 0});
    // Only the GPU knows the number of workgroups. Excess ones find no instance in the last group.
    push.workgroupCount = notUsed;
    setConstants(dispatch, push);
    dispatch.groupCountX = dispatch.groupCountY = dispatch.workgroupCount = 0;
    dispatch.indirectOffset = (culled_.arguments + index * abi::INDIRECT_WORDS) * 4;
  }
  visibility_[1].workgroupCount = static_cast<std::uint32_t>(count);
}

/// First pass: a workgroup for each group. Second pass: one for each indirect dispatch.
Result<void> PlanBuilder::addVisibilityDispatches(std::uint32_t frame) {
  visibility_[0].workgroupCount = culledGroups_;
  const std::uint32_t most = std::max(culledGroups_, visibility_[1].workgroupCount);
  if (most > limits_.maxWorkgroupCountX) {
    return Error{ErrorCode::limitExceeded,
                 "instances that are culled on the GPU have " + std::to_string(most) +
                     " combinations of mesh and layout, but the device allows at most " +
                     std::to_string(limits_.maxWorkgroupCountX) + " workgroups"};
  }
  culled_.frame = frame;
  culled_.maxWorkgroups = limits_.maxWorkgroupCountX;
  for (const std::uint32_t pass : {abi::VISIBILITY_CHOOSES, abi::VISIBILITY_COUNTS}) {
    DispatchCommand& dispatch = visibility_[pass];
    dispatch.variant = visibilityVariant(tuning_);
    dispatch.groupCountX = dispatch.workgroupCount;
    dispatch.groupCountY = 1;
    culled_.pass = pass;
    setConstants(dispatch, culled_);
  }
  return {};
}

// -- Commands.

namespace {

constexpr Access computeBoth = Access::computeRead | Access::computeWrite;

}  // namespace

void PlanBuilder::listDispatches() {
  bool palettesAreVisible = false;
  for (const Dispatch& dispatch : dispatches_) {
    if (dispatch.isAfterPalettes && !palettesAreVisible) {
      plan_->commands.emplace_back(BarrierCommand{Access::computeWrite, computeBoth});
      palettesAreVisible = true;
    }
    plan_->commands.emplace_back(dispatch.command);
  }
}

void PlanBuilder::listFrame(const FrameWork& frame) {
  if (dispatches_.empty() && frame.moves.empty()) return;
  std::vector<Command>& commands = plan_->commands;
  const bool culls = !candidates_.empty();
  // Earlier frames have finished reading what this frame overwrites, and their writes are visible.
  commands.emplace_back(
      BarrierCommand{computeBoth | Access::copyRead | Access::copyWrite | Access::indirectRead,
                     computeBoth | Access::copyRead | Access::copyWrite});
  if (!plan_->tables.empty()) {
    commands.emplace_back(
        CopyCommand{BufferRole::upload, BufferRole::tables, 0, 0, plan_->tables.size() * 4});
  }
  commands.insert(commands.end(), frame.moves.begin(), frame.moves.end());
  const auto sizeOf = [this](BufferRole role) {
    return plan_->sizes.requirement(role, 0, limits_).size;
  };
  if (culls)
    commands.emplace_back(ClearCommand{BufferRole::counters, 0, sizeOf(BufferRole::counters)});
  const std::uint64_t clear = frame.clearHistory * std::uint64_t{sizeof(abi::HistoryRecord)};
  if (culls && clear < sizeOf(BufferRole::history)) {
    commands.emplace_back(
        ClearCommand{BufferRole::history, clear, sizeOf(BufferRole::history) - clear});
  }
  commands.emplace_back(BarrierCommand{Access::copyWrite, computeBoth});
  if (culls) {
    commands.emplace_back(visibility_[0]);
    commands.emplace_back(BarrierCommand{Access::computeWrite, computeBoth});
    commands.emplace_back(visibility_[1]);
    commands.emplace_back(BarrierCommand{Access::computeWrite, computeBoth | Access::indirectRead});
  }
  listDispatches();
  if (!culls && frame.results.empty()) return;
  commands.emplace_back(BarrierCommand{Access::computeWrite, Access::copyRead});
  if (culls) {
    commands.emplace_back(CopyCommand{BufferRole::counters, BufferRole::readBack, 0,
                                      readBackCounters, sizeOf(BufferRole::counters)});
  }
  commands.insert(commands.end(), frame.results.begin(), frame.results.end());
  commands.emplace_back(BarrierCommand{Access::copyWrite, Access::hostRead});
}

}  // namespace dermis
