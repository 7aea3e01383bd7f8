// The entry points of one device, error messages of failed calls, and names and labels for
// tools. A table per device: there is no global state that a second device could overwrite.
#pragma once

#include <cstdint>
#include <string>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"
#include "dermis/vulkan/context.h"

namespace dermis::vulkan {

struct DispatchTable {
  PFN_vkGetDeviceProcAddr getDeviceProcAddr = nullptr;
  PFN_vkGetPhysicalDeviceProperties getPhysicalDeviceProperties = nullptr;
  PFN_vkGetPhysicalDeviceProperties2 getPhysicalDeviceProperties2 = nullptr;
  PFN_vkEnumerateDeviceExtensionProperties enumerateDeviceExtensionProperties = nullptr;

  PFN_vkCreateShaderModule createShaderModule = nullptr;
  PFN_vkDestroyShaderModule destroyShaderModule = nullptr;
  PFN_vkCreateDescriptorSetLayout createDescriptorSetLayout = nullptr;
  PFN_vkDestroyDescriptorSetLayout destroyDescriptorSetLayout = nullptr;
  PFN_vkCreatePipelineLayout createPipelineLayout = nullptr;
  PFN_vkDestroyPipelineLayout destroyPipelineLayout = nullptr;
  PFN_vkCreateComputePipelines createComputePipelines = nullptr;
  PFN_vkDestroyPipeline destroyPipeline = nullptr;
  PFN_vkCreateDescriptorPool createDescriptorPool = nullptr;
  PFN_vkDestroyDescriptorPool destroyDescriptorPool = nullptr;
  PFN_vkResetDescriptorPool resetDescriptorPool = nullptr;
  PFN_vkAllocateDescriptorSets allocateDescriptorSets = nullptr;
  PFN_vkUpdateDescriptorSets updateDescriptorSets = nullptr;
  PFN_vkCreateBufferView createBufferView = nullptr;
  PFN_vkDestroyBufferView destroyBufferView = nullptr;

  PFN_vkCmdBindPipeline cmdBindPipeline = nullptr;
  PFN_vkCmdBindDescriptorSets cmdBindDescriptorSets = nullptr;
  PFN_vkCmdPushConstants cmdPushConstants = nullptr;
  PFN_vkCmdPipelineBarrier cmdPipelineBarrier = nullptr;
  PFN_vkCmdDispatch cmdDispatch = nullptr;
  PFN_vkCmdDispatchIndirect cmdDispatchIndirect = nullptr;
  PFN_vkCmdCopyBuffer cmdCopyBuffer = nullptr;
  PFN_vkCmdFillBuffer cmdFillBuffer = nullptr;

  // Null unless the engine enabled their extension.
  PFN_vkCmdPushDescriptorSetKHR cmdPushDescriptorSet = nullptr;
  PFN_vkSetDebugUtilsObjectNameEXT setDebugUtilsObjectName = nullptr;
  PFN_vkCmdBeginDebugUtilsLabelEXT cmdBeginDebugUtilsLabel = nullptr;
  PFN_vkCmdEndDebugUtilsLabelEXT cmdEndDebugUtilsLabel = nullptr;
};

/// Fails with `missingEntryPoint`, naming the function.
Result<DispatchTable> loadDispatchTable(const DeviceDescription& description);

/// "vkCreateBuffer failed: out of device memory (VK_ERROR_OUT_OF_DEVICE_MEMORY)".
Error vulkanError(const char* function, VkResult result);

/// Does nothing if VK_EXT_debug_utils was not enabled.
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

/// Labels the commands that are recorded during its lifetime. Does nothing if VK_EXT_debug_utils
/// was not enabled.
class Label {
 public:
  Label(const DispatchTable& table, VkCommandBuffer commandBuffer, const char* name)
      : table_(table), commandBuffer_(commandBuffer) {
    if (table_.cmdBeginDebugUtilsLabel == nullptr) return;
    VkDebugUtilsLabelEXT label{};
    label.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_LABEL_EXT;
    label.pLabelName = name;
    table_.cmdBeginDebugUtilsLabel(commandBuffer_, &label);
  }
  ~Label() {
    if (table_.cmdEndDebugUtilsLabel != nullptr) table_.cmdEndDebugUtilsLabel(commandBuffer_);
  }
  Label(const Label&) = delete;
  Label& operator=(const Label&) = delete;

 private:
  const DispatchTable& table_;
  VkCommandBuffer commandBuffer_;
};

}  // namespace dermis::vulkan
