#include "plan/encode.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <utility>

namespace dermis {
namespace {

/// Kernels count workgroups in 32 bits, including those that fill the last row: up to twice as
/// many.
constexpr std::uint64_t maxWorkgroups = std::uint64_t{1} << 31;

std::uint64_t divideUp(std::uint64_t value, std::uint64_t divisor) {
  return (value + divisor - 1) / divisor;
}

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

void PlanData::clear() {
  commands.clear();
  bindings.clear();
  pipelines.clear();
  tables.begin({});
  for (std::vector<std::uint32_t>& units : paletteUnits) units.clear();
  results.clear();
  sizes = {};
  instanceCount = 0;
  vertexCount = 0;
}

Result<void> Encoder::encode(const Work& work, const DeviceLimits& limits, const Tuning& tuning,
                             const PlanSizes& sizes, PlanData& plan, std::uint32_t record,
                             std::span<std::byte> lent) {
  plan_ = &plan;
  work_ = &work;
  tuning_ = tuning;
  plan.clear();
  plan.tables.begin(lent);
  plan.limits = limits;
  plan.sizes = sizes;
  dispatches_.clear();
  lists_.clear();
  drivenLists_.clear();
  if (work.isEmpty()) return {};
  if (Result<void> good = addFigureDispatches(); !good) return good;
  if (Result<void> good = addRigDispatches(); !good) return good;
  if (Result<void> good = addPaletteDispatches(); !good) return good;
  if (Result<void> good = addClearDispatch(); !good) return good;
  if (Result<void> good = addDispatches(); !good) return good;
  writeInstances();
  if (Result<void> good = addMorphLists(); !good) return good;
  if (!work.culled.empty()) {
    appendCandidates();
    appendCulledDispatches();
    if (Result<void> good = addVisibilityDispatches(record); !good) return good;
  }
  if (const std::uint64_t size = plan.tables.bytes().size(); size > limits.maxStorageBufferRange)
    return tooLargeForRange("tables", size, limits);
  plan.instanceCount = static_cast<std::uint32_t>(work.instances.size());
  // Commands point into the list, so it must not move.
  plan.bindings.reserve(
      (dispatches_.size() + lists_.size() + drivenLists_.size() + visibility_.size()) *
      (abi::BINDING_COUNT + abi::TEXEL_BINDING_COUNT));
  return {};
}

namespace {

template <typename Push>
void setConstants(DispatchCommand& dispatch, const Push& push) {
  static_assert(sizeof(Push) <= sizeof(dispatch.constants));
  dispatch.constantCount = sizeof(Push) / 4;
  abi::store(dispatch.constants, 0, push);
}

}  // namespace

/// Sets the number of workgroups in the push constants too. `known` is the variant's ID, or 0.
template <typename Push>
Result<void> Encoder::addDispatch(const Variant& variant, std::uint64_t workgroups, Push push,
                                  PipelineId known) {
  const std::uint64_t maximum =
      std::min(std::uint64_t{plan_->limits.maxWorkgroupCountX} * plan_->limits.maxWorkgroupCountY,
               maxWorkgroups);
  if (workgroups > maximum) {
    return Error{ErrorCode::limitExceeded, "the batch needs " + std::to_string(workgroups) +
                                               " workgroups in one dispatch; the maximum is " +
                                               std::to_string(maximum) + "; split the batch"};
  }
  dispatches_.emplace_back().variant = variant;
  DispatchCommand& dispatch = dispatches_.back().command;
  dispatch.pipeline = known != PipelineId{} ? known : variant.id();
  dispatch.workgroupCount = push.workgroupCount = static_cast<std::uint32_t>(workgroups);
  setConstants(dispatch, push);
  dispatch.groupCountY =
      static_cast<std::uint32_t>(divideUp(workgroups, plan_->limits.maxWorkgroupCountX));
  dispatch.groupCountX = static_cast<std::uint32_t>(divideUp(workgroups, dispatch.groupCountY));
  return {};
}

/// One workgroup per figure: a dispatch that samples the nodes of all, then one for each band of
/// nodes and pose buffer. These wait for each other, since each reads and writes the transforms.
Result<void> Encoder::addFigureDispatches() {
  paletteStage_ = 0;
  if (work_->banks.empty()) return {};
  std::size_t bands = 0, count = 0;
  for (const Work::Bank& bank : work_->banks) bands = std::max(bands, bank.clips->bandEnds.size());
  TableWords& tables = plan_->tables;  // they begin with these
  const std::size_t bankWords = abi::BANK_WORDS + bands * abi::BAND_WORDS;
  tables.appendZeros(work_->banks.size() * bankWords);  // banks with fewer bands
  for (std::size_t i = 0; i < work_->banks.size(); ++i) {
    const Work::Bank& bank = work_->banks[i];
    const DeviceClips& clips = *bank.clips;
    tables.store(i * bankWords, abi::BankRecord{bank.words, clips.nodeCount, 0, 0});
    std::uint32_t begin = 0;
    for (std::size_t band = 0; band < clips.bandEnds.size(); ++band) {
      tables.store(i * bankWords + abi::BANK_WORDS + band * abi::BAND_WORDS,
                   abi::BandRecord{bank.deviceWords + begin * abi::STEP_WORDS,
                                   clips.bandEnds[band] - begin, 0, 0});
      begin = clips.bandEnds[band];
    }
  }
  const std::uint32_t figures = tables.size();
  figureWords_.clear();
  for (const std::vector<abi::FigureRecord>& records : work_->figures) {
    figureWords_.push_back(tables.size());
    for (abi::FigureRecord record : records) {
      record.bank *= static_cast<std::uint32_t>(bankWords);
      tables.append(record);
    }
    count += records.size();
  }
  if (Result<void> good = addDispatch(poseVariant(Kernel::sample, plan_->limits, tuning_), count,
                                      abi::SamplePush{figures, 0});
      !good)
    return good;
  for (std::uint32_t band = 0; band < bands; ++band) {
    std::uint32_t first = figures;
    for (std::uint32_t buffer = 0; buffer < work_->figures.size(); ++buffer) {
      const std::size_t here = work_->figures[buffer].size();
      if (here == 0) continue;
      if (Result<void> good = addDispatch(poseVariant(Kernel::compose, plan_->limits, tuning_),
                                          here, abi::ComposePush{first, 0, band});
          !good)
        return good;
      first += static_cast<std::uint32_t>(here) * abi::FIGURE_WORDS;
      Dispatch& dispatch = dispatches_.back();
      dispatch.stage = ++paletteStage_;
      dispatch.joints = BufferRole::gpuPoses;
      dispatch.poseBuffer = buffer;
    }
  }
  ++paletteStage_;
  return {};
}

/// One invocation per pose, a dispatch for each rig and each pair of buffers. They wait for each
/// other, since each reads and writes driven joints.
Result<void> Encoder::addRigDispatches() {
  TableWords& tables = plan_->tables;
  for (const Work::Rig& rig : work_->rigs) {
    const std::uint32_t first = tables.size();
    for (std::size_t i = 0; i < rig.poses.size(); ++i) {
      abi::RigRecord record = rig.poses[i];
      record.figure = abi::RIG_NO_FIGURE;
      if (rig.figures[i] != notUsed) {
        const auto& [buffer, place] = work_->figurePlaces[rig.figures[i]];
        record.figure = figureWords_[buffer] + place * abi::FIGURE_WORDS;
      }
      tables.append(record);
    }
    const auto count = static_cast<std::uint32_t>(rig.poses.size());
    if (Result<void> good = addDispatch(poseVariant(Kernel::rig, plan_->limits, tuning_),
                                        divideUp(count, tuning_.workgroupSize),
                                        abi::RigPush{rig.words, first, count, 0});
        !good)
      return good;
    Dispatch& dispatch = dispatches_.back();
    dispatch.stage = paletteStage_++;
    dispatch.joints = rig.joints;
    dispatch.poseBuffer = rig.buffer;
    dispatch.drivenBuffer = rig.drivenBuffer;
  }
  return {};
}

Result<void> Encoder::addPaletteDispatches() {
  paletteWords_.resize(work_->poses.size() * paletteKindCount);
  for (std::size_t index = 0; index < work_->poses.size(); ++index) {
    const Work::Poses& poses = work_->poses[index];
    for (std::uint32_t rest = poses.filled; rest != 0; rest &= rest - 1) {
      const auto kind = static_cast<std::uint32_t>(std::countr_zero(rest));
      paletteWords_[index * paletteKindCount + kind] = plan_->tables.size();
      if (Result<void> good = addPaletteDispatch(poses, kind); !good) return good;
    }
  }
  return {};
}

/// One workgroup per palette.
Result<void> Encoder::addPaletteDispatch(const Work::Poses& poses, std::uint32_t kind) {
  const auto& [records, drivenRecords] = poses.lists[kind];
  const std::uint32_t first = plan_->tables.appendAll(records);
  const std::uint32_t driven = plan_->tables.appendAll(drivenRecords);
  const Variant variant = paletteVariant(static_cast<PaletteForm>(kind / jointPromiseCount),
                                         static_cast<JointPromise>(kind % jointPromiseCount),
                                         poses.drivenBuffer != notUsed, plan_->limits, tuning_);
  if (Result<void> good = addDispatch(variant, records.size(), abi::PalettePush{first, 0, driven});
      !good)
    return good;
  Dispatch& dispatch = dispatches_.back();
  dispatch.stage = paletteStage_;
  dispatch.joints = poses.joints;
  dispatch.poseBuffer = poses.buffer;
  dispatch.drivenBuffer = poses.drivenBuffer;
  return {};
}

/// One invocation per result.
Result<void> Encoder::addClearDispatch() {
  if (work_->clearedResults.empty()) return {};
  const std::uint32_t first = plan_->tables.appendAll(work_->clearedResults);
  plan_->tables.alignToUnit();
  return addDispatch(
      variantOf(Kernel::clear, plan_->limits, tuning_),
      divideUp(work_->clearedResults.size(), tuning_.workgroupSize),
      abi::ClearPush{first, static_cast<std::uint32_t>(work_->clearedResults.size()), 0});
}

/// Workgroups that process each vertex of a group once.
std::uint64_t Encoder::vertexGroupsOf(const Group& group) const {
  return divideUp(group.key.vertexEnd - group.key.firstVertex,
                  std::uint64_t{tuning_.workgroupSize} * verticesPerInvocation_);
}

/// For one dispatch, given its groups. An invocation with few instances skins several vertices, so
/// that what is the same for all vertices of a group is read less often.
void Encoder::chooseVerticesPerInvocation(std::span<const std::uint32_t> groups) {
  // Enough for the threads of a CPU. A guess: measured with two threads only.
  constexpr std::uint64_t minWorkgroups = 32;
  verticesPerInvocation_ = 1;
  if (!plan_->limits.texelBuffers) return;
  std::uint64_t instances = 0;
  for (const std::uint32_t group : groups) instances += work_->groups[group].instances;
  const auto workgroups = [&] {
    std::uint64_t count = 0;
    for (const std::uint32_t group : groups) count += vertexGroupsOf(work_->groups[group]);
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
std::uint32_t Encoder::instancesPerInvocation(std::span<const std::uint32_t> groups) const {
  std::uint32_t instances = tuning_.instancesPerInvocation;
  for (; instances > 1 && tuning_.minWorkgroups > 0; instances = (instances + 1) / 2) {
    std::uint64_t workgroups = 0;
    for (const std::uint32_t group : groups)
      workgroups += vertexGroupsOf(work_->groups[group]) *
                    divideUp(work_->groups[group].instances, instances);
    if (workgroups >= tuning_.minWorkgroups) break;
  }
  return instances;
}

/// A record for each group, and a dispatch for groups of one variant and output range.
Result<void> Encoder::addDispatches() {
  TableWords& tables = plan_->tables;
  const std::uint32_t groupRecords = tables.grow(work_->groups.size() * abi::GROUP_WORDS);
  const std::uint32_t instanceRecords = tables.size();
  const bool palettesRun = !dispatches_.empty();
  instancesEach_.clear();

  const std::span<const std::uint32_t> order = work_->order;
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin;
    while (end < order.size() && work_->shareDispatch(order[begin], order[end])) ++end;
    chooseVerticesPerInvocation(order.subspan(begin, end - begin));
    const std::uint32_t mostInstances = instancesPerInvocation(order.subspan(begin, end - begin));
    std::uint64_t workgroups = 0;
    for (std::size_t index = begin; index < end; ++index) {
      const Group& group = work_->groups[order[index]];
      const std::uint64_t vertexGroups = vertexGroupsOf(group);
      const std::uint64_t shares = divideUp(group.instances, mostInstances);
      workgroups += vertexGroups * shares;
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
      // About the same for all, so that workgroups take about the same time.
      record.instancesEach = static_cast<std::uint32_t>(divideUp(group.instances, shares));
      instancesEach_.push_back(record.instancesEach);
      tables.store(groupRecords + index * abi::GROUP_WORDS, record);
    }
    const Group& group = work_->groups[order[begin]];
    const Variant& variant = group.variant;
    const abi::SkinPush push{static_cast<std::uint32_t>(groupRecords + begin * abi::GROUP_WORDS),
                             static_cast<std::uint32_t>(end - begin), 0, instanceRecords,
                             verticesPerInvocation_};
    if (Result<void> good = addDispatch(variant, workgroups, push, group.key.pipeline); !good)
      return good;
    Dispatch& dispatch = dispatches_.back();
    dispatch.windows = group.key.windows;
    dispatch.instancesPerInvocation = mostInstances;
    const bool readsPoses = variant.method == Method::linear && !plan_->sizes.isScene;
    dispatch.joints = readsPoses ? BufferRole::poses : BufferRole::palettes;
    // A kernel that may name the results counts as one that reads them.
    if (palettesRun && (!readsPoses || variant.motion || hasResults(variant)))
      dispatch.stage = paletteStage_ + 1;
    begin = end;
  }
  return {};
}

std::uint32_t Encoder::appendExtension(const InstanceExtras& extras) {
  TableWords& tables = plan_->tables;
  tables.alignToUnit();
  const std::uint32_t place = tables.grow(abi::EXTENSION_WORDS);
  abi::ExtensionRecord extension{};
  extension.morphs = tables.appendAll(extras.morphs);  // needs no alignment
  extension.morphCount = static_cast<std::uint32_t>(extras.morphs.size());
  tables.appendZeros((std::size_t{extras.writtenMorphs} + extras.drivenMorphs) *
                     abi::ACTIVE_MORPH_WORDS);
  if (extras.result != notUsed) extension.result = extras.result;
  if (extras.hasBox) setBox(extension, extras.box);
  tables.store(place, extension);
  return place;
}

/// `last` and `step` may wrap.
inline void Encoder::GroupProgress::add(const InstanceWords& words, const InstanceExtras* extras) {
  std::uint32_t differences = 0;
  for (std::size_t word = 0; word < words.size(); ++word) {
    const std::uint32_t distance = words[word] - last[word];
    differences |= distance ^ step[word];
    step[word] = distance;
    last[word] = words[word];
  }
  if (count++ > 1 && differences != 0) isEven = false;
  if (extras == nullptr || !extras->hasBox) return;
  if (box == nullptr) box = &extras->box;
  if (std::memcmp(box, &extras->box, sizeof(Box)) != 0) isEven = false;
}

void Encoder::writeInstances() {
  TableWords& tables = plan_->tables;
  const std::uint32_t firstRecord = tables.grow(work_->instances.size() * abi::INSTANCE_WORDS);
  culledPlaces_.resize(work_->culled.size());
  progress_.assign(work_->groups.size(), {});
  listRecords_.clear();
  auto candidate = work_->culled.begin();
  auto list = work_->morphLists.begin();
  for (std::uint32_t number = 0; number < work_->instances.size(); ++number) {
    const Work::Instance& instance = work_->instances[number];
    GroupProgress& progress = progress_[instance.group];
    const std::uint32_t place = work_->groups[instance.group].firstInstance + progress.count;
    const std::uint32_t extension =
        instance.extras != nullptr ? appendExtension(*instance.extras) : 0;
    const PlacedRun& run = instance.run;
    // Not a record in memory, which could be copied only when all its words have arrived there.
    const InstanceWords words = {instance.palette, run.offsets[0],
                                 run.offsets[1],   run.offsets[2],
                                 run.offsets[3],   run.joints | instance.flags,
                                 extension,        0};
    tables.storeWords(firstRecord + std::size_t{place} * abi::INSTANCE_WORDS, words);
    progress.add(words, instance.extras);
    if (candidate != work_->culled.end() && candidate->instance == number)
      culledPlaces_[static_cast<std::size_t>(candidate++ - work_->culled.begin())] = place;
    if (list != work_->morphLists.end() && list->instance == number) {
      abi::MorphListRecord& made = listRecords_.emplace_back((list++)->record);
      made.extension = extension;
      made.listed = static_cast<std::uint32_t>(instance.extras->morphs.size());
      made.list = extension + abi::EXTENSION_WORDS + made.listed * abi::ACTIVE_MORPH_WORDS;
    }
  }
  culled_.instances = firstRecord;
  markEvenlySpaced(firstRecord);
}

/// One invocation for each list; a dispatch for those whose weights are in the same buffers.
Result<void> Encoder::addMorphLists() {
  TableWords& tables = plan_->tables;
  const std::span<const Work::MorphList> lists = work_->morphLists;
  const auto shareDispatch = [](const Work::MorphList& a, const Work::MorphList& b) {
    return a.buffer == b.buffer && a.drivenBuffer == b.drivenBuffer;
  };
  for (std::size_t begin = 0; begin < lists.size(); ++begin) {
    const Work::MorphList& head = lists[begin];
    const auto isLike = [&](const Work::MorphList& list) { return shareDispatch(list, head); };
    if (std::ranges::any_of(lists.first(begin), isLike)) continue;
    tables.alignToUnit();
    const std::uint32_t first = tables.size();
    for (std::size_t i = begin; i < lists.size(); ++i) {
      if (isLike(lists[i])) tables.append(listRecords_[i]);
    }
    const std::uint32_t count = (tables.size() - first) / abi::MORPH_LIST_WORDS;
    if (Result<void> good = addDispatch(variantOf(Kernel::morphLists, plan_->limits, tuning_),
                                        divideUp(count, tuning_.workgroupSize),
                                        abi::MorphListPush{first, count, 0});
        !good)
      return good;
    Dispatch dispatch = dispatches_.back();
    dispatches_.pop_back();
    if (head.buffer != notUsed) {
      dispatch.joints = BufferRole::gpuPoses;
      dispatch.poseBuffer = head.buffer;
    }
    dispatch.drivenBuffer = head.drivenBuffer;
    (head.drivenBuffer == notUsed ? lists_ : drivenLists_).push_back(dispatch);
  }
  return {};
}

/// Instances that the GPU chooses are not: their records are moved.
void Encoder::markEvenlySpaced(std::uint32_t firstRecord) {
  const std::size_t groups = firstRecord - work_->groups.size() * abi::GROUP_WORDS;
  constexpr std::size_t word = offsetof(abi::GroupRecord, instancesEach) / 4;
  for (std::size_t place = 0; place < work_->order.size(); ++place) {
    const GroupProgress& progress = progress_[work_->order[place]];
    if (work_->groups[work_->order[place]].key.isCulled || !progress.isEven || progress.count < 2)
      continue;
    plan_->tables.store(groups + place * abi::GROUP_WORDS + word,
                        instancesEach_[place] | abi::EVENLY_SPACED);
  }
}

std::uint32_t Encoder::figureWord(const Candidate& candidate) const {
  if (candidate.figure == notUsed) return abi::CANDIDATE_NEEDS_NONE;
  const auto& [buffer, place] = work_->figurePlaces[candidate.figure];
  return figureWords_[buffer] + place * abi::FIGURE_WORDS;
}
std::uint32_t Encoder::paletteWord(const Candidate& candidate) const {
  const PalettePlace& palette = candidate.palette;
  if (palette.index == notUsed) return abi::CANDIDATE_NEEDS_NONE;
  return paletteWords_[palette.list] + palette.index * abi::PALETTE_WORDS;
}

/// In the order of the instance records.
void Encoder::appendCandidates() {
  TableWords& tables = plan_->tables;
  culled_.firstInstance =
      static_cast<std::uint32_t>(work_->instances.size() - work_->culled.size());
  tables.alignToUnit();
  culled_.candidates = tables.grow(work_->culled.size() * abi::CANDIDATE_WORDS);
  for (std::size_t index = 0; index < work_->culled.size(); ++index) {
    const Candidate& candidate = work_->culled[index].candidate;
    const std::size_t number = culledPlaces_[index] - culled_.firstInstance;
    tables.store(culled_.candidates + number * abi::CANDIDATE_WORDS,
                 abi::CandidateRecord{candidate.slot, candidate.version, figureWord(candidate),
                                      paletteWord(candidate)});
  }
}

/// Groups that are culled come last, and so do their dispatches: these get their arguments from the
/// GPU.
void Encoder::appendCulledDispatches() {
  TableWords& tables = plan_->tables;
  culledGroups_ = static_cast<std::uint32_t>(
      std::ranges::count_if(work_->groups, [](const Group& group) { return group.key.isCulled; }));
  const std::uint32_t groupsEnd = culled_.instances;  // instance records follow the groups
  culled_.groups = groupsEnd - culledGroups_ * abi::GROUP_WORDS;
  const auto pushOf = [](const Dispatch& dispatch) {
    return abi::load<abi::SkinPush>(dispatch.command.constants, 0);
  };
  std::size_t first = dispatches_.size();
  while (first > 0 && dispatches_[first - 1].variant.kernel == Kernel::skin &&
         pushOf(dispatches_[first - 1]).groups >= culled_.groups)
    --first;
  const std::size_t count = dispatches_.size() - first;
  tables.alignToUnit();
  culled_.dispatches = tables.grow(count * abi::CULLED_DISPATCH_WORDS);
  culled_.arguments = tables.appendZeros(count * abi::INDIRECT_WORDS);
  for (std::size_t index = 0; index < count; ++index) {
    DispatchCommand& dispatch = dispatches_[first + index].command;
    abi::SkinPush push = pushOf(dispatches_[first + index]);
    tables.store(culled_.dispatches + index * abi::CULLED_DISPATCH_WORDS,
                 abi::CulledDispatchRecord{push.groups, push.groupCount,
                                           dispatches_[first + index].instancesPerInvocation, 0});
    // Only the GPU knows the number of workgroups. Excess ones find no instance in the last group.
    push.workgroupCount = notUsed;
    setConstants(dispatch, push);
    dispatch.groupCountX = dispatch.groupCountY = dispatch.workgroupCount = 0;
    dispatch.indirect.offset = (culled_.arguments + index * abi::INDIRECT_WORDS) * 4;
    dispatch.indirect.size = 12;  // VkDispatchIndirectCommand
  }
  visibility_[1].command.workgroupCount = static_cast<std::uint32_t>(count);
}

/// First pass: a workgroup for each group. Second pass: one for each indirect dispatch.
Result<void> Encoder::addVisibilityDispatches(std::uint32_t record) {
  visibility_[0].command.workgroupCount = culledGroups_;
  const std::uint32_t most = std::max(culledGroups_, visibility_[1].command.workgroupCount);
  if (most > plan_->limits.maxWorkgroupCountX) {
    return Error{ErrorCode::limitExceeded,
                 "instances that are culled on the GPU have " + std::to_string(most) +
                     " combinations of mesh and layout, but the device allows at most " +
                     std::to_string(plan_->limits.maxWorkgroupCountX) + " workgroups"};
  }
  culled_.frame = record;
  culled_.maxWorkgroups = plan_->limits.maxWorkgroupCountX;
  for (const std::uint32_t pass : {abi::VISIBILITY_CHOOSES, abi::VISIBILITY_COUNTS}) {
    visibility_[pass].variant = variantOf(Kernel::visibility, plan_->limits, tuning_);
    DispatchCommand& dispatch = visibility_[pass].command;
    dispatch.pipeline = visibility_[pass].variant.id();
    dispatch.groupCountX = dispatch.workgroupCount;
    dispatch.groupCountY = 1;
    culled_.pass = pass;
    setConstants(dispatch, culled_);
  }
  return {};
}

}  // namespace dermis
