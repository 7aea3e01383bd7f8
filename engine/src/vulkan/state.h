// What a Context and its Bindings consist of.
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
  /// They follow the storage buffers: a device with fewer of those reads no texels.
  std::uint32_t texelBindingCount() const {
    return limits.texelBuffers ? abi::TEXEL_BINDING_COUNT : 0;
  }
  bool pushesDescriptors() const { return table.cmdPushDescriptorSet != nullptr; }
  Result<void> createLayouts();
  Result<void> prepare(std::span<const Variant> variants) const;
  Result<void> prepare(const PipelineNeeds& needs, const Tuning& withTuning) const;
  /// Descriptor sets and the pool that has them, without push descriptors. The pool must be
  /// destroyed even if it fails.
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

/// What is behind the bindings of a kernel, by binding number.
struct BoundBuffers {
  std::array<VkDescriptorBufferInfo, abi::BINDING_COUNT> buffers{};
  std::array<VkBufferView, abi::TEXEL_BINDING_COUNT> texels{};  ///< from BINDING_COUNT on
};

/// The windows of the four outputs that a kernel sees.
using Windows = std::array<std::uint32_t, streamCount>;

/// What the commands of a scene use besides what is bound.
struct FrameBuffers {
  BufferRange upload, readBack, visibility, history, counters;
  /// For the visibility kernel, without push descriptors. It is written when it is recorded: the
  /// frame that used it last must be complete.
  VkDescriptorSet visibilitySet = VK_NULL_HANDLE;
};

struct BindingsState {
  ~BindingsState();

  const ContextState* context = nullptr;
  BatchBuffers buffers;
  std::vector<BufferRange> poseBuffers;  ///< of a batch, its only one
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
  BoundBuffers paletteKernel(std::uint32_t poseBuffer) const;
  BoundBuffers skinKernel(BufferRole joints, const Windows& windows) const;
  BoundBuffers visibilityKernel(const FrameBuffers& frame) const;

  Result<void> createTexelViews();

  // Without push descriptors: a set of the palette kernel for each pose buffer, then for each
  // window one for those who read poses and one for those who read palettes, all outputs at windows
  // of one number.
  VkDescriptorPool pool = VK_NULL_HANDLE;
  std::vector<VkDescriptorSet> sets;

  std::uint32_t mostWindows() const;
  std::size_t skinSet(BufferRole joints, std::uint32_t window) const {
    return poseBuffers.size() + std::size_t{window} * 2 + (joints == BufferRole::poses ? 0 : 1);
  }
  /// The number of the windows that a dispatch writes to, where it is one
  /// (`DeviceLimits::separateRanges`).
  static std::uint32_t commonWindow(const DispatchCommand& dispatch);

  /// Whether a plan can be recorded with these buffers and the pipelines that there are.
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

/// Records the commands of a plan that `BindingsState::check` has passed. `frame` for those of a
/// scene.
Recorded recordCommands(VkCommandBuffer commandBuffer, const Plan& plan, const BindingsState& bound,
                        const FrameBuffers* frame);

/// Whether a kernel writes an attribute.
bool writesStream(const Variant& variant, std::size_t stream);

}  // namespace dermis::vulkan
