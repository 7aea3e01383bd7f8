// The pipelines of a context. Any thread may build and read them.
#pragma once

#include <mutex>
#include <shared_mutex>
#include <span>
#include <unordered_map>
#include <vector>

#include <vulkan/vulkan_core.h>

#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/vulkan/context.h"
#include "vulkan/dispatch_table.h"

namespace dermis::vulkan {

class Pipelines {
 public:
  Pipelines(const DispatchTable& table, const DeviceDescription& description,
            const DeviceLimits& limits)
      : table_(table),
        limits_(limits),
        device_(description.device),
        cache_(description.pipelineCache),
        kernelSource_(description.kernelSource),
        allocator_(description.allocator) {}
  ~Pipelines();
  Pipelines(const Pipelines&) = delete;
  Pipelines& operator=(const Pipelines&) = delete;

  /// Builds a pipeline unless it exists. Fails with `missingFeature` if the device lacks a feature
  /// that it needs, or if this build of Dermis (or `kernelSource`) has no module for it.
  Result<void> build(PipelineId id, VkPipelineLayout layout);

  /// `Context::replaceKernels`.
  Result<std::uint32_t> replace(std::span<const KernelModule> modules, VkPipelineLayout layout,
                                std::uint64_t frame, std::uint64_t completedFrame);

  /// VK_NULL_HANDLE if it has not been built.
  VkPipeline find(PipelineId id) const;

  VkPipelineCache cache() const { return cache_; }

 private:
  using Built = std::unordered_map<PipelineId, VkPipeline>;
  struct Retired {
    VkPipeline pipeline = VK_NULL_HANDLE;
    std::uint64_t frame = 0;  ///< the last that may use it
  };

  Result<VkPipeline> create(const PipelineDescription& description, VkPipelineLayout layout) const;
  Result<VkPipeline> create(const PipelineDescription& description, VkPipelineLayout layout,
                            VkShaderModule module) const;
  Result<VkPipeline> createFromSource(PipelineId id, VkPipelineLayout layout) const;
  std::uint64_t generation() const;
  void destroy(const Built& pipelines) const;

  const DispatchTable& table_;
  const DeviceLimits& limits_;
  VkDevice device_;
  VkPipelineCache cache_;
  KernelSource kernelSource_;
  const VkAllocationCallbacks* allocator_;
  mutable std::shared_mutex mutex_;
  Built pipelines_;
  std::vector<Retired> retired_;
  std::uint64_t generation_ = 0;  ///< how often kernels have been replaced
};

}  // namespace dermis::vulkan
