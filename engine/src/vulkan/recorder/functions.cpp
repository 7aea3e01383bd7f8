#include "vulkan/recorder/functions.h"

#include <string>

namespace dermis::vulkan {

Result<SystemFunctions> loadSystemFunctions(const ContextState& context) {
  SystemFunctions functions;
  std::string missing;
  const auto load = [&](const char* name, auto& function) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(
        context.table.getDeviceProcAddr(context.device, name));
    if (function == nullptr && missing.empty()) missing = name;
  };
  functions.getPhysicalDeviceMemoryProperties =
      reinterpret_cast<PFN_vkGetPhysicalDeviceMemoryProperties>(
          context.getInstanceProcAddr(context.instance, "vkGetPhysicalDeviceMemoryProperties"));
  load("vkAllocateMemory", functions.allocateMemory);
  load("vkFreeMemory", functions.freeMemory);
  load("vkMapMemory", functions.mapMemory);
  load("vkCreateBuffer", functions.createBuffer);
  load("vkDestroyBuffer", functions.destroyBuffer);
  load("vkGetBufferMemoryRequirements", functions.getBufferMemoryRequirements);
  load("vkBindBufferMemory", functions.bindBufferMemory);
  load("vkCreateQueryPool", functions.createQueryPool);
  load("vkDestroyQueryPool", functions.destroyQueryPool);
  load("vkGetQueryPoolResults", functions.getQueryPoolResults);
  load("vkCmdResetQueryPool", functions.cmdResetQueryPool);
  load("vkCmdWriteTimestamp", functions.cmdWriteTimestamp);
  if (functions.getPhysicalDeviceMemoryProperties == nullptr)
    missing = "vkGetPhysicalDeviceMemoryProperties";
  if (!missing.empty()) {
    return Error{ErrorCode::missingEntryPoint, "the driver has no entry point '" + missing + "'"};
  }
  return functions;
}

}  // namespace dermis::vulkan
