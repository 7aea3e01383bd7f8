#include "vulkan/vulkan_error.h"

#include <string>

namespace dermis::vulkan {
namespace {

const char* resultText(VkResult result) {
  switch (result) {
    case VK_ERROR_OUT_OF_HOST_MEMORY:
      return "out of host memory (VK_ERROR_OUT_OF_HOST_MEMORY)";
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
      return "out of device memory (VK_ERROR_OUT_OF_DEVICE_MEMORY)";
    case VK_ERROR_DEVICE_LOST:
      return "the device was lost (VK_ERROR_DEVICE_LOST)";
    case VK_ERROR_INITIALIZATION_FAILED:
      return "initialisation failed (VK_ERROR_INITIALIZATION_FAILED)";
    case VK_ERROR_OUT_OF_POOL_MEMORY:
      return "the descriptor pool is exhausted (VK_ERROR_OUT_OF_POOL_MEMORY)";
    case VK_ERROR_FRAGMENTATION:
      return "fragmentation (VK_ERROR_FRAGMENTATION)";
    case VK_ERROR_INVALID_SHADER_NV:
      return "the driver refuses the shader (VK_ERROR_INVALID_SHADER_NV)";
    default:
      return nullptr;
  }
}

}  // namespace

Error vulkanError(const char* function, VkResult result) {
  const char* text = resultText(result);
  return {ErrorCode::vulkanError,
          std::string(function) + " failed: " +
              (text != nullptr ? std::string(text)
                               : "VkResult " + std::to_string(static_cast<int>(result))),
          static_cast<std::int32_t>(result)};
}

}  // namespace dermis::vulkan
