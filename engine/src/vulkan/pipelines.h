// The pipelines of a context: built by any thread, read by all.
#pragma once

#include <mutex>
#include <shared_mutex>
#include <span>
#include <unordered_map>

#include <vulkan/vulkan_core.h>

#include "dermis/plan.h"
#include "dermis/result.h"
#include "vulkan/dispatch_table.h"

namespace dermis::vulkan {

class Pipelines {
 public:
  Pipelines(const DispatchTable& table, const DeviceDescription& description)
      : table_(table),
        device_(description.device),
        cache_(description.pipelineCache),
        allocator_(description.allocator) {}
  ~Pipelines();
  Pipelines(const Pipelines&) = delete;
  Pipelines& operator=(const Pipelines&) = delete;

  /// Creates the shader modules.
  Result<void> create();

  Result<void> build(const Variant& variant, VkPipelineLayout layout);

  /// VK_NULL_HANDLE where the variant has not been built.
  VkPipeline find(const Variant& variant) const;

 private:
  VkShaderModule moduleOf(Kernel kernel) const {
    return kernel == Kernel::palette ? paletteModule_ : skinModule_;
  }

  const DispatchTable& table_;
  VkDevice device_;
  VkPipelineCache cache_;
  const VkAllocationCallbacks* allocator_;
  VkShaderModule paletteModule_ = VK_NULL_HANDLE;
  VkShaderModule skinModule_ = VK_NULL_HANDLE;
  mutable std::shared_mutex mutex_;
  std::unordered_map<std::uint64_t, VkPipeline> pipelines_;
};

}  // namespace dermis::vulkan
