// The interface of SkinningSystem: what is not the books' is done here.

#include "dermis/vulkan/skinning_system.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "abi.h"
#include "plan/check.h"
#include "vulkan/system/state.h"

namespace dermis::vulkan {
namespace {

Error wrongField(const std::string& what) {
  return {ErrorCode::invalidArgument, "SkinningSystemDescription::" + what};
}

Error tooLarge(const char* field, std::uint64_t bytes, const DeviceLimits& limits) {
  return {ErrorCode::limitExceeded, std::string("SkinningSystemDescription::") + field +
                                        " makes a buffer of " + std::to_string(bytes) +
                                        " bytes, more than this device's storage buffer range of " +
                                        std::to_string(limits.maxStorageBufferRange)};
}

Result<void> checkBudgets(const SkinningSystemDescription& description,
                          const SceneDescription& scene) {
  const DeviceLimits& limits = scene.limits;
  if (description.framesInFlight == 0) return wrongField("framesInFlight is 0");
  if (description.meshBudget == 0) return wrongField("meshBudget is 0");
  if (description.jointBudget == 0) return wrongField("jointBudget is 0");
  if (description.outputBudget == 0) return wrongField("outputBudget is 0");
  if (description.instanceBudget == 0) return wrongField("instanceBudget is 0");
  if ((description.memory.allocate == nullptr) != (description.memory.free == nullptr))
    return wrongField("memory has one of its two functions only");
  for (const auto& [field, bytes] :
       {std::pair{"framesInFlight", description.framesInFlight * sizeof(JointMatrix)},
        {"meshBudget", scene.meshBudget},
        {"jointBudget (matrices)", scene.matricesSize()},
        {"jointBudget (palettes)", scene.palettesSize()},
        {"boundsBudget", scene.resultsSize()},
        {"instanceBudget", std::uint64_t{scene.instanceBudget} * sizeof(abi::HistoryRecord)}}) {
    if (bytes > limits.maxStorageBufferRange) return tooLarge(field, bytes, limits);
  }
  if (Result<void> good = checkLimits(limits); !good) return good;
  return checkTuning(scene.tuning);
}

/// The largest multiple that there is, if the next one is larger.
std::uint64_t roundUp(std::uint64_t value, std::uint64_t multiple) {
  const std::uint64_t up = value % multiple == 0 ? 0 : multiple - value % multiple;
  return up <= ~value ? value + up : value / multiple * multiple;
}

SceneDescription sceneOf(const SkinningSystemDescription& description,
                         const ContextState& context) {
  const DeviceLimits& limits = context.limits;
  SceneDescription scene;
  scene.framesInFlight = description.framesInFlight;
  scene.meshBudget = roundUp(description.meshBudget, packedMeshAlignment);
  scene.jointBudget = description.jointBudget;
  scene.outputBudget = roundUp(description.outputBudget, 4);
  scene.instanceBudget = description.instanceBudget;
  scene.boundsBudget =
      limits.maxStorageBuffersPerStage < storageBuffersWanted ? 0 : description.boundsBudget;
  scene.limits = limits;
  scene.tuning = description.tuning.value_or(context.tuning);
  return scene;
}

}  // namespace

SkinningSystem::SkinningSystem() = default;
SkinningSystem::~SkinningSystem() = default;
SkinningSystem::SkinningSystem(SkinningSystem&&) noexcept = default;
SkinningSystem& SkinningSystem::operator=(SkinningSystem&&) noexcept = default;

SkinningSystem::State::State(ContextState& contextState, const SceneDescription& sceneDescription)
    : context(&contextState), scene(sceneDescription) {}

/// Of what kernels read, through texel buffers where the device has them.
VkBufferUsageFlags SkinningSystem::State::readUsage() const {
  return VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
         (context->limits.texelBuffers ? VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT : 0);
}

std::span<JointMatrix> SkinningSystem::State::poseAt(std::uint64_t offset,
                                                     std::uint32_t jointCount) {
  return {reinterpret_cast<JointMatrix*>(matrices.bytes().data() + offset), jointCount};
}

Result<void> SkinningSystem::State::createBuffers(VkBufferUsageFlags outputUsage) {
  const VkBufferUsageFlags read = readUsage();
  constexpr VkBufferUsageFlags storage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
  constexpr VkBufferUsageFlags to = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  constexpr VkBufferUsageFlags from = VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
  const SceneDescription& sizes = scene.description();
  struct Wanted {
    SystemBuffer* buffer;
    SystemBuffer::Description description;
  };
  for (const Wanted& wanted :
       {Wanted{&meshes, {sizes.meshBudget, read | to, MemoryUse::device, "dermis meshes"}},
        {&matrices, {sizes.matricesSize(), read, MemoryUse::upload, "dermis matrices"}},
        {&palettes, {sizes.palettesSize(), read, MemoryUse::device, "dermis palettes"}},
        {&output,
         {sizes.outputBudget, storage | to | from | outputUsage, MemoryUse::device,
          "dermis output"}},
        {&counters,
         {sizeof(abi::CounterRecord), storage | to | from, MemoryUse::device, "dermis counters"}},
        {&results, {sizes.resultsSize(), storage | from, MemoryUse::device, "dermis results"}}}) {
    if (wanted.description.size == 0) continue;
    Result<SystemBuffer> made = SystemBuffer::create(source, wanted.description);
    if (!made) return made.error();
    *wanted.buffer = std::move(*made);
  }
  for (FrameSlot& frameSlot : slots) {
    Result<SystemBuffer> made =
        SystemBuffer::create(source, {sizeof(abi::CounterRecord) + sizes.resultsSize(), to,
                                      MemoryUse::readBack, "dermis read-back"});
    if (!made) return made.error();
    frameSlot.readBack = std::move(*made);
  }
  return {};
}

Result<SkinningSystem> SkinningSystem::create(const SkinningSystemDescription& description) {
  if (description.context == nullptr) return wrongField("context is null");
  ContextState& context = *description.context->state_;
  const SceneDescription scene = sceneOf(description, context);
  if (Result<void> good = checkBudgets(description, scene); !good) return good.error();
  Result<SystemFunctions> functions = loadSystemFunctions(context);
  if (!functions) return functions.error();

  SkinningSystem system;
  system.state_ = std::make_unique<State>(context, scene);
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
  if (Result<void> made = state.createBuffers(description.outputUsage); !made) return made.error();
  if (description.measuresGpuTime) {
    if (Result<void> made =
            state.timestamps.create(context, state.functions, description.framesInFlight);
        !made)
      return made.error();
  }
  return system;
}

// -- Meshes, palettes, instances.

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
  state_->uploads.push_back({*handle, std::move(*staging)});
  return handle;
}

Result<void> SkinningSystem::removeMesh(MeshHandle mesh) {
  Result<void> removed = state_->scene.removeMesh(mesh);
  if (removed) {
    std::erase_if(state_->uploads, [&](const MeshUpload& upload) { return upload.mesh == mesh; });
  }
  return removed;
}

Result<PaletteHandle> SkinningSystem::addPalette(std::uint32_t jointCount, bool mayScale) {
  Result<PaletteHandle> added = state_->scene.addPalette(jointCount, mayScale);
  if (!added) return added;
  // No frame under way reads its memory: that of a palette before it was free.
  const ScenePalette& palette = *state_->scene.palettes().find(*added);
  std::ranges::fill(state_->poseAt(state_->scene.poseOffset(palette), jointCount), JointMatrix{});
  return added;
}
Result<void> SkinningSystem::removePalette(PaletteHandle palette) {
  return state_->scene.removePalette(palette);
}
Result<InstanceHandle> SkinningSystem::addInstance(const InstanceDescription& description) {
  return state_->scene.addInstance(description);
}
Result<void> SkinningSystem::removeInstance(InstanceHandle instance) {
  return state_->scene.removeInstance(instance);
}

Result<void> SkinningSystem::prepare(const InstanceDescription& description) const {
  Job job;
  const Result<LaidOutVertices> laidOut = layOut(description.layout, 1);
  if (!laidOut) return laidOut.error();
  job.method = description.method;
  job.positions = laidOut->attributes[0];
  job.normals = laidOut->attributes[1];
  job.tangents = laidOut->attributes[2];
  job.previousPositions = laidOut->attributes[3];
  job.motion = description.layout.previousPositions ? Motion::kept : Motion::none;
  job.bounds = description.bounds;
  for (const Variant& variant :
       everyVariant(job, state_->context->limits, state_->scene.description().tuning)) {
    if (Result<void> built =
            state_->context->pipelines->build(variant, state_->context->pipelineLayout);
        !built)
      return built;
  }
  return description.culledOnGpu ? state_->prepareVisibility() : Result<void>();
}

// -- What changes.

Result<void> SkinningSystem::beginFrame(std::uint64_t frame, std::uint64_t completedFrame) {
  if (Result<void> begun = state_->scene.beginFrame(frame, completedFrame); !begun) return begun;
  state_->readBackUpTo(completedFrame);
  while (!state_->retired.empty() && state_->retired.front().frame <= completedFrame)
    state_->retired.pop_front();
  return {};
}

Result<std::span<JointMatrix>> SkinningSystem::writePose(PaletteHandle palette) {
  const Result<std::uint64_t> offset = state_->scene.writePose(palette);
  if (!offset) return offset.error();
  return state_->poseAt(*offset, state_->scene.palettes().find(palette)->jointCount);
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

// -- What came of it.

VkBuffer SkinningSystem::outputBuffer() const {
  return state_->output.handle();
}
Result<InstanceOutput> SkinningSystem::output(InstanceHandle instance) const {
  return state_->scene.output(instance);
}
std::span<const InstanceHandle> SkinningSystem::skinnedInstances() const {
  return state_->scene.skinned();
}
std::span<const InstanceHandle> SkinningSystem::settledInstances() const {
  return state_->scene.settled();
}
std::span<const InstanceHandle> SkinningSystem::movedInstances() const {
  return state_->scene.moved();
}
std::uint32_t SkinningSystem::instanceCapacity() const {
  return state_->scene.description().instanceBudget;
}
Result<std::uint32_t> SkinningSystem::visibilityIndex(InstanceHandle instance) const {
  const Result<InstanceOutput> known = state_->scene.output(instance);
  if (!known) return known.error();
  return instance.index;
}

SystemStatistics SkinningSystem::statistics() const {
  const auto storeOf = [](const RangeAllocator& store, std::uint64_t unit) {
    return StoreStatistics{store.capacity() * unit, store.used() * unit,
                           store.largestFree() * unit};
  };
  SystemStatistics statistics;
  statistics.lastFrame = state_->frameStatistics;
  statistics.lastCompletedFrame = state_->gpuStatistics;
  statistics.meshes = storeOf(state_->scene.meshStore(), 1);
  statistics.palettes = storeOf(state_->scene.unitStore(), unitBytes);
  statistics.outputs = storeOf(state_->scene.outputStore(), 1);
  statistics.deviceMemory = state_->source.allocatedBytes;
  return statistics;
}

/// Slots are used again soon: what is in those of complete frames is copied, the oldest first.
void SkinningSystem::State::readBackUpTo(std::uint64_t completedFrame) {
  std::vector<const FrameSlot*>& complete = completeScratch;
  complete.clear();
  for (const FrameSlot& slot : slots) {
    if (slot.frame > gpuStatistics.frame && slot.frame <= completedFrame) complete.push_back(&slot);
  }
  std::ranges::sort(complete, {}, &FrameSlot::frame);
  for (const FrameSlot* slot : complete) readResults(*slot);
  if (!complete.empty()) readStatistics(*complete.back());
}

/// A frame that found nothing out about an instance does not take away what an earlier one did.
void SkinningSystem::State::readResults(const FrameSlot& slot) {
  if (slot.results.empty()) return;
  latestResultsFrame = slot.frame;
  for (const VkBufferCopy& region : slot.results) {
    const std::size_t first = region.srcOffset / sizeof(InstanceResult);
    const std::size_t count = region.size / sizeof(InstanceResult);
    latestResults.resize(std::max(latestResults.size(), first + count));
    std::memcpy(&latestResults[first], slot.readBack.bytes().data() + region.dstOffset,
                region.size);
  }
}

void SkinningSystem::State::readStatistics(const FrameSlot& slot) {
  gpuStatistics = {};
  gpuStatistics.frame = slot.frame;
  if (slot.hasTimestamps)
    gpuStatistics.seconds = timestamps.seconds(static_cast<std::uint32_t>(&slot - slots.data()));
  if (!slot.hasCounters) return;
  abi::CounterRecord counted;
  std::memcpy(&counted, slot.readBack.bytes().data(), sizeof(counted));
  gpuStatistics.visibleInstances = counted.visible;
  gpuStatistics.skinnedInstances = counted.skinned;
  gpuStatistics.settledInstances = counted.settled;
  gpuStatistics.workgroups = counted.workgroups;
}

Result<std::optional<Box>> SkinningSystem::bounds(InstanceHandle handle) const {
  const Result<InstanceOutput> known = state_->scene.output(handle);
  if (!known) return known.error();
  const SceneInstance& instance = *state_->scene.instances().find(handle);
  if (!instance.bounds || instance.firstFrame == 0 ||
      instance.firstFrame > state_->latestResultsFrame)
    return std::optional<Box>();
  return state_->latestResults[instance.extras.result].box();
}

}  // namespace dermis::vulkan
