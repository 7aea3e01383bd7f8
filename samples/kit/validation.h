// Enables core and synchronization checks of the Khronos validation layer, old or new.
#pragma once

#include <vector>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"

namespace dermis::samples {

/// The structures for VkInstanceCreateInfo. The object must live until the instance is created.
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

}  // namespace dermis::samples
