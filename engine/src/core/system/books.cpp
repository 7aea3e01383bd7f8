// Meshes and poses, capacities, and the begin of frames.

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

/// Initial palette units: dual quaternions and scale of every joint, and a status for every two
/// joints, limited to a storage buffer range.
std::uint64_t firstUnits(const SceneDescription& description) {
  return std::min((description.jointCapacity.initial + description.gpuJointCapacity.initial) * 5,
                  description.limits.maxStorageBufferRange / unitBytes);
}

/// Without a growth callback, the initial capacity is the maximum.
Capacity capacityOf(const SceneDescription& description, const Capacity& capacity,
                    std::uint64_t most) {
  if (description.growth.grow == nullptr) return Capacity::fixed(capacity.initial);
  return {capacity.initial, std::min(capacity.maximum, most)};
}

SceneDescription withLimits(SceneDescription description) {
  constexpr std::uint64_t mostIndices = 0xffffffff;
  const std::uint64_t range = description.limits.maxStorageBufferRange;
  const auto limit = [&](Capacity& capacity, std::uint64_t most) {
    capacity = capacityOf(description, capacity, most);
  };
  limit(description.meshCapacity, range / packedMeshAlignment * packedMeshAlignment);
  limit(description.jointCapacity, mostIndices);
  limit(description.gpuJointCapacity, mostIndices);
  // Small enough that sums do not overflow.
  limit(description.outputCapacity, std::uint64_t{1} << 60);
  limit(description.instanceCapacity, range / sizeof(abi::HistoryRecord));
  limit(description.boundsCapacity, range / sizeof(InstanceResult));
  return description;
}

}  // namespace

SceneBooks::SceneBooks(const SceneDescription& description)
    : description_(withLimits(description)),
      meshStore_{BufferRole::meshes, description_.meshCapacity},
      unitStore_{BufferRole::palettes,
                 capacityOf(description, {firstUnits(description)},
                            description.limits.maxStorageBufferRange / unitBytes),
                 unitBytes},
      outputStore_{BufferRole::positions, description_.outputCapacity, 1,
                   description_.outputOffset},
      resultStore_{BufferRole::results, description_.boundsCapacity, sizeof(InstanceResult)},
      slotCapacity_(description.instanceCapacity.initial),
      readBacks_(description.framesInFlight) {
  for (const auto& [writer, joints] :
       {std::pair{PoseWriter::cpu, description.jointCapacity.initial},
        {PoseWriter::gpu, description.gpuJointCapacity.initial}}) {
    if (joints != 0) poseBuffers_.push_back({writer, RangeAllocator(joints * slotsOf(writer))});
  }
}

PlanSizes sceneSizes(const SceneDescription& description) {
  PlanSizes sizes;
  sizes.meshes = description.meshCapacity.initial;
  sizes.poses =
      description.jointCapacity.initial * description.framesInFlight * sizeof(JointMatrix);
  sizes.gpuPoses = description.gpuJointCapacity.initial * sizeof(JointMatrix);
  sizes.palettes = firstUnits(description) * unitBytes;
  sizes.results = static_cast<std::uint32_t>(description.boundsCapacity.initial);
  sizes.outputs = OutputSizes::oneBuffer(description.outputCapacity.initial);
  sizes.isScene = true;
  sizes.slots = static_cast<std::uint32_t>(description.instanceCapacity.initial);
  return sizes;
}

// -- Meshes and poses.

Result<MeshHandle> SceneBooks::addMesh(const MeshInfo& info) {
  if (Result<void> good = checkMeshInfo(info, {"the mesh"}); !good) return good.error();
  const Result<std::optional<Range>> bytes = take(meshStore_, info.byteSize, packedMeshAlignment);
  if (!bytes) return bytes.error();
  if (!*bytes) {
    return noRoom("a packed mesh takes " + std::to_string(info.byteSize) + " bytes", meshStore_,
                  "bytes of meshes");
  }
  return meshes_.add({info, **bytes, 0});
}

Result<void> SceneBooks::removeMesh(MeshHandle handle) {
  const SceneMesh* mesh = meshes_.find(handle);
  if (mesh == nullptr) return unknownHandle("mesh", handle);
  if (mesh->users != 0) return isUsed("mesh", handle.index, mesh->users);
  retire(meshStore_.ranges, mesh->bytes);
  meshes_.remove(handle);
  return {};
}

Result<void> SceneBooks::addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                                  const PoseOptions& options) {
  if (jointCount == 0 || jointCount > maxPoseJoints) {
    return Error{ErrorCode::invalidArgument, "a pose has 1 to " + std::to_string(maxPoseJoints) +
                                                 " joints, not " + std::to_string(jointCount)};
  }
  if (options.writer > PoseWriter::gpu)
    return notAValue("the writer of the pose", options.writer, "PoseWriter");
  if (poses.empty()) return {};
  ScenePose pose;
  const std::uint64_t count = std::uint64_t{jointCount} * poses.size();
  const Result<std::optional<Range>> joints = takeJoints(count, options.writer, pose.buffer);
  if (!joints) return joints.error();
  if (!*joints) return noJoints(poses.size(), count, options.writer);
  pose.jointCount = jointCount;
  pose.mayScale = options.mayScale;
  pose.writer = options.writer;
  const std::uint64_t size = std::uint64_t{jointCount} * slotsOf(options.writer);
  for (std::size_t index = 0; index < poses.size(); ++index) {
    pose.joints = {(*joints)->offset + index * size, size};
    poses[index] = poses_.add(pose);
  }
  return {};
}

Result<void> SceneBooks::removePose(PoseHandle handle) {
  const ScenePose* pose = poses_.find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  if (pose->users != 0) return isUsed("pose", handle.index, pose->users);
  retire(poseBuffers_[pose->buffer].joints, pose->joints);
  for (std::size_t form = 0; form < paletteFormCount; ++form) {
    const std::uint32_t unit = pose->forms[form].unit;
    if (unit == notUsed) continue;
    retire(unitStore_.ranges,
           {unit, paletteSize(static_cast<PaletteForm>(form), pose->jointCount, pose->mayScale)});
  }
  poses_.remove(handle);
  return {};
}

// -- Frames.

Result<void> SceneBooks::beginFrame(std::uint64_t frame, std::uint64_t completedFrame) {
  if (frame <= frame_ || completedFrame < completed_ || completedFrame >= frame) {
    return Error{ErrorCode::invalidArgument,
                 "beginFrame(" + std::to_string(frame) + ", " + std::to_string(completedFrame) +
                     "): the frame must be larger than " + std::to_string(frame_) +
                     ", and the completed frame at least " + std::to_string(completed_) +
                     " and less than the frame"};
  }
  if (std::ranges::all_of(
          readBacks_, [&](const ReadBack& recorded) { return recorded.frame > completedFrame; })) {
    return Error{ErrorCode::invalidArgument,
                 "frame " + std::to_string(frame) + " begins while the GPU has completed frame " +
                     std::to_string(completedFrame) +
                     ": more frames are in flight than framesInFlight, which is " +
                     std::to_string(description_.framesInFlight) +
                     "; if one of them was recorded and not submitted, call abandonFrame"};
  }
  frame_ = frame;
  completed_ = completedFrame;
  hasBegun_ = true;
  abandonable_.isPossible = false;
  freeRetired();
  return {};
}

void SceneBooks::retire(RangeAllocator& store, const Range& range) {
  retired_.push_back({frame_, &store, range});
  // Ranges that no frame uses, or only complete ones, are free at once.
  freeRetired();
}

void SceneBooks::freeRetired() {
  while (!retired_.empty() && retired_.front().frame <= completed_) {
    retired_.front().store->free(retired_.front().range);
    retired_.pop_front();
  }
}

PosePlace SceneBooks::placeOf(const ScenePose& pose) {
  const std::uint64_t joint = pose.joints.offset + std::uint64_t{pose.slot} * pose.jointCount;
  return {pose.buffer, joint * sizeof(JointMatrix), pose.jointCount};
}

Result<void> SceneBooks::checkWrite(PoseHandle handle, PoseWriter writer) const {
  if (!hasBegun_) {
    return invalid("a pose can be written only between beginFrame and record");
  }
  const ScenePose* pose = poses_.find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  if (pose->writer == writer) return {};
  return invalid("pose " + std::to_string(handle.index) +
                 (writer == PoseWriter::cpu ? " is written by the GPU; use markWritten"
                                            : " is written by the CPU; use writePose"));
}

void SceneBooks::markWritten(ScenePose& pose, PoseHandle handle) {
  pose.poseFrame = frame_;
  ++pose.version;
  posed_.push_back(handle);
}

Result<PosePlace> SceneBooks::writePose(PoseHandle handle) {
  if (Result<void> good = checkWrite(handle, PoseWriter::cpu); !good) return good.error();
  ScenePose& pose = poses_.at(handle.index);
  if (pose.poseFrame != frame_) {
    // The next of its slots: the GPU is done with it, since it was superseded at least as many
    // recorded frames ago as there may be in flight. What no recorded frame reads is overwritten.
    if (pose.poseFrame <= recordedFrame_) pose.slot = (pose.slot + 1) % description_.framesInFlight;
    markWritten(pose, handle);
  }
  return placeOf(pose);
}

Result<void> SceneBooks::markWritten(std::span<const PoseHandle> poses) {
  for (const PoseHandle handle : poses) {
    if (Result<void> good = checkWrite(handle, PoseWriter::gpu); !good) return good;
    ScenePose& pose = poses_.at(handle.index);
    if (pose.poseFrame != frame_) markWritten(pose, handle);
  }
  return {};
}

Result<void> SceneBooks::markAllWritten() {
  for (std::uint32_t index = 0; index < poses_.capacity(); ++index) {
    if (!poses_.isUsed(index) || poses_.at(index).writer != PoseWriter::gpu) continue;
    const PoseHandle handle = poses_.handleOf(index);
    if (Result<void> marked = markWritten({&handle, 1}); !marked) return marked;
  }
  return {};
}

SceneStatistics SceneBooks::statistics() const {
  const auto of = [](const Store& store) {
    return StoreStatistics{store.ranges.capacity() * store.unitBytes,
                           store.ranges.used() * store.unitBytes,
                           store.ranges.largestFree() * store.unitBytes};
  };
  return {committed_, culling_, of(meshStore_), of(unitStore_), of(outputStore_)};
}

}  // namespace dermis
