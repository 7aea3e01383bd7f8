// The Vulkan loader, opened at run time.
#pragma once

#include <memory>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"

namespace dermis::samples {

class VulkanLoader {
 public:
  /// Opens libvulkan.so.1, or vulkan-1.dll on Windows. Fails with `missingFeature` if there is
  /// none.
  static Result<std::shared_ptr<VulkanLoader>> open();
  ~VulkanLoader();
  VulkanLoader(const VulkanLoader&) = delete;
  VulkanLoader& operator=(const VulkanLoader&) = delete;

  PFN_vkGetInstanceProcAddr getInstanceProcAddr = nullptr;

 private:
  VulkanLoader() = default;
  void* library_ = nullptr;
};

}  // namespace dermis::samples
