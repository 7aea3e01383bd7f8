// The state of a Context and its Bindings.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include <vulkan/vulkan_core.h>

#include "abi.h"
#include "dermis/vulkan/context.h"
#include "vulkan/dispatch_table.h"
#include "vulkan/pipelines.h"

namespace dermis::vulkan {

struct DescriptorSets;
struct BoundBuffer;

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
  void recordBarrier(VkCommandBuffer commandBuffer, Use before, Use after) const;
  bool pushesDescriptors() const { return table.cmdPushDescriptorSet != nullptr; }
  Result<void> createLayouts();
  Result<void> prepare(std::span<const PipelineId> ids) const;
  Result<void> prepare(const PipelineNeeds& needs, const Tuning& withTuning) const;
  /// Whether there is a pipeline for each dispatch; else the error names the function `prepare`,
  /// which builds them. Without push descriptors it also makes their sets.
  Result<void> check(const Plan& plan, const std::vector<BoundBuffer>& buffers,
                     DescriptorSets& sets, const char* prepare) const;

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

/// A buffer that commands name, and the view through which kernels for CPU devices read it.
struct BoundBuffer {
  BufferRange range;
  VkBufferView view = VK_NULL_HANDLE;
};

/// The buffers of a plan, by number.
using BoundBuffers = std::vector<BoundBuffer>;

/// Creates the view that kernels for CPU devices need of a buffer with this role; none for other
/// devices.
Result<void> createTexelView(const ContextState& context, BufferRole role, BoundBuffer& buffer);
void destroyTexelView(const ContextState& context, BoundBuffer& buffer);

/// The descriptors of a dispatch, by binding number.
struct Descriptors {
  Descriptors(const ContextState& context, const DispatchCommand& dispatch,
              const BoundBuffers& buffers);

  std::array<VkDescriptorBufferInfo, abi::BINDING_COUNT> buffers{};
  std::array<VkBufferView, abi::TEXEL_BINDING_COUNT> texels{};  ///< from BINDING_COUNT on
};

/// Descriptor sets, for devices without push descriptors. Any thread may call `make` and `find`.
struct DescriptorSets {
  DescriptorSets() = default;
  ~DescriptorSets();
  DescriptorSets(DescriptorSets&& other) noexcept;
  DescriptorSets& operator=(DescriptorSets&&) = delete;

  /// Makes the set unless it exists.
  Result<void> make(const Descriptors& descriptors);
  /// One that `make` made.
  VkDescriptorSet find(const Descriptors& descriptors) const;
  /// Forgets all sets: the GPU has completed all commands that use them. No set is written twice:
  /// one that kept descriptors which the next dispatch does not use could name what has gone.
  void reset();

  const ContextState* context = nullptr;

 private:
  struct Pool {
    VkDescriptorPool pool;
    std::uint32_t count, left;  ///< sets
  };
  struct Made {
    Descriptors descriptors;
    VkDescriptorSet set;
  };
  Result<void> addPool(std::uint32_t count);
  VkDescriptorSet findMade(const Descriptors& descriptors) const;

  mutable std::mutex mutex_;
  std::vector<Pool> pools_;
  std::vector<Made> made_;
};

struct BindingsState {
  ~BindingsState();
  /// Whether a plan can be recorded with these buffers and the existing pipelines.
  Result<void> check(const Plan& plan) const;

  const ContextState* context = nullptr;
  BatchBuffers buffers;
  BoundBuffers bound;
  mutable DescriptorSets sets;

 private:
  Result<void> checkBuffers(const Plan& plan) const;
  Result<void> checkOneBuffer(const Plan& plan) const;
};

/// Where the bytes of uploads are put for the GPU to copy them, one after the other. Those of the
/// first may be there already.
struct Staging {
  VkBuffer buffer = VK_NULL_HANDLE;
  std::span<std::byte> bytes;
  std::uint64_t used = 0;
};

/// What was recorded.
struct Recorded {
  std::uint32_t dispatches = 0;
  std::uint64_t workgroups = 0;  ///< of direct dispatches
  std::uint32_t copies = 0;      ///< calls of vkCmdCopyBuffer
};

/// Records the commands of a plan that passed `ContextState::check`. `staging` has room for all its
/// uploads; null for a batch, which has none.
Recorded recordCommands(VkCommandBuffer commandBuffer, const ContextState& context,
                        const Plan& plan, const BoundBuffers& buffers, const DescriptorSets& sets,
                        Staging* staging = nullptr);

}  // namespace dermis::vulkan
