// What a Context and its Bindings consist of.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/context.h"
#include "vulkan/dispatch_table.h"
#include "vulkan/pipelines.h"

namespace dermis::vulkan {

struct Context::State {
  explicit State(const DeviceDescription& description)
      : device(description.device), allocator(description.allocator) {}
  ~State();

  bool pushesDescriptors() const { return table.cmdPushDescriptorSet != nullptr; }
  Result<void> createLayouts();

  VkDevice device;
  const VkAllocationCallbacks* allocator;
  DispatchTable table;
  DeviceLimits limits;
  VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
  VkPipelineLayout pipelineLayout = VK_NULL_HANDLE;
  std::unique_ptr<Pipelines> pipelines;
};

/// The buffers behind the four bindings of a kernel, by binding number.
using BoundBuffers = std::array<VkDescriptorBufferInfo, 4>;

struct Bindings::State {
  ~State();

  const Context::State* context = nullptr;
  BatchBuffers buffers;
  std::uint64_t windowStep = 0;

  /// Which buffers each kernel sees. `window` counts the output ranges.
  BoundBuffers paletteKernel() const;
  BoundBuffers skinKernel(Method method, std::uint32_t window, const DeviceLimits& limits) const;

  // Without push descriptors: a set for the palette kernel, then for each output range one a kind
  // of palette.
  VkDescriptorPool pool = VK_NULL_HANDLE;
  std::vector<VkDescriptorSet> sets;

  std::uint32_t windowCount() const;
  static std::size_t setIndex(const Variant& variant, std::uint32_t window) {
    if (variant.kernel == Kernel::palette) return 0;
    return 1 + std::size_t{window} * 2 + (variant.method == Method::linear ? 0 : 1);
  }
};

}  // namespace dermis::vulkan
