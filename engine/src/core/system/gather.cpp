// Collects the work of a frame, and updates the state when the frame is committed or abandoned.

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>

#include "system/books.h"

namespace dermis {
namespace {

std::uint32_t culledFlags(const SceneInstance& instance, bool hasMotion, bool restarts) {
  std::uint32_t flags = instance.extras.result != notUsed ? abi::INSTANCE_HAS_RESULT : 0u;
  if (hasMotion) {
    flags |= abi::INSTANCE_HAS_MOTION;
    if (restarts) flags |= abi::INSTANCE_RESTARTS;
  }
  return flags;
}

}  // namespace

/// All instances of a pose with the same interval are due in the same frames, even if the engine
/// skips frame numbers: they are due if a multiple of the interval lies between the last record and
/// this one.
bool SceneBooks::isDue(const InstanceState& state, std::uint32_t pose) const {
  const bool cameBack = state.visibleFrom == record_ + 1;
  if (state.isUrgent || cameBack || state.updateInterval == 1) return true;
  const std::uint64_t beat = pose;
  return (frame_ + beat) / state.updateInterval != (recordedFrame_ + beat) / state.updateInterval;
}

std::uint32_t SceneBooks::paletteUnit(const SceneInstance& instance) const {
  const auto form = static_cast<std::size_t>(paletteForm(instance.method));
  return poses_.at(instance.pose).forms[form].unit;
}

/// Converts a pose once for all instances that read it, and only if one does.
void SceneBooks::convertPalette(const SceneInstance& instance) {
  const PaletteForm form = paletteForm(instance.method);
  ScenePose& pose = poses_.at(instance.pose);
  ScenePose::Form& converted = pose.forms[static_cast<std::size_t>(form)];
  if (converted.version == pose.version || converted.plannedIn == planNumber_) return;
  converted.plannedIn = planNumber_;
  conversions_.push_back({instance.poseHandle, static_cast<std::size_t>(form)});
  const bool isCpu = pose.writer == PoseWriter::cpu;
  const PoseSource source{static_cast<std::uint32_t>(placeOf(pose).offset / unitBytes), pose.buffer,
                          isCpu ? BufferRole::poses : BufferRole::gpuPoses};
  work_.addPose(source, converted.unit, pose.jointCount, form, pose.mayScale);
}

void SceneBooks::addRuns(const SceneInstance& instance, std::uint32_t flags,
                         const Candidate* candidate) {
  const InstanceExtras* extras = instance.extras.isNeeded() ? &instance.extras : nullptr;
  const std::uint32_t palette = paletteUnit(instance);
  const auto add = [&](const PlacedRun& run) {
    const Work::Instance skinned{&run, extras, instance.pose, palette, flags};
    if (candidate != nullptr) {
      work_.addCulled(skinned, *candidate);
    } else {
      work_.add(skinned);
    }
  };
  add(instance.run);
  for (const PlacedRun& run : instance.furtherRuns) add(run);
}

void SceneBooks::gatherPoses() {
  for (const PoseHandle handle : posed_) {
    const ScenePose* pose = poses_.find(handle);
    if (pose == nullptr) continue;
    for (std::uint32_t index = pose->firstInstance; index != notUsed;
         index = instances_.at(index).nextOfPose)
      makeStale(index);
  }
  posed_.clear();
}

void SceneBooks::addDue(std::uint32_t index) {
  SceneInstance& instance = instances_.at(index);
  instance.plannedIn = planNumber_;
  due_.push_back(index);
  convertPalette(instance);
  const InstanceState& state = states_[index];
  addRuns(instance, state.hasMotion && restarts(state, record_ + 1) ? abi::INSTANCE_RESTARTS : 0u,
          nullptr);
  if (instance.extras.result != notUsed) {
    work_.clearedResults.push_back(instance.extras.result);
    plannedResults_.push_back(instance.extras.result);
  }
  planned_.skinnedVertices += instance.vertexCount;
  planned_.writtenBytes += std::uint64_t{instance.vertexCount} * instance.vertexBytes;
}

/// Instances that are not due stay in the list; those that are due stay until `commit`.
void SceneBooks::gatherPending() {
  std::size_t kept = 0;
  for (std::size_t entry = 0; entry < pending_.size(); ++entry) {
    const InstanceHandle handle = pending_[entry];
    InstanceState* const state = findState(handle);
    if (state == nullptr) continue;
    if (!state->isStale || !state->isVisible) {
      state->isListed = false;
      continue;
    }
    if (isDue(*state, instances_.at(handle.index).pose)) addDue(handle.index);
    pending_[kept++] = handle;
  }
  pending_.resize(kept);
}

/// An instance that moved when it was last displayed, and is now displayed without being skinned,
/// is at rest: its previous positions become the current ones. Instances that leave the view are
/// not settled, since they are usually skinned when they return.
void SceneBooks::gatherSettling() {
  for (const InstanceHandle handle : moving_) {
    SceneInstance* instance = instances_.find(handle);
    if (instance == nullptr || instance->plannedIn == planNumber_ ||
        instance->settledIn == planNumber_ || !states_[handle.index].isVisible)
      continue;
    instance->settledIn = planNumber_;
    settling_.push_back(handle.index);
    addRuns(*instance, abi::INSTANCE_SETTLES, nullptr);
  }
}

/// All culled instances, in every frame: the CPU does not know which ones the GPU skinned.
void SceneBooks::gatherCulled() {
  for (const std::uint32_t index : culled_) {
    SceneInstance& instance = instances_.at(index);
    const InstanceState& state = states_[index];
    if (!state.isVisible) continue;
    std::uint32_t version = instance.version;
    const bool isNew = version == 0 || (state.isStale && isDue(state, instance.pose));
    if (isNew) {
      version = ++nextVersion_;
      versioned_.push_back({index, version});
    }
    // There is no box until the GPU skins it for the first time, and the CPU does not know when
    // that is.
    if (instance.extras.result != notUsed) {
      if (instance.firstFrame == 0) work_.clearedResults.push_back(instance.extras.result);
      plannedResults_.push_back(instance.extras.result);
    }
    convertPalette(instance);
    const Candidate candidate{index, version};
    // One that the GPU has yet to show in this version comes back, and restarts for that.
    const bool restarts = isNew && state.restartsMotion;
    addRuns(instance, culledFlags(instance, state.hasMotion, restarts), &candidate);
  }
}

void SceneBooks::gatherMoves() {
  for (const InstanceHandle handle : shifting_) {
    const SceneInstance* instance = instances_.find(handle);
    if (instance == nullptr || !instance->shown || instance->shown->mesh != instance->target.mesh ||
        instance->shown == instance->target)
      continue;
    moves_.push_back({BufferRole::positions, BufferRole::positions, instance->shown->bytes.offset,
                      instance->target.bytes.offset, instance->target.bytes.size});
    planned_.movedBytes += instance->target.bytes.size;
  }
}

/// The results that the frame writes. A result has the same offset in both buffers, plus the
/// counters in the read-back buffer. Results between two that are near each other are copied, too.
void SceneBooks::gatherResults() {
  constexpr std::uint32_t bits = 64;
  std::vector<std::uint64_t>& marks = resultMarks_;
  marks.clear();
  for (const std::uint32_t result : plannedResults_) {
    if (result / bits >= marks.size()) marks.resize(result / bits + std::size_t{1});
    marks[result / bits] |= std::uint64_t{1} << result % bits;
  }
  for (std::size_t begin = 0; begin < marks.size(); ++begin) {
    if (marks[begin] == 0) continue;
    std::size_t last = begin;
    while (last + 1 < marks.size() && marks[last + 1] != 0) ++last;
    const std::uint64_t first =
        begin * bits + static_cast<std::uint64_t>(std::countr_zero(marks[begin]));
    const std::uint64_t end =
        (last + 1) * bits - static_cast<std::uint64_t>(std::countl_zero(marks[last]));
    resultCopies_.push_back(
        {BufferRole::results, BufferRole::readBack, first * sizeof(InstanceResult),
         readBackResults + first * sizeof(InstanceResult), (end - first) * sizeof(InstanceResult)});
    begin = last;
  }
}

Result<void> SceneBooks::gather() {
  if (!hasBegun_) {
    return Error{ErrorCode::invalidArgument, "beginFrame must be called before each frame"};
  }
  ++planNumber_;
  isPlanned_ = false;
  due_.clear();
  settling_.clear();
  versioned_.clear();
  conversions_.clear();
  moves_.clear();
  plannedResults_.clear();
  resultCopies_.clear();
  planned_ = {};
  work_.begin(groups_);
  gatherPoses();
  gatherMoves();
  gatherPending();
  gatherSettling();
  gatherCulled();
  gatherResults();
  work_.arrange();
  for (const Conversion& conversion : conversions_) {
    const ScenePose& pose = poses_.at(conversion.pose.index);
    if (pose.writer == PoseWriter::cpu) planned_.poseBytes += pose.jointCount * sizeof(JointMatrix);
  }
  planned_.frame = frame_;
  planned_.instances = instances_.size();
  planned_.skinnedInstances = static_cast<std::uint32_t>(due_.size());
  planned_.settledInstances = static_cast<std::uint32_t>(settling_.size());
  planned_.convertedPoses = work_.poseCount;
  planned_.culledCandidates = static_cast<std::uint32_t>(work_.culled.size());
  isPlanned_ = true;
  return {};
}

Result<void> SceneBooks::plan(Plan& out) {
  if (Result<void> gathered = gather(); !gathered) return gathered;
  PlanData& data = PlanData::of(out);
  const auto record = static_cast<std::uint32_t>(record_ + 1);
  const FrameWork frame{record, clearHistory_, moves_, resultCopies_};
  if (Result<void> good =
          encoder_.encode(work_, description_.limits, description_.tuning, sizes(), data, &frame);
      !good) {
    isPlanned_ = false;
    data.clear();
    return good;
  }
  data.vertexCount = planned_.skinnedVertices;
  return {};
}

/// Whether `target` has now been recorded, and so is shown.
bool SceneBooks::commitShift(SceneInstance& instance, InstanceHandle handle) {
  const bool isMove = instance.shown && instance.shown->mesh == instance.target.mesh;
  const bool isCulled = states_[handle.index].isCulled;
  if (!isMove && !isCulled && instance.plannedIn != planNumber_) return false;
  abandonable_.shifts.push_back({handle, instance.shown});
  if (instance.shown && instance.shown != instance.target) {
    retire(outputStore_.ranges, instance.shown->bytes);
    moved_.push_back(handle);
  }
  instance.shown = instance.target;
  instance.isShifting = false;
  return true;
}

void SceneBooks::keepForAbandoning() {
  abandonable_.isPossible = true;
  abandonable_.recordedFrame = recordedFrame_;
  abandonable_.clearHistory = clearHistory_;
  abandonable_.instances.clear();
  abandonable_.shifts.clear();
}

/// Marks the instance as up to date.
void SceneBooks::commitInstance(std::uint32_t index) {
  InstanceState& state = states_[index];
  SceneInstance& instance = instances_.at(index);
  abandonable_.instances.push_back({{index, state.generation},
                                    state.restartsMotion,
                                    state.isUrgent,
                                    state.isMoving,
                                    instance.firstFrame == 0,
                                    instance.version});
  state.isStale = state.isUrgent = state.restartsMotion = false;
  if (instance.firstFrame == 0) instance.firstFrame = frame_;
}

Result<void> SceneBooks::commit() {
  if (!isPlanned_) return invalid("there is no plan to commit, or the scene has changed since");
  keepForAbandoning();
  isPlanned_ = false;
  ++record_;
  recordedFrame_ = frame_;
  hasBegun_ = false;
  committed_ = planned_;
  const bool culls = planned_.culledCandidates != 0;
  if (culls) clearHistory_ = static_cast<std::uint32_t>(slotCapacity_);
  ReadBack& readBack = readBacks_[static_cast<std::size_t>(record_ % readBacks_.size())];
  readBack.swap(abandonable_.readBack);
  readBack.frame = frame_;
  readBack.hasCounters = culls;
  readBack.results.swap(resultCopies_);
  skinned_.clear();
  settled_.clear();
  moved_.clear();
  moving_.clear();
  for (const Conversion& conversion : conversions_) {
    ScenePose& pose = poses_.at(conversion.pose.index);
    pose.forms[conversion.form].version = pose.version;
  }
  for (const std::uint32_t index : due_) {
    InstanceState& state = states_[index];
    const InstanceHandle handle{index, state.generation};
    // The same as when it was planned: nothing changed since.
    const bool moves = state.hasMotion && !restarts(state, record_);
    commitInstance(index);
    state.isListed = false;
    state.isMoving = moves;
    if (moves) moving_.push_back(handle);
    skinned_.push_back(handle);
  }
  std::erase_if(pending_, [this](InstanceHandle handle) { return !states_[handle.index].isStale; });
  for (const std::uint32_t index : settling_) {
    states_[index].isMoving = false;
    settled_.push_back(instances_.handleOf(index));
  }
  for (const auto& [index, version] : versioned_) {
    commitInstance(index);
    instances_.at(index).version = version;
  }
  std::erase_if(shifting_, [this](InstanceHandle handle) {
    SceneInstance* instance = instances_.find(handle);
    return instance == nullptr || commitShift(*instance, handle);
  });
  return {};
}

/// They are skinned again, as they would have been without the frame.
void SceneBooks::abandonInstances() {
  for (const Abandonable::Instance& before : abandonable_.instances) {
    InstanceState* const state = findState(before.handle);
    if (state == nullptr) continue;
    state->restartsMotion |= before.restartsMotion;
    state->isUrgent |= before.isUrgent;
    state->isMoving = before.isMoving;
    SceneInstance& instance = instances_.at(before.handle.index);
    if (before.isFirst) instance.firstFrame = 0;
    instance.version = before.version;
    makeStale(before.handle.index);
  }
  for (const InstanceHandle handle : settled_) {
    if (InstanceState* const state = findState(handle)) state->isMoving = true;
  }
  moving_.clear();
  for (std::uint32_t index = 0; index < states_.size(); ++index) {
    InstanceState& state = states_[index];
    if (state.generation == 0) continue;
    // These count records, and the abandoned record does not count.
    if (state.visibleFrom == record_ + 1)
      state.visibleFrom = state.hiddenAfter + 1 == record_ ? 0 : record_;
    if (state.hiddenAfter == record_)
      state.hiddenAfter = state.visibleFrom == record_ ? 0 : record_ - 1;
    if (state.isMoving) moving_.push_back({index, state.generation});
  }
}

/// The output of the frame before is displayed again. `commit` retired its place, and no other
/// instance can have taken it: places are reused after `beginFrame` only.
void SceneBooks::abandonShifts() {
  std::vector<std::uint64_t> shownAgain;  // offsets of places
  for (const Abandonable::Shift& shifted : abandonable_.shifts) {
    SceneInstance* instance = instances_.find(shifted.handle);
    if (instance == nullptr) continue;
    const Place abandoned = *instance->shown;
    instance->shown = shifted.shown;
    if (shifted.shown && shifted.shown != abandoned)
      shownAgain.push_back(shifted.shown->bytes.offset);
    if (instance->target != abandoned) retire(outputStore_.ranges, abandoned.bytes);
    if (instance->shown != instance->target) shift(shifted.handle);
  }
  // Retired places do not overlap, so the offset tells which one it is.
  std::ranges::sort(shownAgain);
  std::erase_if(retired_, [&](const Retired& retired) {
    return retired.store == &outputStore_.ranges &&
           std::ranges::binary_search(shownAgain, retired.range.offset);
  });
}

Result<void> SceneBooks::abandonFrame(std::uint64_t frame) {
  if (!abandonable_.isPossible || frame != frame_) {
    return invalid("frame " + std::to_string(frame) +
                   " cannot be abandoned: it is not the frame that was committed last, or another "
                   "has begun since");
  }
  abandonable_.isPossible = false;
  abandonInstances();
  abandonShifts();
  for (const Conversion& conversion : conversions_) {
    if (ScenePose* pose = poses_.find(conversion.pose)) pose->forms[conversion.form].version = 0;
  }
  readBacks_[static_cast<std::size_t>(record_ % readBacks_.size())].swap(abandonable_.readBack);
  clearHistory_ = abandonable_.clearHistory;
  recordedFrame_ = abandonable_.recordedFrame;
  --record_;
  hasBegun_ = true;
  isPlanned_ = false;
  skinned_.clear();
  settled_.clear();
  moved_.clear();
  committed_ = {};
  return {};
}

Result<void> SceneBooks::readBack(std::uint64_t frame, std::span<const std::byte> bytes) {
  const auto found = std::ranges::find(readBacks_, frame, &ReadBack::frame);
  if (found == readBacks_.end() || frame == 0) {
    return invalid("frame " + std::to_string(frame) +
                   " cannot be read back: it is not one of the last " +
                   std::to_string(readBacks_.size()) + " frames that were committed");
  }
  if (frame > completed_ || frame <= culling_.frame) {
    return invalid("frame " + std::to_string(frame) +
                   " cannot be read back: it must be complete, which frames up to " +
                   std::to_string(completed_) + " are, and newer than the last that was, " +
                   std::to_string(culling_.frame));
  }
  std::uint64_t needed = found->hasCounters ? readBackResults : 0;
  for (const CopyCommand& copy : found->results)
    needed = std::max(needed, copy.toOffset + copy.size);
  if (bytes.size() < needed) {
    return invalid("the read-back buffer of a frame has " + std::to_string(bytes.size()) +
                   " bytes, fewer than the " + std::to_string(needed) +
                   " that Plan::buffer returned");
  }
  culling_ = {};
  culling_.frame = frame;
  if (found->hasCounters) {
    abi::CounterRecord counted;
    std::memcpy(&counted, bytes.data() + readBackCounters, sizeof(counted));
    culling_.visibleInstances = counted.visible;
    culling_.skinnedInstances = counted.skinned;
    culling_.settledInstances = counted.settled;
    culling_.workgroups = counted.workgroups;
  }
  for (const CopyCommand& copy : found->results) {
    // All of it is in `bytes`.
    const auto first = static_cast<std::size_t>(copy.fromOffset / sizeof(InstanceResult));
    const auto size = static_cast<std::size_t>(copy.size);
    const std::size_t count = size / sizeof(InstanceResult);
    latestResults_.resize(std::max(latestResults_.size(), first + count));
    resultFrames_.resize(latestResults_.size());
    std::memcpy(&latestResults_[first], bytes.data() + copy.toOffset, size);
    std::fill_n(resultFrames_.begin() + static_cast<std::ptrdiff_t>(first), count, frame);
  }
  return {};
}

Result<std::optional<Box>> SceneBooks::bounds(InstanceHandle handle) const {
  const SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  if (!instance->bounds || instance->firstFrame == 0) return std::optional<Box>();
  // Not read back since the instance was first skinned: what is there is of another instance.
  const std::uint32_t result = instance->extras.result;
  if (result >= resultFrames_.size() || resultFrames_[result] < instance->firstFrame)
    return std::optional<Box>();
  return latestResults_[result].box();
}

}  // namespace dermis
