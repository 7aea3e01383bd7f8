// Optional extensions and features of instances and devices.
#pragma once

#include <vector>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"
#include "kit/vulkan_loader.h"

namespace dermis::samples {

/// Core and synchronization checks of the Khronos validation layer, old or new: the structures for
/// VkInstanceCreateInfo. The object must live until the instance is created.
class ValidationRequest {
 public:
  /// Fails with `missingFeature` if the layer is not installed.
  Result<void> prepare(PFN_vkGetInstanceProcAddr getInstanceProcAddr, const char* layer);

  const void* chain() const { return &features_; }
  const std::vector<const char*>& extensions() const { return extensions_; }

 private:
  // VK_EXT_layer_settings (Vulkan 1.4), declared here because Debian 12's headers are older.
  struct LayerSetting {
    const char* layerName;
    const char* settingName;
    int type;  // VK_LAYER_SETTING_TYPE_BOOL32_EXT is 0
    std::uint32_t valueCount;
    const void* values;
  };
  struct LayerSettings {
    VkStructureType sType;
    const void* pNext;
    std::uint32_t settingCount;
    const LayerSetting* settings;
  };

  const VkValidationFeatureEnableEXT synchronization_ =
      VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
  const VkBool32 on_ = VK_TRUE;
  VkValidationFeaturesEXT features_{};
  LayerSetting shaderAccesses_{};
  LayerSettings settings_{};
  std::vector<const char*> extensions_;
};

/// Acceleration structures and, if available, ray queries.
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
