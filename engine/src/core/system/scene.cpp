// The interface of Scene, and the checks of its description.

#include "dermis/scene.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "plan/check.h"
#include "system/books.h"

namespace dermis {
namespace {

Result<void> checkDescription(const SceneDescription& description) {
  if (description.framesInFlight == 0)
    return invalid("the scene's framesInFlight is 0; the minimum is 1");
  if (Result<void> good = checkLimits(description.limits); !good) return good;
  const std::uint64_t range = description.limits.maxStorageBufferRange;
  constexpr std::uint64_t anySize = ~std::uint64_t{0};
  struct Field {
    const char* name;
    const Capacity& capacity;
    std::uint64_t most;  ///< at first
    bool mayBeNone = false;
  };
  for (const Field& field :
       {Field{"meshCapacity", description.meshCapacity, range},
        {"jointCapacity (for each of framesInFlight)", description.jointCapacity,
         range / sizeof(JointMatrix) / description.framesInFlight, true},
        {"gpuJointCapacity", description.gpuJointCapacity, range / sizeof(JointMatrix), true},
        {"outputCapacity", description.outputCapacity, anySize},
        {"instanceCapacity", description.instanceCapacity, range / sizeof(abi::HistoryRecord)},
        {"boundsCapacity", description.boundsCapacity, range / sizeof(InstanceResult), true}}) {
    const Capacity& capacity = field.capacity;
    if (capacity.maximum == 0 && !field.mayBeNone)
      return invalid(std::string("the scene's ") + field.name + " has a maximum of 0");
    if (capacity.maximum < capacity.initial) {
      return invalid(std::string("the scene's ") + field.name + " is " +
                     std::to_string(capacity.initial) + " initially, more than its maximum of " +
                     std::to_string(capacity.maximum));
    }
    if (capacity.initial <= field.most) continue;
    return Error{
        ErrorCode::limitExceeded,
        std::string("the scene's ") + field.name + " of " + std::to_string(capacity.initial) +
            " needs a buffer larger than this device's storage buffer range of " +
            std::to_string(range) + " bytes; the maximum is " + std::to_string(field.most)};
  }
  const std::uint32_t alignment = outputRangeAlignment(description.limits);
  if (description.outputOffset % alignment != 0)
    return notAMultiple("the scene's outputOffset", description.outputOffset, alignment);
  if (description.outputOffset > anySize / 2) {
    return invalid("the scene's outputOffset of " + std::to_string(description.outputOffset) +
                   " is larger than the maximum, " + std::to_string(anySize / 2));
  }
  return checkTuning(description.tuning);
}

/// Rounds down if the next multiple does not fit 64 bits.
std::uint64_t roundUp(std::uint64_t value, std::uint64_t multiple) {
  const std::uint64_t up = value % multiple == 0 ? 0 : multiple - value % multiple;
  return up <= ~value ? value + up : value / multiple * multiple;
}

SceneDescription rounded(SceneDescription description) {
  const auto round = [](Capacity& capacity, std::uint64_t multiple) {
    if (capacity.maximum < capacity.initial) return;  // to be refused
    capacity.initial = roundUp(capacity.initial, multiple);
    capacity.maximum = std::max(capacity.maximum / multiple * multiple, capacity.initial);
  };
  round(description.meshCapacity, packedMeshAlignment);
  round(description.outputCapacity, 4);
  // There are no results.
  if (description.limits.maxStorageBuffersPerStage < storageBuffersWanted)
    description.boundsCapacity = Capacity::fixed(0);
  return description;
}

}  // namespace

Scene::Scene(const SceneDescription& description)
    : books_(std::make_unique<SceneBooks>(description)) {}
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

Result<Scene> Scene::create(const SceneDescription& description) {
  const SceneDescription usual = rounded(description);
  if (Result<void> good = checkDescription(usual); !good) return good.error();
  return Scene(usual);
}

BufferRequirement Scene::buffer(BufferRole role) const {
  return books_->sizes().requirement(role, 0, description().limits);
}
Result<BufferRequirement> Scene::buffer(const SceneDescription& description, BufferRole role) {
  const SceneDescription usual = rounded(description);
  if (Result<void> good = checkDescription(usual); !good) return good.error();
  if (static_cast<std::size_t>(role) >= bufferRoleCount)
    return notAValue("the role of the buffer", role, "BufferRole");
  return sceneSizes(usual).requirement(role, 0, usual.limits);
}
std::uint32_t Scene::poseBufferCount() const {
  return books_->poseBufferCount();
}
PoseBuffer Scene::poseBuffer(std::uint32_t number) const {
  return books_->poseBuffer(number);
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
Result<PoseHandle> Scene::addPose(std::uint32_t jointCount, const PoseOptions& options) {
  PoseHandle pose;
  if (Result<void> added = addPoses({&pose, 1}, jointCount, options); !added) return added.error();
  return pose;
}
Result<void> Scene::addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                             const PoseOptions& options) {
  return change().addPoses(poses, jointCount, options);
}
Result<PosePlace> Scene::posePlace(PoseHandle handle) const {
  const ScenePose* pose = books_->poses().find(handle);
  if (pose == nullptr) return unknownHandle("pose", handle);
  return SceneBooks::placeOf(*pose);
}
Result<void> Scene::removePose(PoseHandle pose) {
  return change().removePose(pose);
}
Result<PipelineNeeds> Scene::pipelineNeeds(const InstanceDescription& description) const {
  const SceneMesh* mesh = books_->meshes().find(description.mesh);
  if (mesh == nullptr) return unknownHandle("mesh", description.mesh);
  const ScenePose* pose = books_->poses().find(description.pose);
  if (pose == nullptr) return unknownHandle("pose", description.pose);
  PipelineNeeds needs = dermis::pipelineNeeds(description);
  if (const Result<VertexPlaces> good = checkNeeds(needs); !good) return good.error();
  needs.mesh = mesh->info;
  needs.mayScale = pose->mayScale;
  return needs;
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
  return change().writePose(pose);
}
Result<void> Scene::markWritten(std::span<const PoseHandle> poses) {
  return change().markWritten(poses);
}
Result<void> Scene::markAllWritten() {
  return change().markAllWritten();
}
Result<void> Scene::change(const InstanceChange& change) {
  return this->change().change(change);
}
Result<void> Scene::change(std::span<const InstanceChange> changes) {
  return change().change(changes);
}
Result<void> Scene::setVisibility(std::span<const InstanceVisibility> instances) {
  return change().setVisibility(instances);
}
Result<bool> Scene::isDue(InstanceHandle instance) const {
  return books_->isDue(instance);
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
std::uint32_t Scene::visibilityCount() const {
  return books_->sizes().slots;
}
SceneStatistics Scene::statistics() const {
  return books_->statistics();
}

}  // namespace dermis
