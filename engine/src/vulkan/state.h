// What a Context and its Bindings consist of.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "abi.h"
#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/context.h"
#include "vulkan/dispatch_table.h"
#include "vulkan/pipelines.h"

namespace dermis::vulkan {

struct ContextState {
  explicit ContextState(const DeviceDescription& description)
      : instance(description.instance),
        getInstanceProcAddr(description.getInstanceProcAddr),
        physicalDevice(description.physicalDevice),
        device(description.device),
        allocator(description.allocator) {}
  ~ContextState();

  std::uint32_t bindingCount() const {
    return limits.maxStorageBuffersPerStage < storageBuffersWanted ? abi::BINDING_COUNT_LEAST
                                                                   : abi::BINDING_COUNT;
  }
  /// They follow the storage buffers: a device with fewer of those reads no texels.
  std::uint32_t texelBindingCount() const {
    return limits.texelBuffers ? abi::TEXEL_BINDING_COUNT : 0;
  }
  bool pushesDescriptors() const { return table.cmdPushDescriptorSet != nullptr; }
  Result<void> createLayouts();
  Result<Bindings> createBindings(const BatchBuffers& buffers) const;

  VkInstance instance;
  PFN_vkGetInstanceProcAddr getInstanceProcAddr;
  VkPhysicalDevice physicalDevice;
  VkDevice device;
  const VkAllocationCallbacks* allocator;
  float timestampPeriod = 1;  ///< nanoseconds
  DispatchTable table;
  DeviceLimits limits;
  Tuning tuning;
  VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
  VkPipelineLayout pipelineLayout = VK_NULL_HANDLE;
  std::unique_ptr<Pipelines> pipelines;
};

/// What is behind the bindings of a kernel, by binding number.
struct BoundBuffers {
  std::array<VkDescriptorBufferInfo, abi::BINDING_COUNT> buffers{};
  std::array<VkBufferView, abi::TEXEL_BINDING_COUNT> texels{};  ///< from BINDING_COUNT on
};

/// The windows of the four outputs that a kernel sees.
using Windows = std::array<std::uint32_t, streamCount>;

struct BindingsState {
  ~BindingsState();

  const ContextState* context = nullptr;
  BatchBuffers buffers;
  std::uint64_t windowStep = 0;
  /// Of buffers that kernels read through texels, where there are such buffers.
  VkBufferView tableTexels = VK_NULL_HANDLE;
  VkBufferView meshTexels = VK_NULL_HANDLE;
  VkBufferView meshWords = VK_NULL_HANDLE;
  VkBufferView matrixTexels = VK_NULL_HANDLE;
  VkBufferView paletteTexels = VK_NULL_HANDLE;

  const BufferRange& output(std::size_t stream) const;
  std::uint32_t windowCount(std::size_t stream) const;

  /// Which buffers each kernel sees. What a variant does not use is bound to something that it
  /// uses: a descriptor that the module names must be valid.
  BoundBuffers paletteKernel() const;
  BoundBuffers skinKernel(Method method, const Windows& windows) const;

  Result<void> createTexelViews();

  // Without push descriptors: a set for the palette kernel, then for each window one a kind of
  // palette, all outputs at windows of one number.
  VkDescriptorPool pool = VK_NULL_HANDLE;
  std::vector<VkDescriptorSet> sets;

  std::uint32_t mostWindows() const;
  static std::size_t setIndex(const Variant& variant, std::uint32_t window) {
    if (variant.kernel == Kernel::palette) return 0;
    return 1 + std::size_t{window} * 2 + (variant.method == Method::linear ? 0 : 1);
  }
  /// The number of the windows in which a dispatch writes all that it writes; nothing where they
  /// differ.
  std::optional<std::uint32_t> commonWindow(const Dispatch& dispatch) const;

  /// Whether a plan can be recorded with these buffers and the pipelines that there are.
  Result<void> check(const Plan& plan) const;

  Result<void> createSets();

 private:
  Result<void> checkBuffers(const Plan& plan) const;
  Result<void> checkPairs(const Plan& plan) const;
  Result<void> checkVariants(const Plan& plan) const;
};

/// Where a dispatch has its workgroup counts from, where not from the plan.
struct IndirectArguments {
  PFN_vkCmdDispatchIndirect cmdDispatchIndirect = nullptr;
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceSize offset = 0;
};

/// Records one dispatch of a plan that `BindingsState::check` has passed.
void recordDispatch(VkCommandBuffer commandBuffer, const Dispatch& dispatch,
                    const BindingsState& bound, const IndirectArguments* arguments);
/// What the palette kernel wrote becomes visible to the skin kernel, which adds to the results.
void recordPaletteBarrier(const DispatchTable& table, VkCommandBuffer commandBuffer,
                          const BatchBuffers& buffers);

/// Whether a kernel writes an attribute.
bool writesStream(const Variant& variant, std::size_t stream);

}  // namespace dermis::vulkan
