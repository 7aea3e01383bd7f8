#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <utility>
#include <variant>

#include "dermis/vulkan/barrier.h"
#include "plan/placement.h"
#include "vulkan/descriptor_writes.h"
#include "vulkan/state.h"

namespace dermis::vulkan {
namespace {

Result<void> checkBuffer(const Plan& plan, BufferRole role, const BufferRange& range,
                         const char* name) {
  const std::uint64_t needed = plan.buffer(role).size;
  const std::uint64_t given = range.buffer == VK_NULL_HANDLE ? 0 : range.size;
  if (given >= needed) return {};
  return Error{ErrorCode::invalidArgument, std::string("the plan needs ") + std::to_string(needed) +
                                               " bytes of " + name + ", but the bindings have " +
                                               std::to_string(given)};
}

std::string describe(const Variant& variant) {
  if (variant.kernel == Kernel::palette) {
    return std::string("the palette kernel for ") +
           (variant.method == Method::linear      ? "matrices"
            : variant.method == Method::logMatrix ? "logarithms"
                                                  : "dual quaternions") +
           (variant.scales ? " with joints that scale" : "");
  }
  if (variant.kernel == Kernel::clear) return "the clear kernel";
  if (variant.kernel == Kernel::visibility)
    return "the visibility kernel, for instances that are culled on the GPU,";
  std::string text = "the variant of " + std::string(methodName(variant.method)) +
                     " with positions as " + std::string(formatName(variant.positions));
  if (variant.normals != VertexFormat::none)
    text += ", normals as " + std::string(formatName(variant.normals));
  if (variant.tangents != VertexFormat::none)
    text += ", tangents as " + std::string(formatName(variant.tangents));
  if (variant.motion != Motion::none) text += ", previous positions";
  if (variant.morphs) text += ", morph targets";
  if (variant.bounds) text += ", bounds";
  if (variant.recordBytes != 0)
    text += ", " + std::to_string(variant.recordBytes) +
            (variant.staged ? " bytes per vertex through workgroup memory" : " bytes per store");
  if (variant.pairs) text += ", 8 bytes per store";
  text += std::string(", for ") + (variant.fullInfluences ? "exactly " : "") +
          (variant.influences == 0 ? std::string("any number of")
                                   : std::to_string(variant.influences)) +
          " influences";
  if (variant.scales) text += " and joints that scale";
  return text;
}

}  // namespace

Result<void> BindingsState::checkBuffers(const Plan& plan) const {
  for (const auto& [role, range, name] : {std::tuple{BufferRole::meshes, &buffers.meshes, "meshes"},
                                          {BufferRole::poses, &buffers.poses, "poses"},
                                          {BufferRole::tables, &buffers.tables, "tables"},
                                          {BufferRole::palettes, &buffers.palettes, "palettes"},
                                          {BufferRole::results, &buffers.results, "results"}}) {
    if (Result<void> good = checkBuffer(plan, role, *range, name); !good) return good;
  }
  static constexpr std::array<std::pair<BufferRole, const char*>, streamCount> outputs{
      {{BufferRole::positions, "positions"},
       {BufferRole::normals, "normals"},
       {BufferRole::tangents, "tangents"},
       {BufferRole::previousPositions, "previous positions"}}};
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    const bool isWritten =
        std::any_of(plan.variants().begin(), plan.variants().end(),
                    [&](const Variant& variant) { return writesStream(variant, stream); });
    if (!isWritten) continue;
    if (Result<void> good =
            checkBuffer(plan, outputs[stream].first, output(stream), outputs[stream].second);
        !good)
      return good;
  }
  return {};
}

/// Variants that store attributes together write them through the binding of one of them.
Result<void> BindingsState::checkOneBuffer(const Plan& plan) const {
  const BufferRange& positions = buffers.outputs.positions;
  for (const Variant& variant : plan.variants()) {
    if (variant.kernel != Kernel::skin ||
        !(variant.pairs || variant.recordBytes != 0 ||
          shareWords(variant.positions, variant.normals, variant.tangents)))
      continue;
    for (const auto& [format, range, name] :
         {std::tuple{variant.normals, &buffers.outputs.normals, "normals"},
          {variant.tangents, &buffers.outputs.tangents, "tangents"}}) {
      if (format == VertexFormat::none ||
          (range->buffer == positions.buffer && range->offset == positions.offset))
        continue;
      return Error{ErrorCode::invalidArgument,
                   std::string("the plan was made for outputs in one buffer, but the bindings have "
                               "positions and ") +
                       name + " in two"};
    }
  }
  return {};
}

Result<void> BindingsState::checkVariants(const Plan& plan) const {
  for (const Variant& variant : plan.variants()) {
    if (context->pipelines->find(variant) == VK_NULL_HANDLE)
      return Error{ErrorCode::notPrepared,
                   describe(variant) + " has no pipeline; call Context::prepare for it first"};
  }
  return {};
}

Result<void> BindingsState::check(const Plan& plan) const {
  if (Result<void> good = checkBuffers(plan); !good) return good;
  if (!plan.commands().empty() && plan.limits() != context->limits) {
    return Error{
        ErrorCode::invalidArgument,
        "the plan was made for the limits of another device; pass Context::limits() to makePlan"};
  }
  if (Result<void> good = checkOneBuffer(plan); !good) return good;
  return checkVariants(plan);
}

namespace {

struct Scope {
  VkPipelineStageFlags stages = 0;
  VkAccessFlags accesses = 0;
};
Scope scopeOf(Access accesses) {
  struct Part {
    Access access;
    Scope scope;
  };
  static constexpr std::array<Part, 6> parts{
      {{Access::computeRead, {VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT}},
       {Access::computeWrite, {VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_WRITE_BIT}},
       {Access::copyRead, {VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_READ_BIT}},
       {Access::copyWrite, {VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT}},
       {Access::indirectRead,
        {VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT, VK_ACCESS_INDIRECT_COMMAND_READ_BIT}},
       {Access::hostRead, {VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT}}}};
  Scope scope;
  for (const Part& part : parts) {
    if (!includes(accesses, part.access)) continue;
    scope.stages |= part.scope.stages;
    scope.accesses |= part.scope.accesses;
  }
  return scope;
}

/// Records one command after the other.
class Recorder {
 public:
  Recorder(VkCommandBuffer commandBuffer, const BindingsState& bound, const FrameBuffers* frame)
      : commandBuffer_(commandBuffer),
        bound_(bound),
        context_(*bound.context),
        table_(bound.context->table),
        frame_(frame) {}

  void operator()(const BarrierCommand& barrier) {
    const Scope before = scopeOf(barrier.before), after = scopeOf(barrier.after);
    // After reads alone, no memory has to be made visible.
    constexpr VkAccessFlags writes = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
    context_.recordBarrier(commandBuffer_,
                           {before.stages, before.accesses & writes, after.stages, after.accesses});
  }

  void operator()(const ClearCommand& clear) {
    const BufferRange range = rangeOf(clear.buffer);
    table_.cmdFillBuffer(commandBuffer_, range.buffer, range.offset + clear.offset, clear.size, 0);
  }

  /// Copies with the same buffers are recorded in one call.
  std::span<const Command> copy(std::span<const Command> commands) {
    const auto& first = std::get<CopyCommand>(commands.front());
    const BufferRange from = rangeOf(first.from), to = rangeOf(first.to);
    std::array<VkBufferCopy, 64> regions;
    std::uint32_t count = 0;
    while (count < regions.size() && count < commands.size()) {
      const auto* next = std::get_if<CopyCommand>(&commands[count]);
      if (next == nullptr || next->from != first.from || next->to != first.to) break;
      regions[count++] = {from.offset + next->fromOffset, to.offset + next->toOffset, next->size};
    }
    table_.cmdCopyBuffer(commandBuffer_, from.buffer, to.buffer, count, regions.data());
    ++recorded_.copies;
    return commands.subspan(count);
  }

  void operator()(const DispatchCommand& dispatch) {
    table_.cmdBindPipeline(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE,
                           context_.pipelines->find(dispatch.variant));
    bindBuffers(dispatch);
    table_.cmdPushConstants(commandBuffer_, context_.pipelineLayout, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                            dispatch.constantCount * 4, dispatch.constants.data());
    ++recorded_.dispatches;
    recorded_.workgroups += dispatch.workgroupCount;
    if (dispatch.indirectOffset) {
      const BufferRange& tables = bound_.buffers.tables;
      table_.cmdDispatchIndirect(commandBuffer_, tables.buffer,
                                 tables.offset + *dispatch.indirectOffset);
    } else {
      table_.cmdDispatch(commandBuffer_, dispatch.groupCountX, dispatch.groupCountY, 1);
    }
  }

  const Recorded& recorded() const { return recorded_; }

 private:
  BufferRange rangeOf(BufferRole role) const {
    switch (role) {
      case BufferRole::tables:
        return bound_.buffers.tables;
      case BufferRole::results:
        return bound_.buffers.results;
      case BufferRole::positions:
        return bound_.buffers.outputs.positions;
      case BufferRole::upload:
        return frame_->upload;
      case BufferRole::readBack:
        return frame_->readBack;
      case BufferRole::history:
        return frame_->history;
      case BufferRole::counters:
        return frame_->counters;
      default:
        return {};  // no command copies or clears it
    }
  }

  BoundBuffers buffersOf(const DispatchCommand& dispatch) const {
    if (dispatch.variant.kernel == Kernel::palette || dispatch.variant.kernel == Kernel::clear)
      return bound_.paletteKernel(dispatch.poseBuffer);
    if (dispatch.variant.kernel == Kernel::visibility) return bound_.visibilityKernel(*frame_);
    Windows windows;
    for (std::size_t stream = 0; stream < streamCount; ++stream)
      windows[stream] = dispatch.windows[stream].index;
    return bound_.skinKernel(dispatch.joints, windows);
  }

  void bindBuffers(const DispatchCommand& dispatch) {
    if (context_.pushesDescriptors()) {
      const BoundBuffers buffers = buffersOf(dispatch);
      const DescriptorWrites writes(buffers);
      table_.cmdPushDescriptorSet(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE,
                                  context_.pipelineLayout, 0, writes.count(), writes.data());
      return;
    }
    VkDescriptorSet set = VK_NULL_HANDLE;
    if (dispatch.variant.kernel == Kernel::visibility) {
      set = frame_->visibilitySet;
      if (!visibilityIsWritten_) {
        const BoundBuffers buffers = buffersOf(dispatch);
        const DescriptorWrites writes(buffers, set);
        table_.updateDescriptorSets(context_.device, writes.count(), writes.data(), 0, nullptr);
      }
      visibilityIsWritten_ = true;
    } else if (dispatch.variant.kernel == Kernel::palette ||
               dispatch.variant.kernel == Kernel::clear) {
      set = bound_.sets[dispatch.poseBuffer];
    } else {
      set = bound_.sets[bound_.skinSet(dispatch.joints, bound_.commonWindow(dispatch))];
    }
    table_.cmdBindDescriptorSets(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE,
                                 context_.pipelineLayout, 0, 1, &set, 0, nullptr);
  }

  VkCommandBuffer commandBuffer_;
  const BindingsState& bound_;
  const ContextState& context_;
  const DispatchTable& table_;
  const FrameBuffers* frame_;
  bool visibilityIsWritten_ = false;
  Recorded recorded_;
};

}  // namespace

Recorded recordCommands(VkCommandBuffer commandBuffer, const Plan& plan, const BindingsState& bound,
                        const FrameBuffers* frame) {
  Recorder recorder(commandBuffer, bound, frame);
  for (std::span<const Command> commands = plan.commands(); !commands.empty();) {
    if (std::holds_alternative<CopyCommand>(commands.front())) {
      commands = recorder.copy(commands);
      continue;
    }
    if (const auto* dispatch = std::get_if<DispatchCommand>(&commands.front())) {
      recorder(*dispatch);
    } else if (const auto* barrier = std::get_if<BarrierCommand>(&commands.front())) {
      recorder(*barrier);
    } else if (const auto* clear = std::get_if<ClearCommand>(&commands.front())) {
      recorder(*clear);
    }
    commands = commands.subspan(1);
  }
  return recorder.recorded();
}

Result<void> Context::record(VkCommandBuffer commandBuffer, const Plan& plan,
                             const Bindings& bindings) const {
  const ContextState& context = *state_;
  if (bindings.state_ == nullptr || bindings.state_->context != &context) {
    return Error{ErrorCode::invalidArgument, "the bindings were not made by this context"};
  }
  if (plan.buffer(BufferRole::readBack).size != 0) {
    return Error{ErrorCode::invalidArgument,
                 "the plan is for a scene: its commands use buffers that bindings do not have"};
  }
  const BindingsState& bound = *bindings.state_;
  if (Result<void> good = bound.check(plan); !good) return good;
  const Label label(context.table, commandBuffer, "dermis: skin a batch");
  recordCommands(commandBuffer, plan, bound, nullptr);
  return {};
}

}  // namespace dermis::vulkan
