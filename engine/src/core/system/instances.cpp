// Instances: how they are added, placed, changed and removed.

#include <algorithm>
#include <string>

#include "plan/check.h"
#include "system/books.h"

namespace dermis {
namespace {

constexpr Subject theInstance{"the instance"};

/// The job that skins an instance, but for what changes from frame to frame.
Job jobOf(const SceneInstance& instance, const SceneMesh& mesh, const VertexPlaces& places) {
  Job job;
  job.mesh = mesh.info;
  job.meshOffset = mesh.bytes.offset;
  job.method = instance.method;
  job.place(places);
  job.box = instance.extras.box;
  job.bounds = instance.bounds;
  job.morphs = instance.extras.morphs;
  return job;
}

}  // namespace

/// Whether it could be skinned, were there room.
Result<void> SceneBooks::check(const SceneInstance& instance) const {
  const SceneMesh* mesh = meshes_.find(instance.mesh);
  if (mesh == nullptr) return unknownHandle("mesh", instance.mesh);
  const ScenePose* pose = poses_.find(instance.poseHandle);
  if (pose == nullptr) return unknownHandle("pose", instance.poseHandle);
  if (instance.updateInterval == 0) {
    return invalid("the instance's update interval is 1 or more frames, not 0");
  }
  if (instance.layout.motion == Motion::reskinned)
    return invalid("the instance's layout says Motion::reskinned, a scene has Motion::kept only");
  const Result<VertexPlaces> laidOut = placeVertices(instance.layout, mesh->info.vertexCount);
  if (!laidOut) return laidOut.error();
  const std::uint64_t most = description_.outputCapacity.maximum;
  if (laidOut->size > most) {
    return Error{ErrorCode::limitExceeded, "the instance takes " + std::to_string(laidOut->size) +
                                               " bytes of output, at most there are " +
                                               std::to_string(most)};
  }
  const PoseDescription own{pose->jointCount, 0, pose->mayScale};
  Batch batch;
  batch.poses = {&own, 1};
  batch.meshesSize = meshStore_.ranges.capacity();
  batch.outputs = OutputSizes::oneBuffer(std::max(outputStore_.ranges.capacity(), laidOut->size));
  return checkJob(batch, jobOf(instance, *mesh, *laidOut), theInstance, description_.limits);
}

Result<void> SceneBooks::takeResult(SceneInstance& instance) {
  if (!instance.bounds && !isSnormPosition(instance.layout.positions)) return {};
  const Result<std::optional<Range>> result = take(resultStore_, 1, 1);
  if (!result) return result.error();
  if (!*result) {
    return Error{ErrorCode::limitExceeded,
                 "the instance wants bounds, or positions in snorm16: as many as there may be, " +
                     std::to_string(resultStore_.ranges.capacity()) + ", have them already"};
  }
  instance.extras.result = static_cast<std::uint32_t>((*result)->offset);
  return {};
}

void SceneBooks::freeResult(const SceneInstance& instance) {
  if (instance.extras.result != notUsed) resultStore_.ranges.free({instance.extras.result, 1});
}

/// The pose's place in the form that the method reads; it stays until the pose is removed.
Result<void> SceneBooks::reserveUnits(const SceneInstance& instance) {
  const PaletteForm form = paletteForm(instance.method);
  ScenePose& pose = poses_.at(instance.poseHandle.index);
  std::optional<Range>& units = pose.forms[static_cast<std::size_t>(form)].units;
  if (units) return {};
  const std::uint64_t size = paletteSize(form, pose.jointCount, pose.mayScale);
  const Result<std::optional<Range>> taken = take(unitStore_, size, 1);
  if (!taken) return taken.error();
  units = *taken;
  if (units) return {};
  return noRoom("pose " + std::to_string(instance.poseHandle.index) + " takes " +
                    std::to_string(size) + " times 16 bytes in the form that " +
                    std::string(methodName(instance.method)) + " reads",
                unitStore_, "such units of palettes");
}

/// Fails with `limitExceeded` if the output has no room; the instance is then as it was.
Result<void> SceneBooks::findRoom(SceneInstance& instance) {
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
  Result<void> made = makeRuns(instance);
  if (!made) outputStore_.ranges.free(**bytes);
  return made;
}

Result<void> SceneBooks::makeRuns(SceneInstance& instance) {
  const SceneMesh& mesh = meshes_.at(instance.mesh.index);
  const ScenePose& pose = poses_.at(instance.poseHandle.index);
  const Result<VertexPlaces> laidOut =
      placeVertices(instance.layout, mesh.info.vertexCount, instance.target.bytes.offset);
  if (!laidOut) return laidOut.error();
  Placing placing;
  placing.subject = theInstance;
  placing.outputs = OutputSizes::oneBuffer(outputStore_.ranges.capacity());
  placing.jointCount = pose.jointCount;
  placing.mayScale = instance.method != Method::linear && pose.mayScale;
  placing.isCulled = instance.isCulled;
  runsScratch_.clear();
  if (Result<void> placed = groups_.place(jobOf(instance, mesh, *laidOut), placing,
                                          description_.limits, description_.tuning, runsScratch_);
      !placed)
    return placed;
  instance.run = runsScratch_.front();
  instance.furtherRuns.assign(runsScratch_.begin() + 1, runsScratch_.end());
  return {};
}

void SceneBooks::releaseRuns(SceneInstance& instance) {
  groups_.release(instance.run.group);
  for (const PlacedRun& run : instance.furtherRuns) groups_.release(run.group);
  instance.furtherRuns.clear();
}

/// What was recorded is still drawn from, and stays `shown`; what never was is free at once.
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

Result<InstanceHandle> SceneBooks::addInstance(const InstanceDescription& description) {
  SceneInstance instance;
  instance.pose = description.pose.index;
  instance.updateInterval = description.updateInterval;
  instance.method = description.method;
  instance.isCulled = description.culledOnGpu;
  instance.hasMotion = description.layout.motion != Motion::none;
  instance.mesh = description.mesh;
  instance.poseHandle = description.pose;
  instance.layout = description.layout;
  instance.extras.box = description.box;
  instance.bounds = description.bounds;
  if (Result<void> good = check(instance); !good) return good.error();
  if (!makeSlot()) {
    return Error{ErrorCode::limitExceeded,
                 "there are as many instances as there may be, " + std::to_string(slotCapacity_)};
  }
  if (Result<void> good = reserveUnits(instance); !good) return good.error();
  instance.extras.hasBox = isSnormPosition(instance.layout.positions);
  if (Result<void> taken = takeResult(instance); !taken) return taken.error();
  if (Result<void> found = findRoom(instance); !found) {
    freeResult(instance);
    return found.error();
  }

  ++meshes_.at(instance.mesh.index).users;
  const InstanceHandle handle = instances_.add(std::move(instance));
  SceneInstance& added = instances_.at(handle.index);
  link(handle.index);
  if (added.isCulled) {
    added.culledIndex = static_cast<std::uint32_t>(culled_.size());
    culled_.push_back(handle.index);
  }
  shift(handle);
  makeStale(handle.index);
  return handle;
}

Result<void> SceneBooks::removeInstance(InstanceHandle handle) {
  SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  unlink(handle.index);
  --meshes_.at(instance->mesh.index).users;
  releaseTarget(*instance);
  if (instance->shown) retire(outputStore_.ranges, instance->shown->bytes);
  freeResult(*instance);
  if (instance->isCulled) {
    culled_[instance->culledIndex] = culled_.back();
    instances_.at(culled_.back()).culledIndex = instance->culledIndex;
    culled_.pop_back();
  }
  instances_.remove(handle);
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
Result<void> SceneBooks::takeBackOrFindRoom(SceneInstance& changed) {
  if (!changed.shown || changed.shown->mesh != changed.mesh) return findRoom(changed);
  changed.target = *changed.shown;
  changed.vertexCount = changed.shown->vertexCount;
  return makeRuns(changed);
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
  if (mesh != nullptr && change.morphs) {
    if (Result<void> good =
            checkMorphs(*change.morphs, mesh->info.morphTargetCount, {"instance", handle.index});
        !good)
      return good;
    assignActive(*change.morphs, changed.extras.morphs);
  }
  if (Result<void> good = check(changed); !good) return good;
  if (Result<void> good = reserveUnits(changed); !good) return good;
  if (Result<void> room = hasNewMesh ? takeBackOrFindRoom(changed) : makeRuns(changed); !room)
    return room;

  --meshes_.at(instance.mesh.index).users;
  ++meshes_.at(changed.mesh.index).users;
  unlink(handle.index);
  if (hasNewMesh) {
    releaseTarget(instance);
  } else {
    releaseRuns(instance);
  }
  const bool hasNewBox = change.box && isSnormPosition(changed.layout.positions);
  changed.restartsMotion |= hasNewMesh || hasNewBox;
  changed.isUrgent = true;
  instance = std::move(changed);
  link(handle.index);
  if (hasNewMesh) shift(handle);
  makeStale(handle.index);
  return {};
}

Result<void> SceneBooks::setMesh(InstanceHandle handle, MeshHandle mesh) {
  SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  if (instance->mesh == mesh && meshes_.contains(mesh)) return {};
  InstanceChange change;
  change.instance = handle;
  change.mesh = mesh;
  return rebuild(*instance, change);
}

Result<void> SceneBooks::setBox(SceneInstance& instance, InstanceHandle handle, const Box& box) {
  if (!isSnormPosition(instance.layout.positions)) return {};
  if (!isBox(box)) {
    return invalid("instance " + std::to_string(handle.index) +
                   ": the box of its snorm16 positions must be finite, each side longer than 0");
  }
  instance.extras.box = box;
  instance.isUrgent = true;
  instance.restartsMotion = true;
  makeStale(handle.index);
  return {};
}

Result<void> SceneBooks::changeOne(SceneInstance& instance, const InstanceChange& change) {
  if (change.updateInterval && *change.updateInterval == 0) {
    return invalid("instance " + std::to_string(change.instance.index) +
                   ": an update interval is 1 or more frames, not 0");
  }
  // A box and morph weights alone need neither other kernels nor room.
  Result<void> done;
  if (change.mesh || change.pose || change.method || (change.box && change.morphs)) {
    done = rebuild(instance, change);
  } else if (change.box) {
    done = setBox(instance, change.instance, *change.box);
  } else if (change.morphs) {
    done = setMorphWeights(change.instance, *change.morphs);
  }
  if (done) setSmall(instance, change);
  return done;
}

/// What cannot fail.
void SceneBooks::setSmall(SceneInstance& instance, const InstanceChange& change) {
  if (change.updateInterval) instance.updateInterval = *change.updateInterval;
  if (change.visible) setVisible(instance, change.instance, *change.visible);
  if (change.teleports) teleport(instance, change.instance);
}

Result<void> SceneBooks::change(std::span<const InstanceChange> changes) {
  for (const InstanceChange& change : changes) {
    SceneInstance* instance = instances_.find(change.instance);
    const bool isSmall = !change.mesh && !change.pose && !change.method && !change.box &&
                         !change.morphs && change.updateInterval != 0u;
    if (instance != nullptr && isSmall) {
      setSmall(*instance, change);
      continue;
    }
    Result<void> done;
    if (instance == nullptr) {
      done = unknownHandle("instance", change.instance);
    } else {
      done = changeOne(*instance, change);
    }
    if (done) continue;
    Error error = done.error();
    error.message = "change " + std::to_string(&change - changes.data()) + ": " + error.message;
    return error;
  }
  return {};
}

std::uint64_t SceneBooks::compact(std::uint64_t maxBytes) {
  std::vector<InstanceHandle> fromEnd;
  for (std::uint32_t index = 0; index < instances_.capacity(); ++index) {
    if (!instances_.isUsed(index)) continue;
    const SceneInstance& instance = instances_.at(index);
    if (instance.shown == instance.target) fromEnd.push_back(instances_.handleOf(index));
  }
  const auto offsetOf = [this](InstanceHandle handle) {
    return instances_.at(handle.index).target.bytes.offset;
  };
  std::sort(fromEnd.begin(), fromEnd.end(),
            [&](InstanceHandle a, InstanceHandle b) { return offsetOf(a) > offsetOf(b); });
  std::uint64_t moved = 0;
  for (const InstanceHandle handle : fromEnd) {
    SceneInstance& instance = instances_.at(handle.index);
    const Range from = instance.target.bytes;
    if (moved + from.size > maxBytes) continue;
    const Result<VertexPlaces> laidOut = placeVertices(instance.layout, instance.vertexCount);
    const std::optional<Range> to =
        outputStore_.ranges.allocateBelow(from.size, laidOut->alignment, from.offset);
    if (!to) continue;
    releaseRuns(instance);
    instance.target.bytes = *to;
    if (Result<void> made = makeRuns(instance); !made) {
      // A device with few storage buffers cannot have it there.
      outputStore_.ranges.free(*to);
      instance.target.bytes = from;
      made = makeRuns(instance);
      continue;
    }
    shift(handle);
    moved += from.size;
  }
  return moved;
}

Result<InstanceOutput> SceneBooks::output(InstanceHandle handle) const {
  const SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  InstanceOutput output;
  if (!instance->shown) return output;
  const Place& place = *instance->shown;
  const Result<VertexPlaces> places =
      placeVertices(instance->layout, place.vertexCount, place.bytes.offset);
  if (!places) return places.error();
  output.mesh = place.mesh;
  output.offset = place.bytes.offset;
  output.size = place.bytes.size;
  output.positions = places->positions;
  output.normals = places->normals;
  output.tangents = places->tangents;
  output.previousPositions = places->previousPositions;
  return output;
}

}  // namespace dermis
