// The interface of SkinningSystem, and everything that the Scene does not do.

#include "dermis/vulkan/skinning_system.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <tuple>
#include <utility>

#include "plan/plan_data.h"
#include "vulkan/system/state.h"

namespace dermis::vulkan {
namespace {

Error wrongField(const std::string& what) {
  return {ErrorCode::invalidArgument, "SkinningSystemDescription::" + what};
}

Result<void> checkRange(const char* name, const BufferRange& range, std::uint64_t unit,
                        std::uint32_t alignment) {
  if (range.buffer == VK_NULL_HANDLE) {
    if (range.offset == 0 && range.size == 0) return {};
    return wrongField(std::string(name) + " has no buffer");
  }
  if (range.size < unit || range.size % 4 != 0) {
    return wrongField(std::string(name) + " has " + std::to_string(range.size) +
                      " bytes; it needs a multiple of 4, at least " + std::to_string(unit));
  }
  if (range.offset % alignment != 0) {
    return wrongField(std::string(name) + " begins at " + std::to_string(range.offset) +
                      " bytes, not at a multiple of " + std::to_string(alignment) +
                      " (SkinningSystem::requirement)");
  }
  return {};
}

Result<void> checkRanges(const SkinningSystemDescription& description, const DeviceLimits& limits) {
  const std::uint64_t joint = sizeof(JointMatrix);
  const std::uint32_t alignment = limits.minStorageBufferOffsetAlignment;
  for (const auto& [name, range, unit, multiple] :
       {std::tuple{"meshes", &description.meshes, std::uint64_t{packedMeshAlignment}, alignment},
        {"poses.range", &description.poses.range, joint * description.framesInFlight, alignment},
        {"gpuPoses", &description.gpuPoses, joint, alignment},
        {"output", &description.output, std::uint64_t{4}, outputRangeAlignment(limits)}}) {
    if (Result<void> good = checkRange(name, *range, unit, multiple); !good) return good;
  }
  const MappedRange& poses = description.poses;
  if ((poses.range.buffer == VK_NULL_HANDLE) != (poses.mapped == nullptr))
    return wrongField("poses needs both a range and the address where it is mapped");
  return {};
}

/// The size of a range is its capacity: it does not grow.
SceneDescription sceneOf(const SkinningSystemDescription& description,
                         const ContextState& context) {
  const auto capacity = [](const Capacity& wanted, const BufferRange& range, std::uint64_t unit) {
    return range.buffer == VK_NULL_HANDLE ? wanted : Capacity::fixed(range.size / unit);
  };
  SceneDescription scene;
  scene.framesInFlight = description.framesInFlight;
  scene.meshCapacity =
      capacity(description.meshCapacity,
               {description.meshes.buffer, 0,
                description.meshes.size / packedMeshAlignment * packedMeshAlignment},
               1);
  // 0 frames in flight are refused by the scene.
  scene.jointCapacity =
      capacity(description.jointCapacity, description.poses.range,
               sizeof(JointMatrix) * std::uint64_t{std::max(description.framesInFlight, 1u)});
  scene.gpuJointCapacity =
      capacity(description.gpuJointCapacity, description.gpuPoses, sizeof(JointMatrix));
  scene.outputCapacity = capacity(description.outputCapacity, description.output, 1);
  scene.outputOffset = description.output.offset;
  scene.instanceCapacity = description.instanceCapacity;
  scene.boundsCapacity = description.boundsCapacity;
  scene.limits = context.limits;
  scene.tuning = description.tuning.value_or(context.tuning);
  return scene;
}

}  // namespace

SkinningSystem::SkinningSystem() = default;
SkinningSystem::~SkinningSystem() = default;
SkinningSystem::SkinningSystem(SkinningSystem&&) noexcept = default;
SkinningSystem& SkinningSystem::operator=(SkinningSystem&&) noexcept = default;

SkinningSystem::State::State(ContextState& contextState, Scene&& ownScene)
    : context(&contextState), scene(std::move(ownScene)) {}

SkinningSystem::State::~State() {
  context->table.destroyDescriptorPool(context->device, visibilityPool, context->allocator);
}

Result<SkinningSystem> SkinningSystem::create(const SkinningSystemDescription& description) {
  if (description.context == nullptr) return wrongField("context is null");
  if ((description.buffers.create == nullptr) != (description.buffers.destroy == nullptr))
    return wrongField("buffers needs both of its functions");
  ContextState& context = *description.context->state_;
  if (Result<void> good = checkRanges(description, context.limits); !good) return good.error();
  SceneDescription ofScene = sceneOf(description, context);
  auto self = std::make_unique<State*>(nullptr);
  ofScene.growth = {self.get(), [](void* user, const BufferGrowth& growth) {
                      return (*static_cast<State**>(user))->grow(growth);
                    }};
  Result<Scene> scene = Scene::create(ofScene);
  if (!scene) return scene.error();
  Result<SystemFunctions> functions = loadSystemFunctions(context);
  if (!functions) return functions.error();

  SkinningSystem system;
  system.state_ = std::make_unique<State>(context, std::move(*scene));
  State& state = *system.state_;
  *self = &state;
  state.self = std::move(self);
  state.functions = *functions;
  state.source.context = &context;
  state.source.callbacks = description.buffers;
  if (description.buffers.create == nullptr) {
    state.blocks = std::make_unique<MemoryBlocks>(context, state.functions);
    state.source.callbacks = state.blocks->callbacks();
  }
  state.slots.resize(description.framesInFlight);
  if (Result<void> made = state.createBuffers(description); !made) return made.error();
  if (!context.pushesDescriptors()) {
    if (Result<void> made = context.allocateSets(description.framesInFlight, state.visibilityPool,
                                                 state.visibilitySets);
        !made)
      return made.error();
  }
  if (description.measuresGpuTime) {
    if (Result<void> made =
            state.timestamps.create(context, state.functions, description.framesInFlight);
        !made)
      return made.error();
  }
  return system;
}

Result<BufferRequirement> SkinningSystem::requirement(const SkinningSystemDescription& description,
                                                      BufferRole role) {
  if (description.context == nullptr) return wrongField("context is null");
  Result<BufferRequirement> needed =
      Scene::buffer(sceneOf(description, *description.context->state_), role);
  if (needed && role == BufferRole::positions && description.output.buffer == VK_NULL_HANDLE)
    needed->usage |= description.outputUsage;
  return needed;
}

// -- Meshes, poses, instances.

Result<MeshHandle> SkinningSystem::addMesh(const PackedMesh& mesh) {
  // First, since a mesh that is removed again would keep its place until the frame is complete.
  Result<SystemBuffer> staging =
      SystemBuffer::create(state_->source, {mesh.bytes().size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT,
                                            BufferUse::upload, "dermis mesh upload"});
  if (!staging) return staging.error();
  Result<MeshHandle> handle = state_->scene.addMesh(mesh.info());
  if (!handle) return handle;
  std::memcpy(staging->bytes().data(), mesh.bytes().data(), mesh.bytes().size());
  state_->uploads.push_back({*handle, *state_->scene.meshOffset(*handle), std::move(*staging)});
  return handle;
}

Result<void> SkinningSystem::removeMesh(MeshHandle mesh) {
  Result<void> removed = state_->scene.removeMesh(mesh);
  if (removed) {
    std::erase_if(state_->uploads, [&](const MeshUpload& upload) { return upload.mesh == mesh; });
  }
  return removed;
}

Result<PoseHandle> SkinningSystem::addPose(std::uint32_t jointCount, const PoseOptions& options) {
  PoseHandle pose;
  if (Result<void> added = addPoses({&pose, 1}, jointCount, options); !added) return added.error();
  return pose;
}
Result<void> SkinningSystem::addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                                      const PoseOptions& options) {
  Result<void> added = state_->scene.addPoses(poses, jointCount, options);
  if (!added || options.writer == PoseWriter::gpu) return added;
  // No frame in flight reads their memory: it was free.
  for (const PoseHandle pose : poses)
    std::ranges::fill(state_->poseAt(*state_->scene.posePlace(pose)), JointMatrix{});
  return added;
}
Result<void> SkinningSystem::removePose(PoseHandle pose) {
  return state_->scene.removePose(pose);
}
Result<InstanceHandle> SkinningSystem::addInstance(const InstanceDescription& description) {
  return state_->scene.addInstance(description);
}
Result<void> SkinningSystem::removeInstance(InstanceHandle instance) {
  return state_->scene.removeInstance(instance);
}

Result<void> SkinningSystem::prepare(const PipelineNeeds& needs) const {
  return state_->context->prepare(needs, state_->scene.description().tuning);
}
Result<void> SkinningSystem::prepare(const InstanceDescription& instance) const {
  const Result<PipelineNeeds> needs = state_->scene.pipelineNeeds(instance);
  return needs ? prepare(*needs) : Result<void>(needs.error());
}

// -- What changes.

Result<void> SkinningSystem::beginFrame(std::uint64_t frame, std::uint64_t completedFrame) {
  if (Result<void> begun = state_->scene.beginFrame(frame, completedFrame); !begun) return begun;
  state_->retireReplaced();
  state_->frameNumber = frame;
  state_->readBackUpTo(completedFrame);
  while (!state_->retired.empty() && state_->retired.front().frame <= completedFrame)
    state_->retired.pop_front();
  return {};
}

Result<std::span<JointMatrix>> SkinningSystem::writePose(PoseHandle pose) {
  const Result<PosePlace> place = state_->scene.writePose(pose);
  if (!place) return place.error();
  return state_->poseAt(*place);
}
Result<BufferRange> SkinningSystem::poseRange(PoseHandle pose) const {
  const Result<PosePlace> place = state_->scene.posePlace(pose);
  if (!place) return place.error();
  const PoseMemory& memory = state_->poseBuffers[place->poseBuffer];
  if (memory.mapped != nullptr) {
    return Error{ErrorCode::invalidArgument,
                 "pose " + std::to_string(pose.index) + " is written by the CPU; use writePose"};
  }
  return BufferRange{memory.range.buffer, memory.range.offset + place->offset,
                     place->jointCount * sizeof(JointMatrix)};
}
Result<void> SkinningSystem::markWritten(std::span<const PoseHandle> poses) {
  return state_->scene.markWritten(poses);
}
Result<void> SkinningSystem::markAllWritten() {
  return state_->scene.markAllWritten();
}

Result<void> SkinningSystem::change(const InstanceChange& change) {
  return state_->scene.change(change);
}
Result<void> SkinningSystem::change(std::span<const InstanceChange> changes) {
  return state_->scene.change(changes);
}
Result<void> SkinningSystem::setVisibility(std::span<const InstanceVisibility> instances) {
  return state_->scene.setVisibility(instances);
}
Result<bool> SkinningSystem::isDue(InstanceHandle instance) const {
  return state_->scene.isDue(instance);
}
std::uint64_t SkinningSystem::compact(std::uint64_t maxBytes) {
  return state_->scene.compact(maxBytes);
}

Result<void> SkinningSystem::record(VkCommandBuffer commandBuffer, const FrameDescription& frame) {
  return state_->recordFrame(commandBuffer, frame);
}

Result<void> SkinningSystem::abandonFrame(std::uint64_t frame) {
  if (Result<void> abandoned = state_->scene.abandonFrame(frame); !abandoned) return abandoned;
  state_->abandonRecord();
  return {};
}

// -- Results.

VkBuffer SkinningSystem::outputBuffer() const {
  return state_->output.lastRange().buffer;
}
std::uint64_t SkinningSystem::outputGeneration() const {
  return state_->outputGeneration;
}
Result<InstanceOutput> SkinningSystem::output(InstanceHandle instance) const {
  return state_->scene.output(instance);
}
std::span<const InstanceHandle> SkinningSystem::skinnedInstances() const {
  return state_->scene.skinnedInstances();
}
std::span<const InstanceHandle> SkinningSystem::settledInstances() const {
  return state_->scene.settledInstances();
}
std::span<const InstanceHandle> SkinningSystem::movedInstances() const {
  return state_->scene.movedInstances();
}
std::uint32_t SkinningSystem::visibilityCount() const {
  return state_->scene.visibilityCount();
}
Result<std::uint32_t> SkinningSystem::visibilityIndex(InstanceHandle instance) const {
  return state_->scene.visibilityIndex(instance);
}

SystemStatistics SkinningSystem::statistics() const {
  const SceneStatistics scene = state_->scene.statistics();
  FrameStatistics lastFrame = state_->frameStatistics;
  static_cast<FrameWorkStatistics&>(lastFrame) = scene.lastFrame;
  lastFrame.uploadedBytes += scene.lastFrame.poseBytes;
  return {
      lastFrame,     state_->gpuStatistics,
      scene.meshes,  scene.palettes,
      scene.outputs, state_->blocks != nullptr ? state_->blocks->bytes() : state_->source.bytes};
}

Result<std::optional<Box>> SkinningSystem::bounds(InstanceHandle instance) const {
  return state_->scene.bounds(instance);
}

/// Reads the results of complete frames, the oldest first, before their slots are reused.
void SkinningSystem::State::readBackUpTo(std::uint64_t completedFrame) {
  std::vector<const FrameSlot*>& complete = completeScratch;
  complete.clear();
  for (const FrameSlot& frameSlot : slots) {
    if (frameSlot.frame > gpuStatistics.frame && frameSlot.frame <= completedFrame)
      complete.push_back(&frameSlot);
  }
  std::ranges::sort(complete, {}, &FrameSlot::frame);
  for (const FrameSlot* frameSlot : complete) {
    if (!scene.readBack(frameSlot->frame, frameSlot->readBack.bytes())) continue;
    gpuStatistics = {scene.statistics().lastCompletedFrame, std::nullopt};
    if (frameSlot->hasTimestamps)
      gpuStatistics.seconds =
          timestamps.seconds(static_cast<std::uint32_t>(frameSlot - slots.data()));
  }
}

}  // namespace dermis::vulkan
