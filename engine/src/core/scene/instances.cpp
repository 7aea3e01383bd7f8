// Instances: how they are added, placed, changed and removed.

#include <algorithm>
#include <limits>
#include <string>

#include "plan/check.h"
#include "scene/books.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

constexpr Subject theInstance{"the instance"};

/// Of one vertex, without gaps.
std::uint32_t attributeBytes(const VertexLayout& layout) {
  const std::uint32_t positions = layout.motion ? 2 : 1;
  return positions * formatSize(layout.positions) + formatSize(layout.normals) +
         formatSize(layout.tangents);
}

/// Of one of many changes.
Error numbered(Error error, std::ptrdiff_t number) {
  error.message = "change " + std::to_string(number) + ": " + error.message;
  return error;
}

/// The job that skins an instance, but for what changes from frame to frame.
Job jobOf(const SceneInstance& instance, const SceneMesh& mesh, const VertexPlaces& places) {
  Job job;
  job.mesh = mesh.info;
  job.meshOffset = mesh.bytes.offset;
  job.method = instance.method;
  job.places = places;
  job.box = instance.extras.box;
  job.bounds = instance.bounds;
  job.morphs = instance.extras.morphs;
  // Nobody knows how many are active.
  static constexpr MorphWeight one{0, 1};
  if (instance.morphWriter != MorphWriter::cpu || instance.drivenTargets != 0)
    job.morphs = {&one, 1};
  return job;
}

/// Targets whose weights no rig drives.
std::uint32_t writtenTargets(const SceneInstance& instance, const SceneMesh& mesh) {
  return mesh.info.morphTargetCount - std::min(instance.drivenTargets, mesh.info.morphTargetCount);
}

}  // namespace

/// `targets`: of the mesh.
Result<void> SceneBooks::checkDrivenTargets(const SceneInstance& instance, const ScenePose& pose,
                                            std::uint32_t targets) const {
  const std::uint64_t count = instance.drivenTargets;
  if (count > targets) {
    return invalid("the instance has " + std::to_string(count) +
                   " driven targets, but its mesh has " + std::to_string(targets) + " targets");
  }
  if (count == 0 || pose.rig == notUsed) return {};
  const PackedRig& rig = *rigs_.at(pose.rig).rig;
  const std::uint64_t weights = std::uint64_t{rig.givenWeights()} + rig.drivenWeights();
  if (instance.extras.firstDrivenWeight + count <= weights) return {};
  return invalid("the instance has " + std::to_string(count) + " driven targets from weight " +
                 std::to_string(instance.extras.firstDrivenWeight) + " on, but its rig has " +
                 std::to_string(weights) + " weights");
}

Result<void> SceneBooks::checkMorphWriter(const SceneInstance& instance, const ScenePose& pose,
                                          std::uint32_t targets) const {
  const MorphWriter writer = instance.morphWriter;
  if (writer > MorphWriter::clips)
    return notAValue("the instance: its morphWriter", writer, "MorphWriter");
  if (writer == MorphWriter::cpu) return {};
  if (writer == MorphWriter::gpu && owner_.isCpu)
    return invalid("the GPU cannot write the instance's morph weights: the CPU skins it");
  if (targets == 0)
    return invalid("only the CPU can write the instance's morph weights: its mesh has no targets");
  std::uint32_t weights = instance.extras.writtenMorphs;
  if (writer == MorphWriter::clips) {
    if (pose.figure == notUsed) return {};
    const SceneClips& clips = clips_.at(figures_.at(pose.figure).clips.index);
    weights = clips.content->bank.weightCount(instance.weightsOf);
  } else if (weights == 0) {
    return {};  // it is new
  }
  if (weights == targets) return {};
  return invalid("the instance has " + std::to_string(weights) +
                 " morph weights, which the CPU does not write, but its mesh has " +
                 std::to_string(targets) + " targets");
}

/// Checks everything except room in the buffers.
Result<void> SceneBooks::check(const SceneInstance& instance, std::uint32_t updateInterval) const {
  const SceneMesh* mesh = meshes_.find(instance.mesh);
  if (mesh == nullptr) return unknownHandle("mesh", instance.mesh);
  const ScenePose* pose = poses_.find(instance.poseHandle);
  if (pose == nullptr) return unknownHandle("pose", instance.poseHandle);
  if (updateInterval == 0)
    return invalid("the instance's update interval must be at least 1 frame, not 0");
  if (owner_.isCpu && isForComparison(instance.method)) {
    return invalid("the instance: " + std::string(methodName(instance.method)) +
                   " is a method for comparison, which the CPU path does not support");
  }
  const Result<VertexPlaces> laidOut = placeVertices(instance.layout, mesh->info.vertexCount);
  if (!laidOut) return laidOut.error();
  const std::uint64_t most = description_.outputCapacity.maximum;
  if (laidOut->size > most) {
    return Error{ErrorCode::limitExceeded, "the instance takes " + std::to_string(laidOut->size) +
                                               " bytes of output; the maximum is " +
                                               std::to_string(most)};
  }
  if (pose->jointCount < mesh->info.requiredJoints) {
    return invalid("the instance's mesh needs a pose of " +
                   std::to_string(mesh->info.requiredJoints) + " joints, but pose " +
                   std::to_string(instance.poseHandle.index) + " has " +
                   std::to_string(pose->jointCount));
  }
  if (Result<void> good = checkDrivenTargets(instance, *pose, mesh->info.morphTargetCount); !good)
    return good;
  if (Result<void> good = checkMorphWriter(instance, *pose, writtenTargets(instance, *mesh)); !good)
    return good;
  const PoseDescription own{pose->jointCount, 0, pose->promise};
  Batch batch;
  batch.poses = {&own, 1};
  batch.meshesSize = meshStore_.ranges.capacity();
  batch.outputSizes.fill(std::max(outputStore_.ranges.capacity(), laidOut->size));
  const Job job = jobOf(instance, *mesh, *laidOut);
  const OutputStreams streams = outputStreams(job);
  if (Result<void> good = checkJob(batch, job, streams, theInstance, limits_); !good) return good;
  return checkRuns(job, streams, theInstance);
}

/// Where the GPU writes morph weights: in a buffer of poses that it writes, which stays where it
/// is.
Result<void> SceneBooks::takeWeights(SceneInstance& instance) {
  if (instance.morphWriter == MorphWriter::cpu || owner_.isCpu) return {};
  instance.extras.writtenMorphs =
      meshes_.at(instance.mesh.index).info.morphTargetCount - instance.drivenTargets;
  if (instance.morphWriter == MorphWriter::clips) return {};
  const std::uint32_t joints = jointsFor(instance.extras.writtenMorphs);
  const Result<std::optional<Range>> taken = takeJoints(joints, true, instance.weightsBuffer);
  if (!taken) return taken.error();
  if (!*taken) return noJoints(1, joints, true);
  instance.weights = **taken;
  return {};
}

Result<BufferPart> SceneBooks::weightsPart(InstanceHandle handle) const {
  const SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  if (instance->morphWriter != MorphWriter::gpu)
    return invalid("no GPU pass writes the morph weights of instance " +
                   std::to_string(handle.index));
  return BufferPart{poseBuffers_[instance->weightsBuffer].buffer.number,
                    instance->weights.offset * sizeof(JointMatrix),
                    instance->extras.writtenMorphs * sizeof(float)};
}

Result<void> Scene::markMorphsWritten(std::span<const InstanceHandle> instances) {
  SceneBooks& books = changed();
  if (Result<void> good = books.mayWrite(); !good) return good;
  for (const InstanceHandle handle : instances) {
    if (const Result<BufferPart> part = books.weightsPart(handle); !part) return part.error();
    books.raise(handle.index, Need::stale);
  }
  return {};
}

Result<void> SceneBooks::takeResult(SceneInstance& instance) {
  if (!instance.bounds && !isSnormPosition(instance.layout.positions)) return {};
  const Result<std::optional<Range>> result = take(resultStore_, 1, 1);
  if (!result) return result.error();
  if (!*result) {
    return Error{ErrorCode::limitExceeded,
                 "the instance has bounds or snorm16 positions, but " +
                     std::to_string(resultStore_.ranges.capacity()) +
                     " instances have them already: the maximum of boundsCapacity"};
  }
  instance.extras.result = static_cast<std::uint32_t>((*result)->offset);
  return {};
}

void SceneBooks::freeResult(const SceneInstance& instance) {
  if (instance.extras.result != notUsed) resultStore_.ranges.free({instance.extras.result, 1});
}

/// Reserves palette units for the pose in the form that the method reads, until the pose is
/// removed.
Result<void> SceneBooks::reserveUnits(const SceneInstance& instance) {
  const PaletteForm form = paletteForm(instance.method);
  ScenePose& pose = poses_.at(instance.poseHandle.index);
  std::uint32_t& unit = pose.forms[static_cast<std::size_t>(form)].unit;
  if (unit != notUsed) return {};
  const std::uint64_t size = paletteSize(form, pose.jointCount, pose.promise);
  const Result<std::optional<Range>> taken = take(unitStore_, size, 1);
  if (!taken) return taken.error();
  if (*taken) {
    unit = static_cast<std::uint32_t>((*taken)->offset);
    return {};
  }
  return noRoom("pose " + std::to_string(instance.poseHandle.index) + " needs " +
                    std::to_string(size) + " units of 16 bytes of palettes for " +
                    std::string(methodName(instance.method)),
                unitStore_, "units");
}

/// Fails with `limitExceeded` if the output has no room; the instance is then as it was.
Result<void> SceneBooks::findRoom(SceneInstance& instance, bool isCulled) {
  const SceneMesh& mesh = meshes_.at(instance.mesh.index);
  const Result<VertexPlaces> laidOut = placeVertices(instance.layout, mesh.info.vertexCount);
  if (!laidOut) return laidOut.error();
  const Result<std::optional<Range>> bytes = take(outputStore_, laidOut->size, laidOut->alignment);
  if (!bytes) return bytes.error();
  if (!*bytes) {
    return noRoom("the instance takes " + std::to_string(laidOut->size) + " bytes", outputStore_,
                  "bytes of output");
  }
  instance.target = {**bytes, instance.mesh, mesh.info.vertexCount};
  instance.vertexCount = mesh.info.vertexCount;
  Result<void> made = makeRuns(instance, isCulled);
  if (!made) outputStore_.ranges.free(**bytes);
  return made;
}

/// Leaves the runs it had to the caller. If it fails, the instance is as it was.
Result<void> SceneBooks::makeRuns(SceneInstance& instance, bool isCulled) {
  const SceneMesh& mesh = meshes_.at(instance.mesh.index);
  const ScenePose& pose = poses_.at(instance.poseHandle.index);
  Result<VertexPlaces> laidOut = placeVertices(instance.layout, mesh.info.vertexCount,
                                               outputStore_.base + instance.target.bytes.offset);
  if (!laidOut) return laidOut.error();
  // Kernels count from the beginning of the output.
  for (OutputAttribute& attribute : laidOut->attributes) {
    if (attribute.format != VertexFormat::none) attribute.offset -= outputStore_.base;
  }
  Placing placing;
  placing.subject = theInstance;
  placing.windows = {ByStream<std::uint64_t>::all(outputStore_.ranges.capacity()), limits_};
  placing.jointCount = pose.jointCount;
  placing.mayScale = pose.promise == JointPromise::scaling;
  placing.isCulled = isCulled;
  runsScratch_.clear();
  const Job job = jobOf(instance, mesh, *laidOut);
  if (Result<void> placed =
          groups_.place(job, outputStreams(job), placing, limits_, tuning_, runsScratch_);
      !placed)
    return placed;
  instance.run = runsScratch_.front();
  instance.furtherRuns.assign(runsScratch_.begin() + 1, runsScratch_.end());
  return {};
}

/// Other runs for an instance that has some. If it fails, the instance is as it was.
Result<void> SceneBooks::remakeRuns(SceneInstance& instance, bool isCulled) {
  const PlacedRun first = instance.run;
  const std::vector<PlacedRun> further = instance.furtherRuns;
  if (Result<void> made = makeRuns(instance, isCulled); !made) return made;
  groups_.release(first.group);
  for (const PlacedRun& run : further) groups_.release(run.group);
  return {};
}

void SceneBooks::releaseRuns(SceneInstance& instance) {
  groups_.release(instance.run.group);
  for (const PlacedRun& run : instance.furtherRuns) groups_.release(run.group);
  instance.furtherRuns.clear();
}

/// An output that was recorded is still drawn, and stays `shown`. One that was never recorded is
/// free at once.
void SceneBooks::releaseTarget(SceneInstance& instance) {
  releaseRuns(instance);
  if (instance.shown != instance.target) outputStore_.ranges.free(instance.target.bytes);
}

void SceneBooks::link(std::uint32_t index) {
  SceneInstance& instance = instances_.at(index);
  ScenePose& pose = poses_.at(instance.pose);
  instance.previousOfPose = notUsed;
  instance.nextOfPose = pose.firstInstance;
  if (pose.firstInstance != notUsed) instances_.at(pose.firstInstance).previousOfPose = index;
  pose.firstInstance = index;
  ++pose.users;
}

void SceneBooks::unlink(std::uint32_t index) {
  const SceneInstance& instance = instances_.at(index);
  ScenePose& pose = poses_.at(instance.pose);
  if (instance.previousOfPose != notUsed) {
    instances_.at(instance.previousOfPose).nextOfPose = instance.nextOfPose;
  } else {
    pose.firstInstance = instance.nextOfPose;
  }
  if (instance.nextOfPose != notUsed)
    instances_.at(instance.nextOfPose).previousOfPose = instance.previousOfPose;
  --pose.users;
}

Result<InstanceHandle> Scene::addInstance(const InstanceDescription& description) {
  SceneBooks& books = changed();
  SceneInstance instance;
  instance.pose = description.pose.index;
  instance.method = description.method;
  const bool isCulled = description.culledOnGpu;
  if (books.owner_.isCpu && isCulled)
    return invalid("an instance that is culled on the GPU cannot be skinned on the CPU");
  if (description.interpolates && !description.layout.motion)
    return invalid("the instance interpolates, but its layout has no previous positions (motion)");
  instance.mesh = description.mesh;
  instance.poseHandle = description.pose;
  instance.layout = description.layout;
  instance.vertexBytes = attributeBytes(description.layout);
  instance.extras.box = description.box;
  instance.bounds = description.bounds;
  instance.morphWriter = description.morphWriter;
  instance.weightsOf = description.weightsOf;
  instance.drivenTargets = description.drivenTargets;
  instance.extras.drivenMorphs = description.drivenTargets;
  instance.extras.firstDrivenWeight = description.firstDrivenWeight;
  if (Result<void> good = books.check(instance, description.updateInterval); !good)
    return good.error();
  if (!books.hasSlot()) {
    return Error{ErrorCode::limitExceeded, "there are " + std::to_string(books.slotCapacity_) +
                                               " instances already: the maximum of "
                                               "instanceCapacity"};
  }
  instance.extras.hasBox = isSnormPosition(instance.layout.positions);
  if (Result<void> taken = books.takeResult(instance); !taken) return taken.error();
  if (Result<void> found = books.findRoom(instance, isCulled); !found) {
    books.freeResult(instance);
    return found.error();
  }
  if (Result<void> taken = books.takeWeights(instance); !taken) {
    books.freeResult(instance);
    books.releaseTarget(instance);
    return taken.error();
  }
  // The last, since units stay reserved.
  if (Result<void> reserved = books.reserveUnits(instance); !reserved) {
    books.freeResult(instance);
    books.releaseTarget(instance);
    if (instance.weights.size != 0)
      books.poseBuffers_[instance.weightsBuffer].joints.free(instance.weights);
    return reserved.error();
  }

  books.makeSlot();
  ++books.meshes_.at(instance.mesh.index).users;
  const InstanceHandle handle = books.instances_.add(std::move(instance));
  if (handle.index >= books.states_.size()) books.states_.resize(handle.index + std::size_t{1});
  InstanceState& state = books.states_[handle.index];
  state = {};
  state.generation = handle.generation;
  state.updateInterval = description.updateInterval;
  state.isCulled = isCulled;
  state.hasMotion = description.layout.motion;
  state.interpolates = description.interpolates;
  books.link(handle.index);
  if (isCulled) {
    books.instances_.at(handle.index).culledIndex =
        static_cast<std::uint32_t>(books.culled_.size());
    books.culled_.push_back(handle.index);
  }
  books.shift(handle);
  books.raise(handle.index, Need::restart);
  return handle;
}

Result<void> Scene::removeInstance(InstanceHandle handle) {
  SceneBooks& books = changed();
  SceneInstance* instance = books.instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  books.unlink(handle.index);
  --books.meshes_.at(instance->mesh.index).users;
  books.releaseTarget(*instance);
  if (instance->shown) books.retire(books.outputStore_.ranges, instance->shown->bytes);
  books.freeResult(*instance);
  if (instance->weights.size != 0)
    books.retire(books.poseBuffers_[instance->weightsBuffer].joints, instance->weights);
  if (books.states_[handle.index].isCulled) {
    books.culled_[instance->culledIndex] = books.culled_.back();
    books.instances_.at(books.culled_.back()).culledIndex = instance->culledIndex;
    books.culled_.pop_back();
  }
  books.states_[handle.index] = {};
  books.instances_.remove(handle);
  return {};
}

/// `target` has become another than `shown`; the next plan that skins or moves it makes up for it.
void SceneBooks::shift(InstanceHandle handle) {
  SceneInstance& instance = instances_.at(handle.index);
  if (instance.isShifting) return;
  instance.isShifting = true;
  shifting_.push_back(handle);
}

/// Room for an instance that gets another mesh: if it is still shown with that mesh, it stays.
Result<void> SceneBooks::takeBackOrFindRoom(SceneInstance& changed, bool isCulled) {
  if (!changed.shown || changed.shown->mesh != changed.mesh) return findRoom(changed, isCulled);
  changed.target = *changed.shown;
  changed.vertexCount = changed.shown->vertexCount;
  return makeRuns(changed, isCulled);
}

/// Gives an instance another mesh, pose or method, and sets its box and morph weights with it. The
/// result is checked like a new instance.
Result<void> SceneBooks::rebuild(SceneInstance& instance, const InstanceChange& change) {
  const InstanceHandle handle = change.instance;
  const bool hasNewMesh = change.mesh && *change.mesh != instance.mesh;
  SceneInstance changed = instance;
  if (change.mesh) changed.mesh = *change.mesh;
  if (change.pose) {
    changed.poseHandle = *change.pose;
    changed.pose = change.pose->index;
  }
  if (change.method) changed.method = *change.method;
  if (change.box) changed.extras.box = *change.box;
  changed.furtherRuns.clear();
  const SceneMesh* mesh = meshes_.find(changed.mesh);
  if (mesh != nullptr &&
      mesh->info.morphTargetCount != meshes_.at(instance.mesh.index).info.morphTargetCount)
    changed.extras.morphs.clear();
  const std::uint32_t targets = meshes_.at(instance.mesh.index).info.morphTargetCount;
  if (mesh != nullptr && mesh->info.morphTargetCount != targets &&
      changed.morphWriter != MorphWriter::cpu) {
    return invalid("the instance has " + std::to_string(targets) +
                   " morph weights, which the CPU does not write, but its mesh has " +
                   std::to_string(mesh->info.morphTargetCount) + " targets");
  }
  if (mesh != nullptr && changed.morphWriter == MorphWriter::clips &&
      changed.extras.writtenMorphs != 0)
    changed.extras.writtenMorphs = writtenTargets(changed, *mesh);
  if (mesh != nullptr && change.morphs) {
    if (Result<void> good =
            checkMorphs(*change.morphs, writtenTargets(changed, *mesh), {"instance", handle.index});
        !good)
      return good;
    assignActive(*change.morphs, changed.extras.morphs);
  }
  InstanceState& state = states_[handle.index];
  if (Result<void> good = check(changed, state.updateInterval); !good) return good;
  if (Result<void> room = hasNewMesh ? takeBackOrFindRoom(changed, state.isCulled)
                                     : makeRuns(changed, state.isCulled);
      !room)
    return room;
  const auto release = [&](SceneInstance& superseded) {
    if (hasNewMesh) {
      releaseTarget(superseded);
    } else {
      releaseRuns(superseded);
    }
  };
  if (Result<void> reserved = reserveUnits(changed); !reserved) {
    release(changed);
    return reserved;
  }

  --meshes_.at(instance.mesh.index).users;
  ++meshes_.at(changed.mesh.index).users;
  unlink(handle.index);
  release(instance);
  const bool hasNewBox = change.box && isSnormPosition(changed.layout.positions);
  instance = std::move(changed);
  link(handle.index);
  if (hasNewMesh) shift(handle);
  raise(handle.index, hasNewMesh || hasNewBox ? Need::restart : Need::urgent);
  return {};
}

Result<void> SceneBooks::setBox(InstanceHandle handle, const Box& box) {
  if (!isBox(box)) {
    return invalid("instance " + std::to_string(handle.index) +
                   ": the box of its snorm16 positions must be finite, with sides longer than 0");
  }
  instances_.at(handle.index).extras.box = box;
  raise(handle.index, Need::restart);
  return {};
}

Result<void> SceneBooks::setMorphWeights(InstanceHandle handle,
                                         std::span<const MorphWeight> morphs) {
  SceneInstance& instance = instances_.at(handle.index);
  const SceneMesh& mesh = meshes_.at(instance.mesh.index);
  if (Result<void> good =
          checkMorphs(morphs, writtenTargets(instance, mesh), {"instance", handle.index});
      !good)
    return good;
  std::vector<MorphWeight>& active = instance.extras.morphs;
  assignActive(morphs, morphsScratch_);
  active.swap(morphsScratch_);
  // Instances with and without active morph targets use different kernels.
  if (active.empty() != morphsScratch_.empty()) {
    if (Result<void> good = remakeRuns(instance, states_[handle.index].isCulled); !good) {
      active.swap(morphsScratch_);
      return good;
    }
  }
  raise(handle.index, Need::stale);
  return {};
}

/// Changes that affect the kernel, the inputs or the output of the instance.
Result<void> SceneBooks::changeSkinning(const InstanceChange& change) {
  SceneInstance& instance = instances_.at(change.instance.index);
  const bool hasNewMesh = change.mesh && *change.mesh != instance.mesh;
  const bool hasNewBox = change.box && isSnormPosition(instance.layout.positions);
  if (change.morphs && instance.morphWriter != MorphWriter::cpu) {
    return invalid("instance " + std::to_string(change.instance.index) +
                   ": not the CPU writes its morph weights");
  }
  // A box and morph weights alone need neither other kernels nor room.
  if (hasNewMesh || change.pose || change.method || (hasNewBox && change.morphs))
    return rebuild(instance, change);
  if (hasNewBox) return setBox(change.instance, *change.box);
  if (change.morphs) return setMorphWeights(change.instance, *change.morphs);
  return {};
}

/// All other changes, which cannot fail.
void SceneBooks::changeState(InstanceState& state, const InstanceChange& change) {
  if (change.updateInterval) state.updateInterval = *change.updateInterval;
  if (change.visible && turn(state, recordNumber(), *change.visible) && *change.visible)
    comeBack(state, change.instance);
  if (change.teleports) raise(change.instance.index, Need::restart);
}

Result<void> Scene::change(const InstanceChange& change) {
  SceneBooks& books = changed();
  InstanceState* const state = books.findState(change.instance);
  if (state == nullptr) return unknownHandle("instance", change.instance);
  if (change.updateInterval == 0u) {
    return invalid("instance " + std::to_string(change.instance.index) +
                   ": the update interval must be at least 1 frame, not 0");
  }
  if (Result<void> done = books.changeSkinning(change); !done) return done;
  books.changeState(*state, change);
  return {};
}

Result<void> Scene::change(std::span<const InstanceChange> changes) {
  SceneBooks& books = changed();
  for (const InstanceChange& one : changes) {
    const bool changesSkinning =
        one.mesh || one.pose || one.method || one.box || one.morphs || one.updateInterval == 0u;
    InstanceState* const state = books.findState(one.instance);
    if (!changesSkinning && state != nullptr) {
      books.changeState(*state, one);
    } else if (Result<void> done = change(one); !done) {
      return numbered(done.error(), &one - changes.data());
    }
  }
  return {};
}

Result<void> Scene::setVisibility(std::span<const InstanceVisibility> instances) {
  SceneBooks& books = changed();
  // Local copies, so that the compiler knows that stores to a state do not change them.
  const std::span<InstanceState> states = books.states_;
  const std::uint32_t record = books.recordNumber();
  for (const InstanceVisibility& wanted : instances) {
    const InstanceHandle& handle = wanted.instance;
    const bool isKnown = handle.index < states.size() && handle &&
                         states[handle.index].generation == handle.generation;
    if (!isKnown || wanted.updateInterval == 0) {
      InstanceChange change;
      change.instance = handle;
      change.updateInterval = wanted.updateInterval;
      return numbered(this->change(change).error(), &wanted - instances.data());
    }
    InstanceState& state = states[handle.index];
    state.updateInterval = wanted.updateInterval;
    if (SceneBooks::turn(state, record, wanted.visible) && wanted.visible)
      books.comeBack(state, handle);
  }
  return {};
}

Result<bool> Scene::isDue(InstanceHandle handle) const {
  const SceneBooks& books = *books_;
  const SceneInstance* instance = books.instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  const InstanceState& state = books.states_[handle.index];
  const Action action = books.actionOf(state, instance->pose, std::max(state.need, Need::stale));
  return books.hasBegun_ && action >= Action::skin;
}

std::uint64_t Scene::compact(std::uint64_t maxBytes) {
  SceneBooks& books = changed();
  RangeAllocator& ranges = books.outputStore_.ranges;
  const std::uint64_t most = std::min(maxBytes, ranges.largestFree());
  struct Movable {
    std::uint64_t offset, size;
    std::uint32_t index;
  };
  std::vector<Movable> movable;
  std::uint64_t smallest = ~std::uint64_t{0};
  for (std::uint32_t index = 0; most != 0 && index < books.instances_.capacity(); ++index) {
    if (!books.instances_.isUsed(index)) continue;
    const SceneInstance& instance = books.instances_.at(index);
    const Range& bytes = instance.target.bytes;
    if (instance.shown != instance.target || bytes.size > most) continue;
    movable.push_back({bytes.offset, bytes.size, index});
    smallest = std::min(smallest, bytes.size);
  }
  // The last one first. A heap, since most calls move few.
  const auto isBefore = [](const Movable& a, const Movable& b) { return a.offset < b.offset; };
  std::make_heap(movable.begin(), movable.end(), isBefore);
  std::uint64_t moved = 0;
  std::uint64_t tooLarge = ~std::uint64_t{0};  // for every gap before the instance
  while (!movable.empty() && smallest < tooLarge && smallest <= maxBytes - moved) {
    std::pop_heap(movable.begin(), movable.end(), isBefore);
    const auto [offset, size, index] = movable.back();
    movable.pop_back();
    if (size >= tooLarge || size > maxBytes - moved) continue;
    SceneInstance& instance = books.instances_.at(index);
    const Range from = instance.target.bytes;
    const Result<VertexPlaces> laidOut = placeVertices(instance.layout, instance.vertexCount);
    const std::optional<Range> to = ranges.allocateBelow(size, laidOut->alignment, offset);
    if (!to) {
      if (!ranges.hasBelow(size, offset)) tooLarge = size;
      continue;
    }
    instance.target.bytes = *to;
    if (!books.remakeRuns(instance, books.states_[index].isCulled)) {
      // It would lie in two storage buffer ranges, and must not.
      ranges.free(*to);
      instance.target.bytes = from;
      continue;
    }
    books.shift(books.instances_.handleOf(index));
    moved += size;
  }
  ranges.endMoves();
  return moved;
}

Result<InstanceOutput> Scene::output(InstanceHandle handle) const {
  const SceneBooks& books = *books_;
  const SceneInstance* instance = books.instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  InstanceOutput output;
  const Place& place = instance->place();
  const std::uint64_t offset = books.outputStore_.base + place.bytes.offset;
  const Result<VertexPlaces> places = placeVertices(instance->layout, place.vertexCount, offset);
  if (!places) return places.error();
  output.isWritten = instance->isWritten;
  output.mesh = place.mesh;
  output.offset = offset;
  output.places = *places;
  // The CPU does not know whether one that is culled on the GPU moves. If not, any number is right.
  const InstanceState& state = books.states_[handle.index];
  const bool moves = state.isCulled ? instance->version != 0 : state.isMoving;
  if (!state.interpolates || !moves) return output;
  const std::uint64_t interval = instance->updatedInterval;
  const std::uint64_t elapsed = books.recordedFrame_ - instance->updatedIn + 1;
  output.motionScale = 1.0f / static_cast<float>(interval);
  output.interpolation =
      static_cast<float>(std::min(elapsed, interval)) / static_cast<float>(interval);
  return output;
}

Result<void> Scene::indexedDraws(std::span<const InstanceHandle> instances,
                                 std::span<const IndexRange> indices,
                                 std::span<IndexedDraw> draws) const {
  const SceneBooks& books = *books_;
  if (instances.size() != draws.size()) {
    return invalid("there are " + std::to_string(instances.size()) + " instances, but " +
                   std::to_string(draws.size()) + " draws");
  }
  const VertexLayout* layout = nullptr;  // whose stride is known
  std::uint32_t stride = 0;
  for (std::size_t number = 0; number < instances.size(); ++number) {
    const auto wrong = [number](ErrorCode code, const std::string& why) {
      return Error{code, "draw " + std::to_string(number) + ": " + why};
    };
    const SceneInstance* instance = books.instances_.find(instances[number]);
    if (instance == nullptr) {
      return wrong(ErrorCode::invalidArgument,
                   unknownHandle("instance", instances[number]).message);
    }
    const Place& place = instance->place();
    if (place.mesh.index >= indices.size())
      return wrong(ErrorCode::invalidArgument, "there is no range of indices for its mesh");
    if (layout == nullptr || *layout != instance->layout) {
      layout = &instance->layout;
      if (layout->planar)
        return wrong(ErrorCode::invalidArgument, "its attributes are not interleaved");
      const std::uint32_t own = (*placeVertices(*layout, 1))[Stream::positions].stride;
      if (number != 0 && own != stride) {
        return wrong(ErrorCode::invalidArgument, "its stride of " + std::to_string(own) +
                                                     " bytes is not the first one, " +
                                                     std::to_string(stride));
      }
      stride = own;
    }
    const std::uint64_t first = (books.outputStore_.base + place.bytes.offset) / stride;
    if (first > std::numeric_limits<std::int32_t>::max()) {
      return wrong(ErrorCode::limitExceeded,
                   "its first vertex is number " + std::to_string(first) + " of the buffer");
    }
    const IndexRange& range = indices[place.mesh.index];
    draws[number] = {range.count, instance->isWritten ? 1u : 0u, range.first,
                     static_cast<std::int32_t>(first), static_cast<std::uint32_t>(number)};
  }
  return {};
}

}  // namespace dermis
