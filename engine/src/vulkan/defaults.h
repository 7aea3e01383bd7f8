// Defaults for a class of devices, if the engine does not choose.
#pragma once

#include <vulkan/vulkan_core.h>

#include "dermis/plan.h"
#include "vulkan/dispatch_table.h"

namespace dermis::vulkan {

/// They do not change any bit of the result.
struct DeviceDefaults {
  bool texelBuffers = false;  ///< `DeviceDescription::texelBuffers`
  bool stagedStores = false;  ///< `DeviceDescription::stagedStores`
  Tuning tuning;
};

DeviceDefaults defaultsOf(const DispatchTable& table, VkPhysicalDevice device,
                          const VkPhysicalDeviceProperties& properties);

}  // namespace dermis::vulkan
