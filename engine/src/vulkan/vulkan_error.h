// Vulkan's error codes as errors of Dermis.
#pragma once

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"

namespace dermis::vulkan {

/// "vkCreateBuffer failed: out of device memory (VK_ERROR_OUT_OF_DEVICE_MEMORY)".
Error vulkanError(const char* function, VkResult result);

}  // namespace dermis::vulkan
