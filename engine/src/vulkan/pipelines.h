// The pipelines of a context: built by any thread, read by all.
#pragma once

#include <mutex>
#include <shared_mutex>
#include <unordered_map>

#include <vulkan/vulkan_core.h>

#include "dermis/plan.h"
#include "dermis/result.h"
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
        allocator_(description.allocator) {}
  ~Pipelines();
  Pipelines(const Pipelines&) = delete;
  Pipelines& operator=(const Pipelines&) = delete;

  /// Nothing where it has been built. Fails with `missingFeature` where the device, or this build
  /// of Dermis, has no module for the variant.
  Result<void> build(const Variant& variant, VkPipelineLayout layout);

  /// VK_NULL_HANDLE where the variant has not been built.
  VkPipeline find(const Variant& variant) const;

  VkPipelineCache cache() const { return cache_; }

 private:
  Result<VkPipeline> create(const Variant& variant, VkPipelineLayout layout,
                            VkShaderModule module) const;

  const DispatchTable& table_;
  const DeviceLimits& limits_;
  VkDevice device_;
  VkPipelineCache cache_;
  const VkAllocationCallbacks* allocator_;
  mutable std::shared_mutex mutex_;
  std::unordered_map<std::uint64_t, VkPipeline> pipelines_;
};

}  // namespace dermis::vulkan
