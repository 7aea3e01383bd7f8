// What a device has to be asked for so that acceleration structures can be built on it and, where
// it can do so, traversed by ray queries.
#pragma once

#include <vector>

#include <vulkan/vulkan_core.h>

#include "vulkan_functions.h"

namespace dermis::samples {

class RayTracingFeatures {
 public:
  /// Neither.
  RayTracingFeatures() = default;
  /// What the device can do. It must have Vulkan 1.1.
  RayTracingFeatures(const VulkanFunctions& functions, VkPhysicalDevice device,
                     const std::vector<VkExtensionProperties>& extensions);

  bool accelerationStructures() const { return structures_.accelerationStructure == VK_TRUE; }
  bool rayQueries() const { return queries_.rayQuery == VK_TRUE; }

  /// The names of the extensions to enable, and their features for VkDeviceCreateInfo::pNext; none
  /// and null where the device has no acceleration structures. The chain is made of this object's
  /// members: it must stay where it is.
  std::vector<const char*> extensions() const;
  void* chain();

 private:
  VkPhysicalDeviceBufferDeviceAddressFeatures addresses_{};
  VkPhysicalDeviceAccelerationStructureFeaturesKHR structures_{};
  VkPhysicalDeviceRayQueryFeaturesKHR queries_{};
};

}  // namespace dermis::samples
