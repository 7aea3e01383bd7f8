// Names for Vulkan objects, in tools and in what validation layers say.
#pragma once

#include <cstdint>
#include <string>

#include "vulkan/dispatch_table.h"

namespace dermis::vulkan {

/// Nothing where VK_EXT_debug_utils was not enabled.
template <typename Handle>
void nameObject(const DispatchTable& table, VkDevice device, VkObjectType type, Handle handle,
                const std::string& name) {
  if (table.setDebugUtilsObjectName == nullptr || handle == VK_NULL_HANDLE) return;
  VkDebugUtilsObjectNameInfoEXT info{};
  info.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT;
  info.objectType = type;
  info.objectHandle = reinterpret_cast<std::uint64_t>(handle);
  info.pObjectName = name.c_str();
  table.setDebugUtilsObjectName(device, &info);
}

}  // namespace dermis::vulkan
