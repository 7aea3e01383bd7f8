// Rigs: joints and weights that the scene computes from the joints of poses.

#include <string>
#include <utility>

#include "rig/blob.h"
#include "scene/books.h"
#include "scene/slot_map.h"
#include "strict_floating_point.h"

namespace dermis {

Result<RigHandle> Scene::addRig(PackedRig rig) {
  SceneBooks& books = changed();
  Range bytes;
  if (!books.owner_.isCpu) {
    const std::uint64_t size = rig.bytes().size();
    const Result<std::optional<Range>> found =
        books.take(books.meshStore_, size, packedMeshAlignment);
    if (!found) return found.error();
    if (!*found) {
      return SceneBooks::noRoom("the rig takes " + std::to_string(size) + " bytes",
                                books.meshStore_, "bytes of meshes, clips and rigs");
    }
    bytes = **found;
  }
  const RigHandle handle =
      books.rigs_.add({std::make_unique<const PackedRig>(std::move(rig)), bytes, 0});
  if (!books.owner_.isCpu) books.rigUploads_.push_back(handle);
  return handle;
}

Result<void> Scene::removeRig(RigHandle handle) {
  SceneBooks& books = changed();
  const SceneRig* rig = books.rigs_.find(handle);
  if (rig == nullptr) return unknownHandle("rig", handle);
  if (rig->users != 0) return isUsed("rig", handle.index, rig->users, "pose");
  if (!books.owner_.isCpu) books.retire(books.meshStore_.ranges, rig->bytes);
  books.rigs_.remove(handle);
  return {};
}

/// Takes memory for what a rig drives, if there is one, and counts the pose among its users.
Result<void> SceneBooks::takeDriven(ScenePose& pose, std::uint32_t rig) {
  if (rig == notUsed) return {};
  const RigHeader header = RigBlob(*rigs_.at(rig).rig).header;
  const std::uint64_t weights = std::uint64_t{header.givenWeights} + header.drivenWeights;
  // Kernels also keep a unit for each input of a corrective there, and a word for each example.
  const std::uint64_t ofCorrective =
      header.mostInputs == 0 ? 0 : 4ull * header.mostInputs + maxRigExamples;
  const std::uint64_t words = owner_.isCpu ? weights : weights + 3 + ofCorrective;
  const std::uint64_t joints =
      header.drivenJoints + jointsFor(words) + (owner_.isCpu ? header.writtenJoints : 0);
  const Result<std::optional<Range>> taken = takeJoints(joints, !owner_.isCpu, pose.drivenBuffer);
  if (!taken) return taken.error();
  if (!*taken) return noJoints(1, joints, !owner_.isCpu);
  pose.driven = **taken;
  ++rigs_.at(rig).users;
  return {};
}

void SceneBooks::releaseDriven(const ScenePose& pose, bool isNew) {
  if (pose.rig == notUsed) return;
  giveBack(poseBuffers_[pose.drivenBuffer].joints, pose.driven, isNew);
  --rigs_.at(pose.rig).users;
}

Result<BufferPart> SceneBooks::drivenPart(PoseHandle handle) const {
  const ScenePose* pose = poses_.find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  if (pose->rig == notUsed) return invalid("pose " + std::to_string(handle.index) + " has no rig");
  const PackedRig& rig = *rigs_.at(pose->rig).rig;
  const std::uint64_t weights = std::uint64_t{rig.givenWeights()} + rig.drivenWeights();
  return BufferPart{poseBuffers_[pose->drivenBuffer].buffer.number,
                    pose->driven.offset * sizeof(JointMatrix),
                    rig.drivenJoints() * sizeof(JointMatrix) + weights * sizeof(float)};
}

/// In 32-bit words of the buffer of driven joints of a GPU.
std::uint64_t SceneBooks::drivenWord(const ScenePose& pose, std::uint32_t weight) const {
  const std::uint64_t driven = rigs_.at(pose.rig).rig->drivenJoints();
  return (pose.driven.offset + driven) * (sizeof(JointMatrix) / sizeof(float)) + weight;
}

/// The number of morph targets of an instance that the rig of its pose drives.
std::uint32_t SceneBooks::drivenTargetsOf(const SceneInstance& instance) const {
  return poses_.at(instance.pose).rig != notUsed ? instance.drivenTargets : 0;
}

/// For an instance that is skinned with the pose. `figure`: the place of the figure that samples
/// the pose in this plan, or `notUsed`.
void SceneBooks::driveRig(std::uint32_t index, std::uint32_t figure) {
  ScenePose& pose = poses_.at(index);
  if (pose.drivenPlan == planNumber_) return;
  pose.drivenPlan = planNumber_;
  driving_.push_back(index);
  if (owner_.isCpu) return;
  const SceneRig& rig = rigs_.at(pose.rig);
  abi::RigRecord record{};
  record.joints = static_cast<std::uint32_t>(offsetOf(pose) / unitBytes);
  record.driven = static_cast<std::uint32_t>(pose.driven.offset) * abi::UNITS_OF_MATRIX;
  if (figure != notUsed && rig.rig->givenWeights() != 0) {
    const SceneClips& clips = clips_.at(figures_.at(pose.figure).clips.index);
    const ClipBank bank(clips.content->bank);
    const std::optional<BankMorphed> node = bank.morphedNode(rig.rig->weightsOf());
    const auto words = static_cast<std::uint32_t>(clips.bytes.offset / 4);
    record.clips = words;
    record.weights = words + node->rest;
    record.track = 3 * bank.header.nodeCount + node->firstGroup;
    record.masks = words + node->masks;
  }
  const PoseSource source{record.joints,
                          pose.buffer,
                          pose.writtenByGpu ? BufferRole::gpuPoses : BufferRole::poses,
                          pose.drivenBuffer,
                          record.driven,
                          pose.writtenJoints};
  work_.addRig(static_cast<std::uint32_t>(rig.bytes.offset / 4), source, record, figure);
}

}  // namespace dermis
