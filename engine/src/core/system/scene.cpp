// The interface of Scene, and the checks of its description.

#include "dermis/scene.h"

#include <array>
#include <string>
#include <utility>

#include "plan/check.h"
#include "system/books.h"

namespace dermis {
namespace {

Result<void> checkDescription(const SceneDescription& description) {
  for (const auto& [field, value] :
       {std::pair{"framesInFlight", std::uint64_t{description.framesInFlight}},
        {"meshBudget", description.meshBudget},
        {"jointBudget", description.jointBudget},
        {"outputBudget", description.outputBudget},
        {"instanceBudget", description.instanceBudget}}) {
    if (value == 0) return invalid(std::string("the scene's ") + field + " is 0");
  }
  if (Result<void> good = checkLimits(description.limits); !good) return good;
  const std::uint64_t most = description.limits.maxStorageBufferRange;
  // Their product, in bytes, might not fit 64 bits.
  if (description.framesInFlight > most / sizeof(JointMatrix) / description.jointBudget) {
    return Error{ErrorCode::limitExceeded,
                 "the joint matrices of the scene's jointBudget, for each of framesInFlight, take "
                 "more than this device's storage buffer range of " +
                     std::to_string(most) + " bytes"};
  }
  const PlanSizes sizes = sceneSizes(description);
  for (const auto& [field, role] : {std::pair{"meshBudget", BufferRole::meshes},
                                    {"jointBudget (palettes)", BufferRole::palettes},
                                    {"boundsBudget", BufferRole::results},
                                    {"instanceBudget", BufferRole::history}}) {
    const std::uint64_t bytes = sizes.requirement(role, 0, description.limits).size;
    if (bytes <= most) continue;
    return Error{
        ErrorCode::limitExceeded,
        std::string("the scene's ") + field + " makes a buffer of " + std::to_string(bytes) +
            " bytes, more than this device's storage buffer range of " + std::to_string(most)};
  }
  return checkTuning(description.tuning);
}

/// Rounds down if the next multiple does not fit 64 bits.
std::uint64_t roundUp(std::uint64_t value, std::uint64_t multiple) {
  const std::uint64_t up = value % multiple == 0 ? 0 : multiple - value % multiple;
  return up <= ~value ? value + up : value / multiple * multiple;
}

}  // namespace

Scene::Scene(const SceneDescription& description)
    : books_(std::make_unique<SceneBooks>(description)) {}
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

Result<Scene> Scene::create(const SceneDescription& description) {
  SceneDescription rounded = description;
  rounded.meshBudget = roundUp(description.meshBudget, packedMeshAlignment);
  rounded.outputBudget = roundUp(description.outputBudget, 4);
  if (description.limits.maxStorageBuffersPerStage < storageBuffersWanted)
    rounded.boundsBudget = 0;  // there are no results
  if (Result<void> good = checkDescription(rounded); !good) return good.error();
  return Scene(rounded);
}

BufferRequirement Scene::buffer(BufferRole role) const {
  return sceneSizes(description()).requirement(role, 0, description().limits);
}
const SceneDescription& Scene::description() const {
  return books_->description();
}

SceneBooks& Scene::change() {
  books_->unplan();
  return *books_;
}

// -- Meshes, poses, instances.

Result<MeshHandle> Scene::addMesh(const MeshInfo& info) {
  return change().addMesh(info);
}
Result<std::uint64_t> Scene::meshOffset(MeshHandle handle) const {
  const SceneMesh* mesh = books_->meshes().find(handle);
  if (mesh == nullptr) return unknownHandle("mesh", handle);
  return mesh->bytes.offset;
}
Result<void> Scene::removeMesh(MeshHandle mesh) {
  return change().removeMesh(mesh);
}
Result<PoseHandle> Scene::addPose(std::uint32_t jointCount, bool mayScale) {
  return change().addPose(jointCount, mayScale);
}
Result<PosePlace> Scene::posePlace(PoseHandle handle) const {
  const ScenePose* pose = books_->poses().find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  return PosePlace{books_->poseOffset(*pose), pose->jointCount};
}
Result<void> Scene::removePose(PoseHandle pose) {
  return change().removePose(pose);
}
Result<InstanceHandle> Scene::addInstance(const InstanceDescription& description) {
  return change().addInstance(description);
}
Result<void> Scene::removeInstance(InstanceHandle instance) {
  return change().removeInstance(instance);
}

// -- What changes.

Result<void> Scene::beginFrame(std::uint64_t frame, std::uint64_t completedFrame) {
  return change().beginFrame(frame, completedFrame);
}
Result<PosePlace> Scene::writePose(PoseHandle pose) {
  const Result<std::uint64_t> offset = change().writePose(pose);
  if (!offset) return offset.error();
  return PosePlace{*offset, books_->poses().find(pose)->jointCount};
}
Result<void> Scene::change(std::span<const InstanceChange> changes) {
  return change().change(changes);
}
Result<void> Scene::setVisible(InstanceHandle instance, bool isVisible) {
  return change().setVisible(instance, isVisible);
}
Result<void> Scene::setUpdateInterval(InstanceHandle instance, std::uint32_t interval) {
  return change().setUpdateInterval(instance, interval);
}
Result<void> Scene::teleport(InstanceHandle instance) {
  return change().teleport(instance);
}
Result<void> Scene::setMorphWeights(InstanceHandle instance, std::span<const MorphWeight> morphs) {
  return change().setMorphWeights(instance, morphs);
}
Result<void> Scene::setMesh(InstanceHandle instance, MeshHandle mesh) {
  return change().setMesh(instance, mesh);
}
std::uint64_t Scene::compact(std::uint64_t maxBytes) {
  return change().compact(maxBytes);
}

// -- Frames.

Result<void> Scene::plan(Plan& out) {
  return books_->plan(out);
}
Result<void> Scene::commit() {
  return books_->commit();
}
Result<void> Scene::abandonFrame(std::uint64_t frame) {
  return books_->abandonFrame(frame);
}
Result<void> Scene::readBack(std::uint64_t frame, std::span<const std::byte> bytes) {
  return books_->readBack(frame, bytes);
}

// -- Results.

Result<InstanceOutput> Scene::output(InstanceHandle instance) const {
  return books_->output(instance);
}
std::span<const InstanceHandle> Scene::skinnedInstances() const {
  return books_->skinned();
}
std::span<const InstanceHandle> Scene::settledInstances() const {
  return books_->settled();
}
std::span<const InstanceHandle> Scene::movedInstances() const {
  return books_->moved();
}
Result<std::optional<Box>> Scene::bounds(InstanceHandle instance) const {
  return books_->bounds(instance);
}
Result<std::uint32_t> Scene::visibilityIndex(InstanceHandle instance) const {
  if (books_->instances().find(instance) == nullptr) return unknownHandle("instance", instance);
  return instance.index;
}
SceneStatistics Scene::statistics() const {
  return books_->statistics();
}

}  // namespace dermis
