#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <utility>

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
                                               " bytes of " + name + ", the bindings have " +
                                               std::to_string(given)};
}

std::string describe(const Variant& variant) {
  if (variant.kernel == Kernel::palette) return "the palette kernel";
  std::string text = "the variant of " + std::string(methodName(variant.method)) +
                     " with positions as " + std::string(formatName(variant.positions));
  if (variant.normals != VertexFormat::none)
    text += ", normals as " + std::string(formatName(variant.normals));
  if (variant.tangents != VertexFormat::none)
    text += ", tangents as " + std::string(formatName(variant.tangents));
  if (variant.motion != Motion::none) text += ", previous positions";
  if (variant.morphs) text += ", morph targets";
  if (variant.bounds) text += ", bounds";
  text += ", for " +
          (variant.influences == 0 ? std::string("any number of")
                                   : std::to_string(variant.influences)) +
          " influences";
  if (variant.scales) text += " and joints that scale";
  return text;
}

}  // namespace

Result<void> BindingsState::checkBuffers(const Plan& plan) const {
  for (const auto& [role, range, name] : {std::tuple{BufferRole::meshes, &buffers.meshes, "meshes"},
                                          {BufferRole::matrices, &buffers.matrices, "matrices"},
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

/// Variants that store pairs write normals through the binding of the positions.
Result<void> BindingsState::checkPairs(const Plan& plan) const {
  const bool stores = std::any_of(plan.variants().begin(), plan.variants().end(),
                                  [](const Variant& variant) { return variant.pairs; });
  const BufferRange& positions = buffers.outputs.positions;
  const BufferRange& normals = buffers.outputs.normals;
  if (!stores || (positions.buffer == normals.buffer && positions.offset == normals.offset))
    return {};
  return Error{ErrorCode::invalidArgument,
               "the plan was made for outputs in one buffer, the bindings have normals in another"};
}

Result<void> BindingsState::checkVariants(const Plan& plan) const {
  for (const Variant& variant : plan.variants()) {
    if (context->pipelines->find(variant) == VK_NULL_HANDLE)
      return Error{ErrorCode::notPrepared, describe(variant) + " has not been prepared"};
  }
  return {};
}

Result<void> BindingsState::check(const Plan& plan) const {
  if (Result<void> good = checkBuffers(plan); !good) return good;
  if (!plan.dispatches().empty() && plan.limits() != context->limits) {
    return Error{
        ErrorCode::invalidArgument,
        "the plan was made for other limits than this device's; makePlan takes Context::limits()"};
  }
  if (Result<void> good = checkPairs(plan); !good) return good;
  if (Result<void> good = checkVariants(plan); !good) return good;
  if (context->pushesDescriptors()) return {};
  for (const Dispatch& dispatch : plan.dispatches()) {
    if (!commonWindow(dispatch)) {
      return Error{ErrorCode::limitExceeded,
                   "the attributes of an instance lie in different windows of outputs that are "
                   "larger than a storage buffer range: that needs VK_KHR_push_descriptor"};
    }
  }
  return {};
}

void recordPaletteBarrier(const DispatchTable& table, VkCommandBuffer commandBuffer,
                          const BatchBuffers& buffers) {
  std::array<VkBufferMemoryBarrier, 2> barriers{};
  std::uint32_t count = 0;
  for (const auto& [range, accesses] :
       {std::pair{&buffers.palettes, VkAccessFlags{VK_ACCESS_SHADER_READ_BIT}},
        {&buffers.results, VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT}}) {
    if (range->buffer == VK_NULL_HANDLE) continue;
    VkBufferMemoryBarrier& barrier = barriers[count++];
    barrier.sType = VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER;
    barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
    barrier.dstAccessMask = accesses;
    barrier.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.buffer = range->buffer;
    barrier.offset = range->offset;
    barrier.size = range->size;
  }
  table.cmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                           VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, 0, nullptr, count,
                           barriers.data(), 0, nullptr);
}

void recordDispatch(VkCommandBuffer commandBuffer, const Dispatch& dispatch,
                    const BindingsState& bound, const IndirectArguments* arguments) {
  const ContextState& context = *bound.context;
  const DispatchTable& table = context.table;
  const bool isPalette = dispatch.variant.kernel == Kernel::palette;
  table.cmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE,
                        context.pipelines->find(dispatch.variant));
  if (context.pushesDescriptors()) {
    Windows windows;
    for (std::size_t stream = 0; stream < streamCount; ++stream)
      windows[stream] = dispatch.windows[stream].index;
    const BoundBuffers kernelBuffers =
        isPalette ? bound.paletteKernel() : bound.skinKernel(dispatch.variant.method, windows);
    const DescriptorWrites writes(kernelBuffers);
    table.cmdPushDescriptorSet(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE,
                               context.pipelineLayout, 0, writes.count(), writes.data());
  } else {
    const VkDescriptorSet set =
        bound.sets[BindingsState::setIndex(dispatch.variant, *bound.commonWindow(dispatch))];
    table.cmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE,
                                context.pipelineLayout, 0, 1, &set, 0, nullptr);
  }
  table.cmdPushConstants(commandBuffer, context.pipelineLayout, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                         sizeof(dispatch.constants), &dispatch.constants);
  if (arguments == nullptr) {
    table.cmdDispatch(commandBuffer, dispatch.groupCountX, dispatch.groupCountY, 1);
  } else {
    arguments->cmdDispatchIndirect(commandBuffer, arguments->buffer, arguments->offset);
  }
}

Result<void> Context::record(VkCommandBuffer commandBuffer, const Plan& plan,
                             const Bindings& bindings) const {
  const ContextState& context = *state_;
  if (bindings.state_ == nullptr || bindings.state_->context != &context) {
    return Error{ErrorCode::invalidArgument, "the bindings were not made by this context"};
  }
  const BindingsState& bound = *bindings.state_;
  if (Result<void> good = bound.check(plan); !good) return good;

  const DispatchTable& table = context.table;
  const Label label(table, commandBuffer, "dermis: skin a batch");
  bool palettesVisible = false;
  for (const Dispatch& dispatch : plan.dispatches()) {
    if (dispatch.afterPalettes && !palettesVisible) {
      recordPaletteBarrier(table, commandBuffer, bound.buffers);
      palettesVisible = true;
    }
    recordDispatch(commandBuffer, dispatch, bound, nullptr);
  }
  return {};
}

}  // namespace dermis::vulkan
