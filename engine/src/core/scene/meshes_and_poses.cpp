// Meshes and poses.

#include "scene/books.h"

#include <algorithm>
#include <string>
#include <utility>

#include "plan/check.h"
#include "scene/slot_map.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

Error ofFigure(PoseHandle handle, const ScenePose& pose) {
  return {ErrorCode::invalidArgument, "pose " + std::to_string(handle.index) +
                                          " belongs to figure " + std::to_string(pose.figure) +
                                          ", for which the scene samples it"};
}

}  // namespace

Result<MeshHandle> Scene::addMesh(PackedMesh mesh) {
  return changed().addMesh(mesh.info(), &mesh);
}

Result<MeshHandle> SceneBooks::addMesh(const MeshInfo& info, PackedMesh* mesh) {
  if (Result<void> good = checkMeshInfo(info, {"the mesh"}); !good) return good.error();
  const Result<std::optional<Range>> bytes = take(meshStore_, info.byteSize, packedMeshAlignment);
  if (!bytes) return bytes.error();
  if (!*bytes) {
    return noRoom("a packed mesh takes " + std::to_string(info.byteSize) + " bytes", meshStore_,
                  "bytes of meshes");
  }
  if (mesh != nullptr && owner_.meshAdded != nullptr) {
    if (Result<void> good = owner_.meshAdded(owner_.user, (*bytes)->offset, *mesh); !good) {
      meshStore_.ranges.free(**bytes);
      return good.error();
    }
  }
  const MeshHandle handle = meshes_.add({info, **bytes, 0});
  if (mesh != nullptr && owner_.meshAdded == nullptr)
    meshUploads_.push_back({handle, std::move(*mesh)});
  return handle;
}

Result<void> Scene::removeMesh(MeshHandle handle) {
  SceneBooks& books = changed();
  const SceneMesh* mesh = books.meshes_.find(handle);
  if (mesh == nullptr) return unknownHandle("mesh", handle);
  if (mesh->users != 0) return isUsed("mesh", handle.index, mesh->users);
  books.retire(books.meshStore_.ranges, mesh->bytes);
  std::erase_if(books.meshUploads_, [&](const auto& upload) { return upload.mesh == handle; });
  if (books.owner_.meshRemoved != nullptr)
    books.owner_.meshRemoved(books.owner_.user, mesh->bytes.offset);
  books.meshes_.remove(handle);
  return {};
}

Result<PoseHandle> Scene::addPose(std::uint32_t jointCount, const PoseOptions& options) {
  PoseHandle pose;
  if (Result<void> added = addPoses({&pose, 1}, jointCount, options); !added) return added.error();
  return pose;
}

Result<void> Scene::addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                             const PoseOptions& options) {
  SceneBooks& books = changed();
  if (jointCount == 0 || jointCount > maxPoseJoints) {
    return Error{ErrorCode::invalidArgument, "a pose has 1 to " + std::to_string(maxPoseJoints) +
                                                 " joints, not " + std::to_string(jointCount)};
  }
  ScenePose pose;
  pose.jointCount = pose.writtenJoints = pose.slotJoints = jointCount;
  if (options.rig) {
    const SceneRig* rig = books.rigs_.find(options.rig);
    if (rig == nullptr) return unknownHandle("rig", options.rig);
    if (rig->rig->writtenJoints() != jointCount) {
      return invalid("the pose has " + std::to_string(jointCount) + " joints, but rig " +
                     std::to_string(options.rig.index) + " has " +
                     std::to_string(rig->rig->writtenJoints()) + " written ones");
    }
    pose.rig = options.rig.index;
    pose.jointCount += rig->rig->drivenJoints();
    pose.slotJoints += jointsFor(rig->rig->givenWeights());
  }
  if (Result<void> good = checkPromise(options.promise, {"the pose"}); !good) return good;
  if (books.owner_.isCpu && options.writtenByGpu)
    return invalid("a pose that the GPU writes cannot be skinned on the CPU");
  if (poses.empty()) return {};
  const std::uint64_t count = std::uint64_t{pose.slotJoints} * poses.size();
  const Result<std::optional<Range>> joints =
      books.takeJoints(count, options.writtenByGpu, pose.buffer);
  if (!joints) return joints.error();
  if (!*joints) return books.noJoints(poses.size(), count, options.writtenByGpu);
  pose.promise = options.promise;
  pose.writtenByGpu = options.writtenByGpu;
  const std::uint64_t size = std::uint64_t{pose.slotJoints} * books.slotsOf(options.writtenByGpu);
  for (std::size_t index = 0; index < poses.size(); ++index) {
    pose.joints = {(*joints)->offset + index * size, size};
    if (Result<void> taken = books.takeDriven(pose, pose.rig); !taken) {
      for (const PoseHandle handle : poses.first(index)) books.dropPose(handle, true);
      books.poseBuffers_[pose.buffer].joints.free({(*joints)->offset, size * poses.size()});
      return taken;
    }
    poses[index] = books.poses_.add(pose);
    if (options.writtenByGpu) continue;
    // No frame in flight reads their memory: it was free.
    const std::span<JointMatrix> memory = books.matricesOf(pose);
    std::ranges::fill(memory.first(jointCount), JointMatrix{});
    std::ranges::fill(std::as_writable_bytes(memory.subspan(jointCount)), std::byte{});
    books.upload(poses[index]);
  }
  return {};
}

Result<void> Scene::removePose(PoseHandle handle) {
  SceneBooks& books = changed();
  const ScenePose* pose = books.poses_.find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  if (pose->users != 0) return isUsed("pose", handle.index, pose->users);
  if (pose->figure != notUsed) return ofFigure(handle, *pose);
  books.retire(books.poseBuffers_[pose->buffer].joints, pose->joints);
  books.dropPose(handle);
  return {};
}

/// Of one that no instance uses. The caller retires its joints. `isNew`: no frame can have used it.
void SceneBooks::dropPose(PoseHandle handle, bool isNew) {
  const ScenePose& pose = poses_.at(handle.index);
  releaseDriven(pose, isNew);
  for (std::size_t form = 0; form < paletteFormCount; ++form) {
    const std::uint32_t unit = pose.forms[form].unit;
    if (unit == notUsed) continue;
    retire(unitStore_.ranges,
           {unit, paletteSize(static_cast<PaletteForm>(form), pose.jointCount, pose.promise)});
  }
  poses_.remove(handle);
}

Result<BufferPart> SceneBooks::posePart(PoseHandle handle) const {
  const ScenePose* pose = poses_.find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  if (!pose->writtenByGpu) {
    return invalid("pose " + std::to_string(handle.index) +
                   " is written by the CPU; use writePose");
  }
  return BufferPart{poseBuffers_[pose->buffer].buffer.number, offsetOf(*pose),
                    pose->slotJoints * sizeof(JointMatrix)};
}

std::span<JointMatrix> SceneBooks::matricesOf(const ScenePose& pose) {
  PoseStore& store = poseBuffers_[pose.buffer];
  JointMatrix* const begin = store.buffer.mapped != nullptr
                                 ? reinterpret_cast<JointMatrix*>(store.buffer.mapped)
                                 : store.staged.data();
  return {begin + offsetOf(pose) / sizeof(JointMatrix), pose.slotJoints};
}

std::span<JointMatrix> SceneBooks::drivenOf(const ScenePose& pose) {
  auto* const begin = reinterpret_cast<JointMatrix*>(poseBuffers_[pose.drivenBuffer].buffer.mapped);
  return {begin + pose.driven.offset, static_cast<std::size_t>(pose.driven.size)};
}

Result<void> SceneBooks::mayWrite() const {
  // Before the first frame, poses are written for it.
  if (hasBegun_ || frame_ == 0) return {};
  return invalid("a pose can be written only between beginFrame and record");
}

Result<void> SceneBooks::checkWrite(PoseHandle handle, bool writtenByGpu) const {
  if (Result<void> good = mayWrite(); !good) return good;
  const ScenePose* pose = poses_.find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  if (pose->figure != notUsed) return ofFigure(handle, *pose);
  if (pose->writtenByGpu == writtenByGpu) return {};
  return invalid("pose " + std::to_string(handle.index) +
                 (writtenByGpu ? " is written by the CPU; use writePose"
                               : " is written by the GPU; use markWritten"));
}

void SceneBooks::markWritten(ScenePose& pose, PoseHandle handle) {
  pose.poseFrame = frame_;
  ++pose.version;
  posed_.push_back(handle);
}

Result<std::span<JointMatrix>> Scene::writePose(PoseHandle handle) {
  SceneBooks& books = changed();
  if (Result<void> good = books.checkWrite(handle, false); !good) return good.error();
  ScenePose& pose = books.poses_.at(handle.index);
  if (pose.poseFrame != books.frame_) {
    // The next of its slots: the GPU is done with it, since it was superseded at least as many
    // recorded frames ago as there may be in flight. What no recorded frame reads is overwritten.
    if (pose.poseFrame <= books.recordedFrame_)
      pose.slot = (pose.slot + 1) % books.description_.framesInFlight;
    books.markWritten(pose, handle);
    books.upload(handle);
  }
  return books.matricesOf(pose).first(pose.writtenJoints);
}

Result<std::span<float>> Scene::writePoseWeights(PoseHandle handle) {
  const Result<std::span<JointMatrix>> written = writePose(handle);
  if (!written) return written.error();
  const ScenePose& pose = books_->poses_.at(handle.index);
  const std::size_t count =
      pose.rig == notUsed ? 0 : books_->rigs_.at(pose.rig).rig->givenWeights();
  auto* const begin = reinterpret_cast<float*>(written->data() + written->size());
  return std::span<float>(begin, count);
}

Result<void> Scene::markWritten(std::span<const PoseHandle> poses) {
  SceneBooks& books = changed();
  for (const PoseHandle handle : poses) {
    if (Result<void> good = books.checkWrite(handle, true); !good) return good;
    ScenePose& pose = books.poses_.at(handle.index);
    if (pose.poseFrame != books.frame_) books.markWritten(pose, handle);
  }
  return {};
}

Result<void> Scene::markAllWritten() {
  SceneBooks& books = changed();
  for (std::uint32_t index = 0; index < books.poses_.capacity(); ++index) {
    if (!books.poses_.isUsed(index)) continue;
    const ScenePose& pose = books.poses_.at(index);
    if (!pose.writtenByGpu || pose.figure != notUsed) continue;
    const PoseHandle handle = books.poses_.handleOf(index);
    if (Result<void> marked = markWritten({&handle, 1}); !marked) return marked;
  }
  return {};
}

SceneStatistics Scene::statistics() const {
  const SceneBooks& books = *books_;
  const auto of = [](const Store& store) {
    return SceneStatistics::Store{store.ranges.capacity() * store.unitBytes,
                                  store.ranges.used() * store.unitBytes,
                                  store.ranges.largestFree() * store.unitBytes};
  };
  return {books.committed_, books.culling_, of(books.meshStore_), of(books.unitStore_),
          of(books.outputStore_)};
}

}  // namespace dermis
