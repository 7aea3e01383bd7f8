// What kernels do on a class of devices if the engine does not say otherwise.
#pragma once

#include <vulkan/vulkan_core.h>

#include "dermis/plan.h"

namespace dermis::vulkan {

/// None of it changes a bit of the result.
struct DeviceDefaults {
  bool texelBuffers = false;  ///< `DeviceDescription::texelBuffers`
  bool stagedStores = false;  ///< `DeviceDescription::stagedStores`
  Tuning tuning;
};

DeviceDefaults defaultsOf(VkPhysicalDeviceType type);

}  // namespace dermis::vulkan
