// The interface of SceneRecorder, except `record`.

#include "dermis/vulkan/scene_recorder.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <tuple>
#include <utility>

#include "plan/check.h"
#include "vulkan/recorder/state.h"

namespace dermis::vulkan {
namespace {

Error wrongField(const std::string& what) {
  return {ErrorCode::invalidArgument, "SceneRecorderDescription::" + what};
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
                      " (SceneRecorder::requirement)");
  }
  return {};
}

Result<void> checkRanges(const SceneRecorderDescription& description, const DeviceLimits& limits) {
  const std::uint64_t joint = sizeof(JointMatrix);
  const std::uint32_t alignment = limits.minStorageBufferOffsetAlignment;
  for (const auto& [name, range, unit, multiple] :
       {std::tuple{"meshes", &description.meshes, std::uint64_t{packedMeshAlignment}, alignment},
        {"poses", &description.poses, joint * description.scene.framesInFlight, alignment},
        {"gpuPoses", &description.gpuPoses, joint, alignment},
        {"output", &description.output, std::uint64_t{4}, outputRangeAlignment(limits)}}) {
    if (Result<void> good = checkRange(name, *range, unit, multiple); !good) return good;
  }
  if ((description.poses.buffer == VK_NULL_HANDLE) != (description.mappedPoses == nullptr))
    return wrongField("poses and mappedPoses must both be set, or neither");
  return {};
}

/// The size of a range is its capacity: it does not grow.
SceneSetup setupOf(const SceneRecorderDescription& description, const ContextState& context) {
  const auto fix = [](Capacity& capacity, const BufferRange& range, std::uint64_t unit,
                      std::uint64_t multiple) {
    if (range.buffer != VK_NULL_HANDLE)
      capacity = Capacity::fixed(range.size / multiple * multiple / unit);
  };
  SceneSetup setup{description.scene, context.limits, description.tuning.value_or(context.tuning),
                   description.output.offset};
  constexpr std::uint64_t joint = sizeof(JointMatrix);
  // 0 frames in flight are refused by the scene.
  const std::uint64_t slots = std::max(setup.scene.framesInFlight, 1u);
  fix(setup.scene.meshCapacity, description.meshes, 1, packedMeshAlignment);
  fix(setup.scene.jointCapacity, description.poses, joint * slots, 1);
  fix(setup.scene.gpuJointCapacity, description.gpuPoses, joint, 1);
  fix(setup.scene.outputCapacity, description.output, 1, 1);
  return setup;
}

}  // namespace

SceneRecorder::SceneRecorder() = default;
SceneRecorder::~SceneRecorder() = default;
SceneRecorder::SceneRecorder(SceneRecorder&&) noexcept = default;
SceneRecorder& SceneRecorder::operator=(SceneRecorder&&) noexcept = default;

SceneRecorder::State::~State() {
  for (BoundBuffer& buffer : bound) destroyTexelView(*context, buffer);
}

Result<SceneRecorder> SceneRecorder::create(const Context& lent,
                                            const SceneRecorderDescription& description) {
  if ((description.buffers.create == nullptr) != (description.buffers.destroy == nullptr))
    return wrongField("buffers needs both of its functions");
  const ContextState& context = *lent.state_;
  if (Result<void> good = checkRanges(description, context.limits); !good) return good.error();
  // Before anything is created.
  const SceneSetup setup = setupOf(description, context);
  if (Result<void> good = checkSetup(rounded(setup)); !good) return good.error();
  Result<SystemFunctions> functions = loadSystemFunctions(context);
  if (!functions) return functions.error();

  SceneRecorder recorder;
  recorder.state_ = std::make_unique<State>(context, description);
  State& state = *recorder.state_;
  state.functions = *functions;
  state.source.context = &context;
  state.source.callbacks = description.buffers;
  if (description.buffers.create == nullptr) {
    state.blocks = std::make_unique<MemoryBlocks>(context, state.functions);
    state.source.callbacks = state.blocks->callbacks();
  }
  state.bound.resize(visibilityBuffer + 1);
  state.slots.resize(description.scene.framesInFlight);
  for (FrameSlot& slot : state.slots) slot.sets.context = &context;
  if (description.measuresGpuTime) {
    if (Result<void> made =
            state.timestamps.create(context, state.functions, description.scene.framesInFlight);
        !made)
      return made.error();
  }
  SceneOwner owner;
  owner.user = &state;
  owner.createBuffer = [](void* user, const SceneBuffer& wanted) {
    return static_cast<State*>(user)->createBuffer(wanted);
  };
  owner.releaseBuffer = [](void* user, std::uint32_t number) {
    static_cast<State*>(user)->releaseBuffer(number);
  };
  owner.frameBegun = [](void* user, std::uint64_t completedFrame) {
    static_cast<State*>(user)->frameBegun(completedFrame);
  };
  owner.frameAbandoned = [](void* user) {
    State& abandoned = *static_cast<State*>(user);
    --abandoned.recordCount;
    abandoned.slot().frame = 0;  // it is free again
    abandoned.statistics = {.gpuSeconds = abandoned.statistics.gpuSeconds};
  };
  Result<std::unique_ptr<Scene>> scene = SceneAccess::create(setup, owner);
  if (!scene) return scene.error();
  state.scene = std::move(*scene);
  return recorder;
}

Result<BufferRequirement> SceneRecorder::requirement(const Context& context,
                                                     const SceneRecorderDescription& description,
                                                     BufferRole role,
                                                     std::span<const VertexLayout> layouts) {
  const SceneSetup setup = rounded(setupOf(description, *context.state_));
  if (Result<void> good = checkSetup(setup); !good) return good.error();
  if (static_cast<std::size_t>(role) >= bufferRoleCount)
    return notAValue("the role of the buffer", role, "BufferRole");
  BufferRequirement needed = sceneSizes(setup).requirement(role, 0, setup.limits);
  if (role != BufferRole::positions) return needed;
  if (description.output.buffer == VK_NULL_HANDLE) needed.usage |= description.outputUsage;
  for (const VertexLayout& layout : layouts) {
    const Result<VertexPlaces> places = placeVertices(layout, 1);
    if (!places) return places.error();
    // What is before it ends at a multiple of 4 bytes.
    needed.size += std::max<std::uint64_t>(places->alignment, 4) - 4;
  }
  return needed;
}

Scene& SceneRecorder::scene() const {
  return *state_->scene;
}

Result<void> SceneRecorder::prepare(const InstanceDescription& instance) const {
  const Result<PipelineNeeds> needs = state_->scene->pipelineNeeds(instance);
  if (!needs) return needs.error();
  return state_->context->prepare(*needs, state_->books().tuning_);
}

VkBuffer SceneRecorder::outputBuffer() const {
  return state_->bound[state_->books().output_].range.buffer;
}
std::uint64_t SceneRecorder::outputGeneration() const {
  return state_->books().output_;
}

Result<BufferRange> SceneRecorder::poseRange(PoseHandle pose) const {
  return state_->rangeOf(state_->books().posePart(pose));
}
Result<BufferRange> SceneRecorder::weightsRange(InstanceHandle instance) const {
  return state_->rangeOf(state_->books().weightsPart(instance));
}
Result<BufferRange> SceneRecorder::drivenRange(PoseHandle pose) const {
  return state_->rangeOf(state_->books().drivenPart(pose));
}

Result<BufferRange> SceneRecorder::State::rangeOf(const Result<BufferPart>& part) const {
  if (!part) return part.error();
  const BufferRange& buffer = bound.at(part->buffer).range;
  return BufferRange{buffer.buffer, buffer.offset + part->offset, part->size};
}

RecorderStatistics SceneRecorder::statistics() const {
  RecorderStatistics statistics = state_->statistics;
  statistics.deviceMemory =
      state_->blocks != nullptr ? state_->blocks->bytes() : state_->source.bytes;
  return statistics;
}

/// Reads the GPU time of the newest complete frame, and frees what complete frames uploaded.
void SceneRecorder::State::frameBegun(std::uint64_t completedFrame) {
  for (FrameSlot& frameSlot : slots) {
    if (frameSlot.frame > completedFrame) continue;
    if (!frameSlot.isStagingKept) frameSlot.staging = OwnBuffer();
    if (frameSlot.frame <= timedFrame) continue;
    timedFrame = frameSlot.frame;
    statistics.gpuSeconds.reset();
    if (frameSlot.hasTimestamps)
      statistics.gpuSeconds =
          timestamps.seconds(static_cast<std::uint32_t>(&frameSlot - slots.data()));
  }
}

}  // namespace dermis::vulkan
