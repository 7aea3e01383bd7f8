// The interface of SkinningSystem: what is not the books' is done here.

#include "dermis/vulkan/skinning_system.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "vulkan/system/state.h"

namespace dermis::vulkan {
namespace {

Error wrongField(const std::string& what) {
  return {ErrorCode::invalidArgument, "SkinningSystemDescription::" + what};
}

SceneDescription sceneOf(const SkinningSystemDescription& description,
                         const ContextState& context) {
  SceneDescription scene;
  scene.framesInFlight = description.framesInFlight;
  scene.meshBudget = description.meshBudget;
  scene.jointBudget = description.jointBudget;
  scene.outputBudget = description.output.buffer != VK_NULL_HANDLE ? description.output.size
                                                                   : description.outputBudget;
  scene.instanceBudget = description.instanceBudget;
  scene.boundsBudget = description.boundsBudget;
  scene.limits = context.limits;
  scene.tuning = description.tuning.value_or(context.tuning);
  return scene;
}

Result<void> checkOutput(const BufferRange& output, const DeviceLimits& limits) {
  if (output.buffer == VK_NULL_HANDLE) {
    if (output.offset == 0 && output.size == 0) return {};
    return wrongField("output has no buffer");
  }
  if (output.size == 0 || output.size % 4 != 0)
    return wrongField("output has " + std::to_string(output.size) + " bytes, not a multiple of 4");
  if (output.offset % limits.minStorageBufferOffsetAlignment != 0) {
    return wrongField("output begins at " + std::to_string(output.offset) +
                      " bytes, not at a multiple of minStorageBufferOffsetAlignment, " +
                      std::to_string(limits.minStorageBufferOffsetAlignment));
  }
  return {};
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

std::span<JointMatrix> SkinningSystem::State::poseAt(const PosePlace& place) {
  return {reinterpret_cast<JointMatrix*>(poses.bytes().data() + place.offset), place.jointCount};
}

Result<void> SkinningSystem::State::createBuffers(const SkinningSystemDescription& description) {
  struct Wanted {
    SystemBuffer& buffer;
    BufferRole role;
    MemoryUse use;
    const char* name;
    VkBufferUsageFlags usage = 0;  ///< besides what the scene needs
  };
  const auto create = [&](const Wanted& wanted) -> Result<void> {
    const BufferRequirement needed = scene.buffer(wanted.role);
    if (needed.size == 0) return {};
    Result<SystemBuffer> made = SystemBuffer::create(
        source, {needed.size, needed.usage | wanted.usage, wanted.use, wanted.name});
    if (!made) return made.error();
    wanted.buffer = std::move(*made);
    return {};
  };
  for (const Wanted& wanted :
       {Wanted{meshes, BufferRole::meshes, MemoryUse::device, "dermis meshes"},
        {poses, BufferRole::poses, MemoryUse::upload, "dermis poses"},
        {palettes, BufferRole::palettes, MemoryUse::device, "dermis palettes"},
        {counters, BufferRole::counters, MemoryUse::device, "dermis counters"},
        {results, BufferRole::results, MemoryUse::device, "dermis results"}}) {
    if (Result<void> made = create(wanted); !made) return made;
  }
  outputRange = description.output;
  if (outputRange.buffer == VK_NULL_HANDLE) {
    if (Result<void> made = create({output, BufferRole::positions, MemoryUse::device,
                                    "dermis output", description.outputUsage});
        !made)
      return made;
    outputRange = output.range();
  }
  for (FrameSlot& frameSlot : slots) {
    if (Result<void> made = create(
            {frameSlot.readBack, BufferRole::readBack, MemoryUse::readBack, "dermis read-back"});
        !made)
      return made;
  }
  return {};
}

Result<SkinningSystem> SkinningSystem::create(const SkinningSystemDescription& description) {
  if (description.context == nullptr) return wrongField("context is null");
  if ((description.memory.allocate == nullptr) != (description.memory.free == nullptr))
    return wrongField("memory has one of its two functions only");
  ContextState& context = *description.context->state_;
  if (Result<void> good = checkOutput(description.output, context.limits); !good)
    return good.error();
  Result<Scene> scene = Scene::create(sceneOf(description, context));
  if (!scene) return scene.error();
  Result<SystemFunctions> functions = loadSystemFunctions(context);
  if (!functions) return functions.error();

  SkinningSystem system;
  system.state_ = std::make_unique<State>(context, std::move(*scene));
  State& state = *system.state_;
  state.functions = *functions;
  state.source.context = &context;
  state.source.functions = &state.functions;
  state.source.memory = description.memory;
  if (description.memory.allocate == nullptr) {
    state.blocks = std::make_unique<MemoryBlocks>(context, state.functions);
    state.source.memory = state.blocks->callbacks();
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

// -- Meshes, poses, instances.

Result<MeshHandle> SkinningSystem::addMesh(const PackedMesh& mesh) {
  Result<MeshHandle> handle = state_->scene.addMesh(mesh.info());
  if (!handle) return handle;
  Result<SystemBuffer> staging =
      SystemBuffer::create(state_->source, {mesh.bytes().size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT,
                                            MemoryUse::upload, "dermis mesh upload"});
  if (!staging) {
    static_cast<void>(state_->scene.removeMesh(*handle).ok());
    return staging.error();
  }
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

Result<PoseHandle> SkinningSystem::addPose(std::uint32_t jointCount, bool mayScale) {
  Result<PoseHandle> added = state_->scene.addPose(jointCount, mayScale);
  if (!added) return added;
  // No frame under way reads its memory: that of a pose before it was free.
  std::ranges::fill(state_->poseAt(*state_->scene.posePlace(*added)), JointMatrix{});
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

// -- What changes.

Result<void> SkinningSystem::beginFrame(std::uint64_t frame, std::uint64_t completedFrame) {
  if (Result<void> begun = state_->scene.beginFrame(frame, completedFrame); !begun) return begun;
  state_->retireUploads();
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

Result<void> SkinningSystem::change(std::span<const InstanceChange> changes) {
  return state_->scene.change(changes);
}
Result<void> SkinningSystem::setVisible(InstanceHandle instance, bool isVisible) {
  return state_->scene.setVisible(instance, isVisible);
}
Result<void> SkinningSystem::setUpdateInterval(InstanceHandle instance, std::uint32_t interval) {
  return state_->scene.setUpdateInterval(instance, interval);
}
Result<void> SkinningSystem::teleport(InstanceHandle instance) {
  return state_->scene.teleport(instance);
}
Result<void> SkinningSystem::setMorphWeights(InstanceHandle instance,
                                             std::span<const MorphWeight> morphs) {
  return state_->scene.setMorphWeights(instance, morphs);
}
Result<void> SkinningSystem::setMesh(InstanceHandle instance, MeshHandle mesh) {
  return state_->scene.setMesh(instance, mesh);
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

// -- What came of it.

VkBuffer SkinningSystem::outputBuffer() const {
  return state_->outputRange.buffer;
}
Result<InstanceOutput> SkinningSystem::output(InstanceHandle instance) const {
  Result<InstanceOutput> output = state_->scene.output(instance);
  if (!output || output->size == 0) return output;
  const VkDeviceSize begin = state_->outputRange.offset;
  output->offset += begin;
  for (OutputAttribute* attribute :
       {&output->positions, &output->normals, &output->tangents, &output->previousPositions}) {
    if (attribute->format != VertexFormat::none) attribute->offset += begin;
  }
  return output;
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
std::uint32_t SkinningSystem::instanceCapacity() const {
  return state_->scene.description().instanceBudget;
}
Result<std::uint32_t> SkinningSystem::visibilityIndex(InstanceHandle instance) const {
  return state_->scene.visibilityIndex(instance);
}

SystemStatistics SkinningSystem::statistics() const {
  const SceneStatistics scene = state_->scene.statistics();
  return {state_->frameStatistics, state_->gpuStatistics, scene.meshes,
          scene.palettes,          scene.outputs,         state_->source.allocatedBytes};
}

Result<std::optional<Box>> SkinningSystem::bounds(InstanceHandle instance) const {
  return state_->scene.bounds(instance);
}

/// Slots are used again soon: what is in those of complete frames is read, the oldest first.
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
