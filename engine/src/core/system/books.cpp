// What comes and goes, and what engines set.

#include "system/books.h"

#include <algorithm>
#include <string>

#include "plan/check.h"
#include "system/slot_map.h"

namespace dermis {
namespace {

Error isUsed(const char* kind, std::uint32_t index, std::uint32_t users) {
  return {ErrorCode::invalidArgument, std::string(kind) + " " + std::to_string(index) +
                                          " is used by " + std::to_string(users) + " instance" +
                                          (users == 1 ? "" : "s")};
}

Error noRoom(const std::string& what, const RangeAllocator& store, const char* unit) {
  return {ErrorCode::limitExceeded,
          what + ", of " + std::to_string(store.capacity()) + " " + unit + " of the budget " +
              std::to_string(store.capacity() - store.used()) + " are free, " +
              std::to_string(store.largestFree()) + " in one piece"};
}

}  // namespace

SceneBooks::SceneBooks(const SceneDescription& description)
    : description_(description),
      meshStore_(description.meshBudget),
      jointStore_(description.jointBudget),
      unitStore_(sceneSizes(description).palettes / unitBytes),
      outputStore_(description.outputBudget),
      readBacks_(description.framesInFlight) {}

PlanSizes sceneSizes(const SceneDescription& description) {
  PlanSizes sizes;
  sizes.meshes = description.meshBudget;
  sizes.poses =
      std::uint64_t{description.jointBudget} * description.framesInFlight * sizeof(JointMatrix);
  // Room for the largest form of every joint, and the status of every pose of two joints.
  sizes.palettes = std::uint64_t{description.jointBudget} * 6 * unitBytes;
  sizes.results = description.boundsBudget;
  sizes.outputs = OutputSizes::oneBuffer(description.outputBudget);
  sizes.isScene = true;
  sizes.slots = description.instanceBudget;
  return sizes;
}

// -- Meshes and poses.

Result<MeshHandle> SceneBooks::addMesh(const MeshInfo& info) {
  if (Result<void> kept = checkPromisedMesh(info, description_.limits.promises, {"the mesh"});
      !kept)
    return kept.error();
  const std::optional<Range> bytes = meshStore_.allocate(info.byteSize, packedMeshAlignment);
  if (!bytes) {
    return noRoom("a packed mesh takes " + std::to_string(info.byteSize) + " bytes", meshStore_,
                  "bytes");
  }
  return meshes_.add({info, *bytes, 0});
}

Result<void> SceneBooks::removeMesh(MeshHandle handle) {
  const SceneMesh* mesh = meshes_.find(handle);
  if (mesh == nullptr) return unknownHandle("mesh", handle);
  if (mesh->users != 0) return isUsed("mesh", handle.index, mesh->users);
  retire(Retired::Store::meshes, mesh->bytes);
  meshes_.remove(handle);
  return {};
}

Result<PoseHandle> SceneBooks::addPose(std::uint32_t jointCount, bool mayScale) {
  if (jointCount == 0 || jointCount > maxPoseJoints) {
    return Error{ErrorCode::invalidArgument, "a pose has 1 to " + std::to_string(maxPoseJoints) +
                                                 " joints, not " + std::to_string(jointCount)};
  }
  if (Result<void> kept = checkPromisedPose(mayScale, description_.limits.promises, {"the pose"});
      !kept)
    return kept.error();
  const std::optional<Range> joints = jointStore_.allocate(jointCount, 1);
  if (!joints) {
    return noRoom("a pose takes " + std::to_string(jointCount) + " joints", jointStore_, "joints");
  }
  ScenePose pose;
  pose.jointCount = jointCount;
  pose.mayScale = mayScale;
  pose.joints = *joints;
  return poses_.add(pose);
}

Result<void> SceneBooks::removePose(PoseHandle handle) {
  const ScenePose* pose = poses_.find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  if (pose->users != 0) return isUsed("pose", handle.index, pose->users);
  retire(Retired::Store::joints, pose->joints);
  for (const ScenePose::Form& form : pose->forms) {
    if (form.units) retire(Retired::Store::units, *form.units);
  }
  poses_.remove(handle);
  return {};
}

// -- Frames.

Result<void> SceneBooks::beginFrame(std::uint64_t frame, std::uint64_t completedFrame) {
  if (frame <= frame_ || completedFrame < completed_ || completedFrame >= frame) {
    return Error{ErrorCode::invalidArgument,
                 "frame " + std::to_string(frame) + ", with " + std::to_string(completedFrame) +
                     " complete, cannot follow frame " + std::to_string(frame_) + ", with " +
                     std::to_string(completed_) + " complete"};
  }
  if (std::ranges::all_of(
          readBacks_, [&](const ReadBack& recorded) { return recorded.frame > completedFrame; })) {
    return Error{ErrorCode::invalidArgument,
                 "frame " + std::to_string(frame) + " begins while the GPU has completed frame " +
                     std::to_string(completedFrame) + ": that makes more than the " +
                     std::to_string(description_.framesInFlight) + " frames in flight described"};
  }
  frame_ = frame;
  completed_ = completedFrame;
  hasBegun_ = true;
  abandonable_.isPossible = false;
  while (!retired_.empty() && retired_.front().frame <= completed_) {
    free(retired_.front());
    retired_.pop_front();
  }
  return {};
}

void SceneBooks::retire(Retired::Store store, const Range& range) {
  retired_.push_back({frame_, store, range});
  // What no frame has seen, or only complete ones, is free at once.
  while (!retired_.empty() && retired_.front().frame <= completed_) {
    free(retired_.front());
    retired_.pop_front();
  }
}

void SceneBooks::free(const Retired& retired) {
  switch (retired.store) {
    case Retired::Store::meshes:
      return meshStore_.free(retired.range);
    case Retired::Store::joints:
      return jointStore_.free(retired.range);
    case Retired::Store::units:
      return unitStore_.free(retired.range);
    case Retired::Store::output:
      return outputStore_.free(retired.range);
  }
}

std::uint64_t SceneBooks::poseOffset(const ScenePose& pose) const {
  return (std::uint64_t{pose.slot} * description_.jointBudget + pose.joints.offset) *
         sizeof(JointMatrix);
}

Result<std::uint64_t> SceneBooks::writePose(PoseHandle handle) {
  if (!hasBegun_) {
    return Error{ErrorCode::invalidArgument,
                 "a pose is written between beginFrame and record, so that it is known which "
                 "memory the GPU is done with"};
  }
  ScenePose* pose = poses_.find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  if (pose->poseFrame != frame_) {
    // The next of its slots: the GPU is done with it, since it was superseded at least as many
    // recorded frames ago as there may be in flight. What no recorded frame reads is overwritten.
    if (pose->poseFrame <= recordedFrame_)
      pose->slot = (pose->slot + 1) % description_.framesInFlight;
    pose->poseFrame = frame_;
    ++pose->version;
    posed_.push_back(handle);
  }
  return poseOffset(*pose);
}

// -- What engines set.

void SceneBooks::makeStale(std::uint32_t index) {
  SceneInstance& instance = instances_.at(index);
  instance.isStale = true;
  makePending(index);
}

void SceneBooks::makePending(std::uint32_t index) {
  SceneInstance& instance = instances_.at(index);
  if (instance.isListed || !instance.isVisible || instance.isCulled) return;
  instance.isListed = true;
  pending_.push_back(instances_.handleOf(index));
}

void SceneBooks::setVisible(SceneInstance& instance, InstanceHandle handle, bool isVisible) {
  if (instance.isVisible == isVisible) return;
  instance.isVisible = isVisible;
  if (!isVisible) {
    instance.hiddenAfter = record_;
    return;
  }
  if (instance.hiddenAfter != record_) {
    // Not displayed by the last record: what it showed before is no motion.
    instance.visibleFrom = record_ + 1;
    if (instance.isMoving) moving_.push_back(handle);
  }
  if (instance.isStale) {
    instance.isUrgent = true;
    makePending(handle.index);
  }
}

Result<void> SceneBooks::setVisible(InstanceHandle handle, bool isVisible) {
  SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  setVisible(*instance, handle, isVisible);
  return {};
}

Result<void> SceneBooks::setUpdateInterval(InstanceHandle handle, std::uint32_t interval) {
  SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  if (interval == 0) {
    return Error{ErrorCode::invalidArgument, "instance " + std::to_string(handle.index) +
                                                 ": an update interval is 1 or more frames, not 0"};
  }
  instance->updateInterval = interval;
  return {};
}

void SceneBooks::teleport(SceneInstance& instance, InstanceHandle handle) {
  instance.restartsMotion = true;
  instance.isUrgent = true;
  makeStale(handle.index);
}

Result<void> SceneBooks::teleport(InstanceHandle handle) {
  SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  teleport(*instance, handle);
  return {};
}

Result<void> SceneBooks::setMorphWeights(InstanceHandle handle,
                                         std::span<const MorphWeight> morphs) {
  SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  const SceneMesh& mesh = meshes_.at(instance->mesh.index);
  if (Result<void> good =
          checkMorphs(morphs, mesh.info.morphTargetCount, {"instance", handle.index});
      !good)
    return good;
  std::vector<MorphWeight>& active = instance->extras.morphs;
  const bool hadMorphs = !active.empty();
  assignActive(morphs, active);
  // With and without are two kernels.
  if (hadMorphs == active.empty()) {
    releaseRuns(*instance);
    if (Result<void> good = makeRuns(*instance); !good) return good;
  }
  makeStale(handle.index);
  return {};
}

SceneStatistics SceneBooks::statistics() const {
  const auto storeOf = [](const RangeAllocator& store, std::uint64_t unit) {
    return StoreStatistics{store.capacity() * unit, store.used() * unit,
                           store.largestFree() * unit};
  };
  return {committed_, culling_, storeOf(meshStore_, 1), storeOf(unitStore_, unitBytes),
          storeOf(outputStore_, 1)};
}

}  // namespace dermis
