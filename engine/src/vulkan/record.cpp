#include <string>
#include <tuple>

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

/// The palettes that the palette kernel wrote become visible to the skin kernel.
void recordPaletteBarrier(const DispatchTable& table, VkCommandBuffer commandBuffer,
                          const BufferRange& palettes) {
  VkBufferMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
  barrier.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.buffer = palettes.buffer;
  barrier.offset = palettes.offset;
  barrier.size = palettes.size;
  table.cmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                           VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, 0, nullptr, 1, &barrier, 0,
                           nullptr);
}

class Label {
 public:
  Label(const DispatchTable& table, VkCommandBuffer commandBuffer, const char* name)
      : table_(table), commandBuffer_(commandBuffer) {
    if (table_.cmdBeginDebugUtilsLabel == nullptr) return;
    VkDebugUtilsLabelEXT label{};
    label.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_LABEL_EXT;
    label.pLabelName = name;
    table_.cmdBeginDebugUtilsLabel(commandBuffer_, &label);
  }
  ~Label() {
    if (table_.cmdEndDebugUtilsLabel != nullptr) table_.cmdEndDebugUtilsLabel(commandBuffer_);
  }
  Label(const Label&) = delete;
  Label& operator=(const Label&) = delete;

 private:
  const DispatchTable& table_;
  VkCommandBuffer commandBuffer_;
};

}  // namespace

Result<void> Context::record(VkCommandBuffer commandBuffer, const Plan& plan,
                             const Bindings& bindings) const {
  const State& context = *state_;
  if (bindings.state_ == nullptr || bindings.state_->context != &context) {
    return Error{ErrorCode::invalidArgument, "the bindings were not made by this context"};
  }
  const Bindings::State& bound = *bindings.state_;
  const BatchBuffers& buffers = bound.buffers;
  for (const auto& [role, range, name] : {std::tuple{BufferRole::meshes, &buffers.meshes, "meshes"},
                                          {BufferRole::matrices, &buffers.matrices, "matrices"},
                                          {BufferRole::tables, &buffers.tables, "tables"},
                                          {BufferRole::palettes, &buffers.palettes, "palettes"},
                                          {BufferRole::output, &buffers.output, "output"}}) {
    if (Result<void> good = checkBuffer(plan, role, *range, name); !good) return good;
  }
  if (!plan.dispatches().empty() && plan.limits() != context.limits) {
    return Error{
        ErrorCode::invalidArgument,
        "the plan was made for other limits than this device's; makePlan takes Context::limits()"};
  }
  for (const Variant& variant : plan.variants()) {
    if (context.pipelines->find(variant) == VK_NULL_HANDLE) {
      return Error{ErrorCode::notPrepared,
                   variant.kernel == Kernel::palette
                       ? std::string("the palette kernel has not been prepared")
                       : "the variant of " + std::string(methodName(variant.method)) +
                             (variant.normals ? " with" : " without") + " normals for " +
                             (variant.influences == 0 ? std::string("any number of")
                                                      : std::to_string(variant.influences)) +
                             " influences has not been prepared"};
    }
  }

  const DispatchTable& table = context.table;
  const Label label(table, commandBuffer, "dermis: skin a batch");
  bool palettesVisible = false;
  for (const Dispatch& dispatch : plan.dispatches()) {
    if (dispatch.afterPalettes && !palettesVisible) {
      recordPaletteBarrier(table, commandBuffer, buffers.palettes);
      palettesVisible = true;
    }
    const bool isPalette = dispatch.variant.kernel == Kernel::palette;
    table.cmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE,
                          context.pipelines->find(dispatch.variant));
    if (context.pushesDescriptors()) {
      const BoundBuffers kernelBuffers =
          isPalette
              ? bound.paletteKernel()
              : bound.skinKernel(dispatch.variant.method, dispatch.outputWindow, context.limits);
      const DescriptorWrites writes(kernelBuffers);
      table.cmdPushDescriptorSet(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE,
                                 context.pipelineLayout, 0, writes.count(), writes.data());
    } else {
      const VkDescriptorSet set =
          bound.sets[Bindings::State::setIndex(dispatch.variant, dispatch.outputWindow)];
      table.cmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE,
                                  context.pipelineLayout, 0, 1, &set, 0, nullptr);
    }
    table.cmdPushConstants(commandBuffer, context.pipelineLayout, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                           sizeof(dispatch.constants), &dispatch.constants);
    table.cmdDispatch(commandBuffer, dispatch.groupCountX, dispatch.groupCountY, 1);
  }
  return {};
}

}  // namespace dermis::vulkan
