// The entry points that a SceneRecorder needs besides those of a Context.
#pragma once

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"
#include "vulkan/state.h"

namespace dermis::vulkan {

struct SystemFunctions {
  PFN_vkGetPhysicalDeviceMemoryProperties getPhysicalDeviceMemoryProperties = nullptr;
  PFN_vkAllocateMemory allocateMemory = nullptr;
  PFN_vkFreeMemory freeMemory = nullptr;
  PFN_vkMapMemory mapMemory = nullptr;
  PFN_vkCreateBuffer createBuffer = nullptr;
  PFN_vkDestroyBuffer destroyBuffer = nullptr;
  PFN_vkGetBufferMemoryRequirements getBufferMemoryRequirements = nullptr;
  PFN_vkBindBufferMemory bindBufferMemory = nullptr;
  PFN_vkCreateQueryPool createQueryPool = nullptr;
  PFN_vkDestroyQueryPool destroyQueryPool = nullptr;
  PFN_vkGetQueryPoolResults getQueryPoolResults = nullptr;
  PFN_vkCmdResetQueryPool cmdResetQueryPool = nullptr;
  PFN_vkCmdWriteTimestamp cmdWriteTimestamp = nullptr;
};

/// Fails with `missingEntryPoint`, naming the function.
Result<SystemFunctions> loadSystemFunctions(const ContextState& context);

}  // namespace dermis::vulkan
