// The state of a Context and its Bindings.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include <vulkan/vulkan_core.h>

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
        kernelSource(description.kernelSource),
        allocator(description.allocator) {}
  ~ContextState();

  std::uint32_t bindingCount() const {
    return limits.maxStorageBuffersPerStage < storageBuffersWanted ? abi::MIN_BINDING_COUNT
                                                                   : abi::BINDING_COUNT;
  }
  /// Texel bindings follow the storage buffers. Devices with fewer than `storageBuffersWanted`
  /// storage buffers do not use texel buffers.
  std::uint32_t texelBindingCount() const {
    return limits.texelBuffers ? abi::TEXEL_BINDING_COUNT : 0;
  }
  void recordBarrier(VkCommandBuffer commandBuffer, const Barrier& barrier) const;
  bool pushesDescriptors() const { return table.cmdPushDescriptorSet != nullptr; }
  Result<void> createLayouts();
  Result<void> prepare(std::span<const Variant> variants) const;
  Result<void> prepare(const PipelineNeeds& needs, const Tuning& withTuning) const;
  /// Without push descriptors: creates a pool and allocates descriptor sets from it. The caller
  /// must destroy the pool even if this fails.
  Result<void> allocateSets(std::uint32_t count, VkDescriptorPool& pool,
                            std::vector<VkDescriptorSet>& sets) const;
  /// `poseBuffers`: of a scene, those that the palette kernel reads.
  Result<Bindings> createBindings(const BatchBuffers& buffers,
                                  std::vector<BufferRange> poseBuffers = {}) const;

  VkInstance instance;
  PFN_vkGetInstanceProcAddr getInstanceProcAddr;
  VkPhysicalDevice physicalDevice;
  VkDevice device;
  KernelSource kernelSource;
  const VkAllocationCallbacks* allocator;
  float timestampPeriod = 1;  ///< nanoseconds
  DispatchTable table;
  DeviceLimits limits;
  Tuning tuning;
  VkDescriptorSetLayout setLayout = VK_NULL_HANDLE;
  VkPipelineLayout pipelineLayout = VK_NULL_HANDLE;
  std::unique_ptr<Pipelines> pipelines;
};

/// The buffers of a kernel's bindings, by binding number.
struct BoundBuffers {
  std::array<VkDescriptorBufferInfo, abi::BINDING_COUNT> buffers{};
  std::array<VkBufferView, abi::TEXEL_BINDING_COUNT> texels{};  ///< from BINDING_COUNT on
};

/// The windows of the four outputs that a kernel sees.
using Windows = std::array<std::uint32_t, streamCount>;

/// Buffers that commands of a scene use besides the bound ones.
struct FrameBuffers {
  BufferRange upload, readBack, visibility, history, counters;
  /// For the visibility kernel, without push descriptors. `recordCommands` writes the set: the
  /// frame that used it last must be complete.
  VkDescriptorSet visibilitySet = VK_NULL_HANDLE;
};

struct BindingsState {
  ~BindingsState();

  const ContextState* context = nullptr;
  BatchBuffers buffers;
  std::vector<BufferRange> poseBuffers;  ///< of a batch: the only one
  std::uint64_t windowStep = 0;
  /// Views of the buffers that kernels read through texel buffers, if they do.
  VkBufferView tableTexels = VK_NULL_HANDLE;
  VkBufferView meshTexels = VK_NULL_HANDLE;
  VkBufferView meshWords = VK_NULL_HANDLE;
  VkBufferView matrixTexels = VK_NULL_HANDLE;
  VkBufferView paletteTexels = VK_NULL_HANDLE;

  const BufferRange& output(std::size_t stream) const;
  std::uint32_t windowCount(std::size_t stream) const;

  /// The buffers that each kernel sees. Bindings that a variant does not use are bound to a buffer
  /// that it uses, since all descriptors that the module declares must be valid.
  BoundBuffers paletteKernel(std::uint32_t poseBuffer) const;
  BoundBuffers skinKernel(BufferRole joints, const Windows& windows) const;
  BoundBuffers visibilityKernel(const FrameBuffers& frame) const;

  Result<void> createTexelViews();

  // Without push descriptors: a set of the palette kernel for each pose buffer; then, for each
  // window number, two sets of the skin kernel: one with poses and one with palettes. All outputs
  // of a set are bound at the window of that number, or at their last one.
  VkDescriptorPool pool = VK_NULL_HANDLE;
  std::vector<VkDescriptorSet> sets;

  std::uint32_t mostWindows() const;
  std::size_t skinSet(BufferRole joints, std::uint32_t window) const {
    return poseBuffers.size() + std::size_t{window} * 2 + (joints == BufferRole::poses ? 0 : 1);
  }
  /// The window number of all outputs of a dispatch that have several windows. They must have the
  /// same one, as they do if `DeviceLimits::separateRanges` is false.
  static std::uint32_t commonWindow(const DispatchCommand& dispatch);

  /// Whether a plan can be recorded with these buffers and the existing pipelines.
  Result<void> check(const Plan& plan) const;

  Result<void> createSets();

 private:
  Result<void> checkBuffers(const Plan& plan) const;
  Result<void> checkOneBuffer(const Plan& plan) const;
  Result<void> checkVariants(const Plan& plan) const;
};

/// What was recorded.
struct Recorded {
  std::uint32_t dispatches = 0;
  std::uint64_t workgroups = 0;  ///< of direct dispatches
  std::uint32_t copies = 0;      ///< calls of vkCmdCopyBuffer
};

/// Records the commands of a plan that passed `BindingsState::check`. `frame` is for plans of a
/// scene.
Recorded recordCommands(VkCommandBuffer commandBuffer, const Plan& plan, const BindingsState& bound,
                        const FrameBuffers* frame);

/// Whether a kernel writes an attribute.
bool writesStream(const Variant& variant, std::size_t stream);

}  // namespace dermis::vulkan
