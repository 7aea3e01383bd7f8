// The extensions and features to enable for acceleration structures and, if available, ray queries.
#pragma once

#include <vector>

#include <vulkan/vulkan_core.h>

#include "kit/vulkan_loader.h"

namespace dermis::samples {

class RayTracingFeatures {
 public:
  /// Enables nothing.
  RayTracingFeatures() = default;
  /// Queries the features of the device, which must support Vulkan 1.1.
  RayTracingFeatures(const VulkanFunctions& functions, VkPhysicalDevice device,
                     const std::vector<VkExtensionProperties>& extensions);

  bool accelerationStructures() const { return structures_.accelerationStructure == VK_TRUE; }
  bool rayQueries() const { return queries_.rayQuery == VK_TRUE; }

  /// The names of the extensions to enable, and their features for VkDeviceCreateInfo::pNext. Empty
  /// and null if the device has no acceleration structures. The chain consists of members of this
  /// object, so the object must not be moved while the chain is used.
  std::vector<const char*> extensions() const;
  void* chain();

 private:
  VkPhysicalDeviceBufferDeviceAddressFeatures addresses_{};
  VkPhysicalDeviceAccelerationStructureFeaturesKHR structures_{};
  VkPhysicalDeviceRayQueryFeaturesKHR queries_{};
};

}  // namespace dermis::samples
