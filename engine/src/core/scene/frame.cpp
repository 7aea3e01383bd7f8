// Frames: begins them, collects their work, and updates the state when they are committed or
// abandoned.

#include <algorithm>
#include <bit>
#include <cstring>
#include <iterator>
#include <string>
#include <utility>

#include "scene/books.h"

namespace dermis {
namespace {

std::uint32_t culledFlags(const SceneInstance& instance, bool hasMotion, bool restarts,
                          bool holds) {
  std::uint32_t flags = instance.extras.result != notUsed ? abi::INSTANCE_HAS_RESULT : 0u;
  if (hasMotion) {
    flags |= abi::INSTANCE_HAS_MOTION;
    if (restarts) flags |= abi::INSTANCE_RESTARTS;
    if (holds) flags |= abi::INSTANCE_HOLDS;
  }
  return flags;
}

}  // namespace

/// All instances of a pose with the same interval are due in the same frames, even if the engine
/// skips frame numbers: they are due if a multiple of the interval lies between the last record and
/// this one.
bool SceneBooks::isOnBeat(std::uint32_t interval, std::uint32_t pose) const {
  const std::uint64_t beat = pose;
  return (frame_ + beat) / interval != (recordedFrame_ + beat) / interval;
}

/// Whether the frame draws the instance between its last two updates, if it is not skinned again.
bool SceneBooks::holds(std::uint32_t index) const {
  const InstanceState& state = states_[index];
  if (!state.interpolates || viewOf(state, recordNumber()) != View::shown) return false;
  const SceneInstance& instance = instances_.at(index);
  return frame_ - instance.updatedIn < instance.updatedInterval;
}

std::uint32_t SceneBooks::paletteUnit(const SceneInstance& instance) const {
  const auto form = static_cast<std::size_t>(paletteForm(instance.method));
  return poses_.at(instance.pose).forms[form].unit;
}

/// Converts a pose once for all instances that read it, and only if one does. If all of these are
/// culled on the GPU, it decides whether a figure is sampled and its pose converted: the CPU does
/// not know whether that happened, and lists both again in the next frame. Returns `paletteUnit`.
std::uint32_t SceneBooks::convertPalette(const SceneInstance& instance, bool isCulled) {
  const PaletteForm form = paletteForm(instance.method);
  ScenePose& pose = poses_.at(instance.pose);
  ScenePose::Form& converted = pose.forms[static_cast<std::size_t>(form)];
  if (converted.version == pose.version || converted.plannedIn == planNumber_)
    return converted.unit;
  converted.plannedIn = planNumber_;
  const bool isNeeded = !isCulled || pose.figure == notUsed;
  const bool isDriven = pose.rig != notUsed && pose.drivenVersion != pose.version;
  if (pose.figure != notUsed) {
    // On the CPU a job evaluates only the rigs that it needs, of a figure that it samples.
    SceneFigure& figure = figures_.at(pose.figure);
    if (owner_.isCpu && isDriven) figure.sampled = 0;
    sampleFigure(pose.figure, isNeeded);
    if (owner_.isCpu && isDriven) driveRig(instance.pose, figure.place);
  } else if (isDriven) {
    driveRig(instance.pose, notUsed);
  }
  conversions_.push_back({instance.pose, form, isNeeded});
  if (!pose.writtenByGpu) planned_.poseBytes += pose.slotJoints * sizeof(JointMatrix);
  PoseSource source{static_cast<std::uint32_t>(offsetOf(pose) / unitBytes), pose.buffer,
                    pose.writtenByGpu ? BufferRole::gpuPoses : BufferRole::poses};
  if (pose.rig != notUsed) {
    source.drivenBuffer = pose.drivenBuffer;
    source.drivenUnit = static_cast<std::uint32_t>(pose.driven.offset) * abi::UNITS_OF_MATRIX;
    source.writtenJoints = pose.writtenJoints;
  }
  converted.place =
      work_.addPose(source, converted.unit, pose.jointCount, form, pose.promise, isNeeded);
  return converted.unit;
}

void SceneBooks::addRuns(const SceneInstance& instance, std::uint32_t palette, std::uint32_t flags,
                         const Candidate* candidate) {
  const InstanceExtras* extras = instance.extras.isNeeded() ? &instance.extras : nullptr;
  const bool listsMorphs = extras != nullptr && extras->writtenMorphs + extras->drivenMorphs != 0 &&
                           (flags & abi::INSTANCE_SETTLES) == 0 && !owner_.isCpu;
  const auto add = [&](const PlacedRun& run) {
    Work::Instance& added = work_.add(run);
    added.pose = instance.pose;
    added.extras = extras;
    added.palette = palette;
    added.flags = flags;
    if (candidate != nullptr) work_.cull(*candidate);
    if (listsMorphs) listMorphs(instance);
  };
  add(instance.run);
  for (const PlacedRun& run : instance.furtherRuns) add(run);
}

void SceneBooks::gatherPoses() {
  for (std::size_t i = 0; i < posed_.size(); ++i) {
    if (i + prefetchDistance < posed_.size())
      poses_.prefetch(posed_[i + prefetchDistance].index, 2);
    const ScenePose* pose = poses_.find(posed_[i]);
    if (pose == nullptr) continue;
    std::uint32_t index = pose->firstInstance;
    if (pose->users == 1) {  // an instance that need not be read
      raise(index, Need::stale);
      continue;
    }
    for (; index != notUsed; index = instances_.at(index).nextOfPose) raise(index, Need::stale);
  }
  posed_.clear();
}

void SceneBooks::addDue(std::uint32_t index, SceneInstance& instance, bool restarts) {
  instance.plannedIn = planNumber_;
  due_.push_back({index, restarts});
  const std::uint32_t palette = convertPalette(instance, false);
  if (owner_.isCpu && instance.morphWriter == MorphWriter::clips) sampleMorphs(instance);
  addRuns(instance, palette, restarts && states_[index].hasMotion ? abi::INSTANCE_RESTARTS : 0u);
  if (instance.extras.result != notUsed) {
    work_.clearedResults.push_back(instance.extras.result);
    plannedResults_.push_back(instance.extras.result);
  }
  noteBox(index, instance, restarts ? BoxChange::rests : BoxChange::moves);
  planned_.skinnedVertices += instance.vertexCount;
  planned_.writtenBytes += std::uint64_t{instance.vertexCount} * instance.vertexBytes;
}

/// Instances that are not due stay in the list; those that are due stay until `commit`.
void SceneBooks::gatherPending() {
  std::size_t kept = 0;
  for (std::size_t entry = 0; entry < pending_.size(); ++entry) {
    const InstanceHandle handle = pending_[entry];
    if (entry + prefetchDistance < pending_.size())
      instances_.prefetch(pending_[entry + prefetchDistance].index, 2);
    if (entry + prefetchDistance / 2 < pending_.size())
      poses_.prefetch(instances_.at(pending_[entry + prefetchDistance / 2].index).pose, 2);
    InstanceState* const state = findState(handle);
    if (state == nullptr) continue;
    if (state->need == Need::none || !isDisplayed(state->view)) {
      state->isListed = false;
      continue;
    }
    SceneInstance& instance = instances_.at(handle.index);
    const Action action = actionOf(*state, instance.pose, state->need);
    if (action >= Action::skin) addDue(handle.index, instance, action == Action::restart);
    pending_[kept++] = handle;
  }
  pending_.resize(kept);
}

/// An instance that moved when it was last displayed, and is now displayed without being skinned,
/// is at rest: its previous positions become the current ones. Instances that leave the view are
/// not settled, since they are usually skinned when they return. Those that interpolate come to
/// rest an update interval later, or when they return.
void SceneBooks::gatherSettling() {
  for (const InstanceHandle handle : moving_) {
    SceneInstance* instance = instances_.find(handle);
    if (instance == nullptr || instance->plannedIn == planNumber_ ||
        !isDisplayed(states_[handle.index].view))
      continue;
    if (holds(handle.index)) {
      if (std::exchange(instance->heldIn, planNumber_) != planNumber_) held_.push_back(handle);
      continue;
    }
    instance->plannedIn = planNumber_;
    settling_.push_back(handle.index);
    noteBox(handle.index, *instance, BoxChange::rests);
    addRuns(*instance, paletteUnit(*instance), abi::INSTANCE_SETTLES);
  }
}

/// All culled instances, in every frame: the CPU does not know which ones the GPU skinned. It reads
/// the history back as long as it waits for one to be written.
void SceneBooks::gatherCulled() {
  historyCopy_ = {};
  for (const std::uint32_t index : culled_) {
    SceneInstance& instance = instances_.at(index);
    const InstanceState& state = states_[index];
    if (!isDisplayed(state.view)) continue;
    if (!instance.isWritten || instance.shown != instance.target)
      historyCopy_.size = slotCapacity_ * sizeof(abi::HistoryRecord);
    std::uint32_t version = instance.version;
    const Action action = actionOf(state, instance.pose, state.need);
    const bool isNew = version == 0 || action >= Action::skin;
    if (isNew) {
      nextVersion_ = std::max(nextVersion_ + 1, 1u);
      version = nextVersion_;
      versioned_.push_back({index, version});
    }
    // There is no box until the GPU skins it for the first time, and the CPU does not know when
    // that is.
    if (instance.extras.result != notUsed) {
      if (instance.firstFrame == 0) work_.clearedResults.push_back(instance.extras.result);
      plannedResults_.push_back(instance.extras.result);
    }
    const std::uint32_t palette = convertPalette(instance, true);
    Candidate candidate{index, version};
    const ScenePose& pose = poses_.at(instance.pose);
    const PaletteForm form = paletteForm(instance.method);
    const ScenePose::Form& converted = pose.forms[static_cast<std::size_t>(form)];
    if (pose.figure != notUsed && converted.plannedIn == planNumber_) {
      candidate.palette = converted.place;
      const SceneFigure& figure = figures_.at(pose.figure);
      if (figure.plannedIn == planNumber_) candidate.figure = figure.place;
    }
    // One that the GPU has yet to show in this version comes back, and restarts for that.
    const bool restarts = isNew && (state.need == Need::restart || action == Action::restart);
    const bool isHeld = !isNew && holds(index);
    if (isNew) {
      noteBox(index, instance, restarts ? BoxChange::rests : BoxChange::moves);
    } else {
      noteBox(index, instance, isHeld ? BoxChange::mayBeSkinned : BoxChange::rests);
    }
    addRuns(instance, palette, culledFlags(instance, state.hasMotion, restarts, isHeld),
            &candidate);
  }
}

void SceneBooks::gatherMoves() {
  for (const InstanceHandle handle : shifting_) {
    const SceneInstance* instance = instances_.find(handle);
    if (instance == nullptr || !instance->shown || instance->shown->mesh != instance->target.mesh ||
        instance->shown == instance->target)
      continue;
    const std::uint32_t output = outputStore_.buffer.now.number;
    moves_.push_back({output, output, instance->shown->bytes.offset, instance->target.bytes.offset,
                      instance->target.bytes.size});
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
        {resultStore_.buffer.now.number, noIndex, first * sizeof(InstanceResult),
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
  held_.clear();
  versioned_.clear();
  conversions_.clear();
  sampling_.clear();
  driving_.clear();
  moves_.clear();
  plannedResults_.clear();
  resultCopies_.clear();
  notedBoxes_.clear();
  planned_ = {};
  work_.begin(groups_);
  gatherPoses();
  gatherMoves();
  gatherPending();
  gatherSettling();
  gatherCulled();
  gatherFigures();
  gatherResults();
  work_.arrange();
  planned_.frame = frame_;
  planned_.instances = instances_.size();
  planned_.skinnedInstances = static_cast<std::uint32_t>(due_.size());
  planned_.settledInstances = static_cast<std::uint32_t>(settling_.size());
  planned_.sampledFigures = static_cast<std::uint32_t>(sampling_.size());
  planned_.convertedPoses = work_.poseCount;
  planned_.culledCandidates = static_cast<std::uint32_t>(work_.culled.size());
  isPlanned_ = true;
  return {};
}

void SceneBooks::listGrowth() {
  growth_.clear();
  for (const GrowingBuffer* buffer : keptBuffers()) {
    if (!buffer->before.exists()) continue;
    growth_.push_back({buffer->before.number, buffer->now.number, 0, 0, buffer->before.size});
  }
}

void SceneBooks::listUploads() {
  uploads_.clear();
  for (const MeshUpload& upload : meshUploads_) {
    const Range& bytes = meshes_.at(upload.mesh.index).bytes;
    uploads_.push_back(
        {{meshStore_.buffer.now.number, bytes.offset, bytes.size}, upload.bytes.bytes()});
  }
  for (const ClipsHandle handle : clipUploads_) {
    const SceneClips* clips = clips_.find(handle);
    if (clips == nullptr) continue;
    const std::span<const std::byte> bank = clips->content->bank.bytes();
    const auto words = std::as_bytes(std::span(clips->content->device.words));
    const std::uint32_t meshes = meshStore_.buffer.now.number;
    uploads_.push_back({{meshes, clips->bytes.offset, bank.size()}, bank});
    if (!words.empty()) uploads_.push_back({{meshes, clips->deviceOffset(), words.size()}, words});
  }
  for (const RigHandle handle : rigUploads_) {
    const SceneRig* rig = rigs_.find(handle);
    if (rig == nullptr) continue;
    uploads_.push_back({{meshStore_.buffer.now.number, rig->bytes.offset, rig->rig->bytes().size()},
                        rig->rig->bytes()});
  }
  for (const PoseHandle handle : poseUploads_) {
    ScenePose* pose = poses_.find(handle);
    // It may be listed twice: as new, written, or abandoned.
    if (pose == nullptr || pose->uploadedBy == planNumber_) continue;
    pose->uploadedBy = planNumber_;
    const std::span<const std::byte> bytes = std::as_bytes(matricesOf(*pose));
    uploads_.push_back(
        {{poseBuffers_[pose->buffer].buffer.number, offsetOf(*pose), bytes.size()}, bytes});
  }
}

Result<void> SceneBooks::plan(Plan& out, std::span<std::byte> tables) {
  if (Result<void> gathered = gather(); !gathered) return gathered;
  isPlanned_ = false;
  PlanData& data = PlanData::of(out);
  const auto record = static_cast<std::uint32_t>(record_ + 1);
  Result<void> good = encoder_.encode(work_, limits_, tuning_, sizes(), data, record, tables);
  if (good) good = makeFrameBuffers(data);
  if (!good) {
    data.clear();
    return good;
  }
  for (CopyCommand& copy : resultCopies_) copy.to = nextReadBack().buffer.number;
  if (historyCopy_.size != 0) {
    historyCopy_.from = history_.now.number;
    historyCopy_.fromOffset = historyRecords;
    historyCopy_.to = nextReadBack().buffer.number;
    historyCopy_.toOffset = readBackResults + sizes().results * sizeof(InstanceResult);
  }
  listGrowth();
  listUploads();
  const FrameWork frame{clearHistory_, growth_, uploads_, moves_, resultCopies_, historyCopy_};
  if (!encoder_.listsNothing(frame)) {
    nameBuffers();
    encoder_.listFrame(buffers_, frame);
  }
  isPlanned_ = true;
  return {};
}

/// Whether `target` has now been recorded, and so is shown.
bool SceneBooks::commitShift(SceneInstance& instance, InstanceHandle handle) {
  const bool isMove = instance.shown && instance.shown->mesh == instance.target.mesh;
  const bool isCulled = states_[handle.index].isCulled;
  if (!isMove && !isCulled && instance.plannedIn != planNumber_) return false;
  if (instance.shown && instance.shown != instance.target)
    retire(outputStore_.ranges, instance.shown->bytes);
  if (isCulled && !isMove) {
    const bool isVersioned = states_[handle.index].need == Need::none;
    instance.isWritten = false;
    instance.firstVersion = isVersioned ? instance.version : nextVersion_ + 1;
  }
  instance.shown = instance.target;
  instance.isShifting = false;
  return true;
}

/// Marks the instance as up to date.
void SceneBooks::commitInstance(std::uint32_t index) {
  InstanceState& state = states_[index];
  SceneInstance& instance = instances_.at(index);
  state.need = Need::none;
  if (!state.isCulled) instance.isWritten = true;
  if (instance.firstFrame == 0) instance.firstFrame = frame_;
  if (!state.interpolates) return;
  instance.updatedIn = frame_;
  instance.updatedInterval = state.updateInterval;
}

Result<void> SceneBooks::commit() {
  if (!isPlanned_) return invalid("there is no plan to commit, or the scene has changed since");
  isPlanned_ = false;
  mayAbandon_ = true;
  ++record_;
  earlierFrame_ = std::exchange(recordedFrame_, frame_);
  hasBegun_ = false;
  committed_ = planned_;
  const bool culls = planned_.culledCandidates != 0;
  if (culls) clearHistory_ = static_cast<std::uint32_t>(slotCapacity_);
  ReadBack& readBack = readBackOf(record_);
  readBack.frame = frame_;
  readBack.hasCounters = culls;
  readBack.results.swap(resultCopies_);
  readBack.boxes.swap(notedBoxes_);
  readBack.history = historyCopy_;
  for (GrowingBuffer* buffer : keptBuffers())
    buffer->copied = std::exchange(buffer->before, SceneBufferMemory());
  output_ = outputStore_.buffer.now.number;
  uploadedMeshes_.swap(meshUploads_);
  meshUploads_.clear();
  uploadedPoses_.swap(poseUploads_);
  poseUploads_.clear();
  uploadedClips_.swap(clipUploads_);
  clipUploads_.clear();
  uploadedRigs_.swap(rigUploads_);
  rigUploads_.clear();
  skinned_.clear();
  settled_.clear();
  moving_.swap(held_);
  for (std::size_t i = 0; i < conversions_.size(); ++i) {
    if (i + prefetchDistance < conversions_.size())
      poses_.prefetch(conversions_[i + prefetchDistance].pose, 2);
    const Conversion& conversion = conversions_[i];
    if (!conversion.isNeeded) continue;
    ScenePose& pose = poses_.at(conversion.pose);
    pose.forms[static_cast<std::size_t>(conversion.form)].version = pose.version;
  }
  for (const std::uint32_t index : sampling_) {
    SceneFigure& figure = figures_.at(index);
    if (figure.isNeeded) figure.sampled = figure.version;
  }
  for (const std::uint32_t index : driving_) {
    ScenePose& pose = poses_.at(index);
    pose.drivenVersion = pose.version;
  }
  for (std::size_t i = 0; i < due_.size(); ++i) {
    if (i + prefetchDistance < due_.size())
      instances_.prefetch(due_[i + prefetchDistance].index, 1);
    const auto& [index, restarts] = due_[i];
    InstanceState& state = states_[index];
    const InstanceHandle handle{index, state.generation};
    const bool moves = state.hasMotion && !restarts;
    commitInstance(index);
    state.isListed = false;
    state.isMoving = moves;
    if (moves) moving_.push_back(handle);
    skinned_.push_back(handle);
  }
  std::erase_if(pending_,
                [this](InstanceHandle handle) { return states_[handle.index].need == Need::none; });
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

/// Nothing that the frame wrote exists, and what frames before it wrote is not looked for:
/// everything is made again.
Result<void> Scene::abandonFrame(std::uint64_t frame) {
  SceneBooks& books = *books_;
  if (!books.mayAbandon_ || frame != books.frame_) {
    return invalid("frame " + std::to_string(frame) +
                   " cannot be abandoned: it is not the frame that was executed last, or another "
                   "has begun since");
  }
  books.abandon();
  return {};
}

void SceneBooks::abandon() {
  isPlanned_ = mayAbandon_ = false;
  readBackOf(record_).frame = 0;
  --record_;
  recordedFrame_ = earlierFrame_;
  hasBegun_ = true;
  moving_.clear();
  for (std::uint32_t index = 0; index < states_.size(); ++index) {
    InstanceState& state = states_[index];
    if (state.generation == 0) continue;
    state.isMoving = false;
    state.view = isDisplayed(state.view) ? View::shown : View::hidden;
    SceneInstance& instance = instances_.at(index);
    instance.firstFrame = 0;
    instance.version = 0;
    instance.isWritten = false;
    instance.firstVersion = nextVersion_ + 1;
    raise(index, Need::restart);
  }
  for (std::uint32_t index = 0; index < poses_.capacity(); ++index) {
    for (ScenePose::Form& form : poses_.at(index).forms) form.version = 0;
    poses_.at(index).drivenVersion = 0;
  }
  for (std::uint32_t index = 0; index < figures_.capacity(); ++index)
    figures_.at(index).sampled = 0;
  clearHistory_ = 0;
  for (GrowingBuffer* buffer : keptBuffers()) {
    if (!buffer->copied.exists()) continue;
    // It was to get the contents, and has been replaced in its turn.
    if (buffer->before.exists()) owner_.releaseBuffer(owner_.user, buffer->before.number);
    buffer->before = std::exchange(buffer->copied, SceneBufferMemory());
  }
  if (outputStore_.buffer.before.exists()) output_ = outputStore_.buffer.before.number;
  std::erase_if(uploadedMeshes_,
                [this](const MeshUpload& upload) { return meshes_.find(upload.mesh) == nullptr; });
  std::ranges::move(uploadedMeshes_, std::back_inserter(meshUploads_));
  uploadedMeshes_.clear();
  poseUploads_.insert(poseUploads_.end(), uploadedPoses_.begin(), uploadedPoses_.end());
  uploadedPoses_.clear();
  clipUploads_.insert(clipUploads_.end(), uploadedClips_.begin(), uploadedClips_.end());
  uploadedClips_.clear();
  rigUploads_.insert(rigUploads_.end(), uploadedRigs_.begin(), uploadedRigs_.end());
  uploadedRigs_.clear();
  skinned_.clear();
  settled_.clear();
  committed_ = {};
  if (owner_.frameAbandoned != nullptr) owner_.frameAbandoned(owner_.user);
}

Result<void> Scene::beginFrame(std::uint64_t frame, std::uint64_t completedFrame) {
  SceneBooks& books = changed();
  if (books.owner_.isCpu && frame != 0) completedFrame = frame - 1;
  if (frame <= books.frame_ || completedFrame < books.completed_ || completedFrame >= frame) {
    return Error{ErrorCode::invalidArgument,
                 "beginFrame(" + std::to_string(frame) + ", " + std::to_string(completedFrame) +
                     "): the frame must be larger than " + std::to_string(books.frame_) +
                     ", and the completed frame at least " + std::to_string(books.completed_) +
                     " and less than the frame"};
  }
  if (std::ranges::all_of(books.readBacks_, [&](const SceneBooks::ReadBack& recorded) {
        return recorded.frame > completedFrame;
      })) {
    return Error{ErrorCode::invalidArgument,
                 "frame " + std::to_string(frame) + " begins while the GPU has completed frame " +
                     std::to_string(completedFrame) +
                     ": more frames are in flight than framesInFlight, which is " +
                     std::to_string(books.description_.framesInFlight) +
                     "; if one of them was recorded and not submitted, call abandonFrame"};
  }
  books.begin(frame, completedFrame);
  return {};
}

void SceneBooks::begin(std::uint64_t frame, std::uint64_t completedFrame) {
  // The last frame can no longer be abandoned.
  mayAbandon_ = false;
  uploadedMeshes_.clear();
  uploadedPoses_.clear();
  uploadedClips_.clear();
  uploadedRigs_.clear();
  for (GrowingBuffer* buffer : keptBuffers())
    retire(std::exchange(buffer->copied, SceneBufferMemory()));
  frame_ = frame;
  completed_ = completedFrame;
  hasBegun_ = true;
  if (owner_.frameBegun != nullptr) owner_.frameBegun(owner_.user, completedFrame);
  readBackComplete();
  freeRetired();
}

/// Reads the results of complete frames, the oldest first, where they are mapped.
void SceneBooks::readBackComplete() {
  const auto next = [this] {
    const ReadBack* oldest = nullptr;
    for (const ReadBack& recorded : readBacks_) {
      const bool isNew = recorded.frame > culling_.frame && recorded.frame <= completed_;
      if (isNew && (oldest == nullptr || recorded.frame < oldest->frame)) oldest = &recorded;
    }
    return oldest;
  };
  while (const ReadBack* recorded = next()) {
    const bool copied = recorded->hasCounters || !recorded->results.empty();
    if (copied && recorded->buffer.mapped == nullptr) return;
    const std::span<const std::byte> bytes(
        recorded->buffer.mapped,
        recorded->buffer.mapped != nullptr ? static_cast<std::size_t>(recorded->buffer.size) : 0);
    if (!readBack(recorded->frame, bytes)) return;
  }
}

Result<void> SceneBooks::readBack(std::uint64_t frame, std::span<const std::byte> bytes) {
  const auto found = std::ranges::find(readBacks_, frame, &ReadBack::frame);
  if (found == readBacks_.end() || frame == 0) {
    return invalid("frame " + std::to_string(frame) +
                   " cannot be read back: it is not one of the last " +
                   std::to_string(readBacks_.size()) + " frames that were committed");
  }
  const bool copied = found->hasCounters || !found->results.empty();
  if (!copied && frame <= culling_.frame) return {};  // `beginFrame` has done it
  if (frame > completed_ || frame <= culling_.frame) {
    return invalid("frame " + std::to_string(frame) +
                   " cannot be read back: it must be complete, which frames up to " +
                   std::to_string(completed_) + " are, and newer than the last that was, " +
                   std::to_string(culling_.frame));
  }
  std::uint64_t needed = found->hasCounters ? readBackResults : 0;
  const CopyCommand& history = found->history;
  if (history.size != 0) needed = history.toOffset + history.size;
  for (const CopyCommand& copy : found->results)
    needed = std::max(needed, copy.toOffset + copy.size);
  if (bytes.size() < needed) {
    return invalid("the read-back buffer of a frame has " + std::to_string(bytes.size()) +
                   " bytes, fewer than the " + std::to_string(needed) + " that the frame copied");
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
  replacedResults_.clear();
  for (const NotedBox& box : found->boxes) {
    const bool isKnown =
        box.result < resultFrames_.size() && resultFrames_[box.result] >= box.firstFrame;
    replacedResults_.push_back(isKnown ? latestResults_[box.result] : InstanceResult());
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
  readEarlierBoxes(found->boxes);
  readHistory(bytes.subspan(static_cast<std::size_t>(history.toOffset),
                            static_cast<std::size_t>(history.size)));
  return {};
}

/// Tells where previous positions are, once the results of the frame are in `latestResults_`.
void SceneBooks::readEarlierBoxes(std::span<const NotedBox> boxes) {
  earlierResults_.resize(latestResults_.size());
  for (std::size_t index = 0; index < boxes.size(); ++index) {
    const auto [number, change, firstFrame] = boxes[index];
    if (number >= latestResults_.size()) continue;  // no frame that was read back has skinned it
    const InstanceResult& latest = latestResults_[number];
    const InstanceResult& replaced = replacedResults_[index];
    const bool stays =
        change == BoxChange::mayBeSkinned && std::memcmp(&latest, &replaced, sizeof(latest)) == 0;
    if (!stays) earlierResults_[number] = change == BoxChange::moves ? replaced : latest;
  }
}

/// Tells which instances that are culled on the GPU have been skinned where they are shown.
/// Versions only grow, modulo 2³², and a record that is clear has 0.
void SceneBooks::readHistory(std::span<const std::byte> records) {
  for (const std::uint32_t index : culled_) {
    SceneInstance& instance = instances_.at(index);
    const std::size_t place = index * sizeof(abi::HistoryRecord);
    if (instance.isWritten || !instance.shown || place >= records.size()) continue;
    abi::HistoryRecord record;
    std::memcpy(&record, records.data() + place, sizeof(record));
    // From `firstVersion` to the newest, if there is one yet.
    instance.isWritten = record.version != 0 && record.version - instance.firstVersion <
                                                    nextVersion_ + 1 - instance.firstVersion;
  }
}

Result<std::optional<Box>> Scene::bounds(InstanceHandle handle) const {
  const SceneBooks& books = *books_;
  const SceneInstance* instance = books.instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  if (!instance->bounds || instance->firstFrame == 0) return std::optional<Box>();
  // Not read back since the instance was first skinned: what is there is of another instance.
  const std::uint32_t result = instance->extras.result;
  if (result >= books.resultFrames_.size() || books.resultFrames_[result] < instance->firstFrame)
    return std::optional<Box>();
  InstanceResult both = books.latestResults_[result];
  if (books.states_[handle.index].interpolates) {
    const InstanceResult& earlier = books.earlierResults_[result];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      both.orderedMin[axis] = std::min(both.orderedMin[axis], earlier.orderedMin[axis]);
      both.orderedMax[axis] = std::max(both.orderedMax[axis], earlier.orderedMax[axis]);
    }
  }
  return both.box();
}

}  // namespace dermis
