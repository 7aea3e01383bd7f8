#include "vulkan/dispatch_table.h"

#include <algorithm>
#include <string>
#include <string_view>

namespace dermis::vulkan {
namespace {

class Loader {
 public:
  explicit Loader(const DeviceDescription& description) : description_(description) {
    instanceFunction("vkGetDeviceProcAddr", getDeviceProcAddr_);
  }

  template <typename Function>
  void instanceFunction(const char* name, Function& function) {
    function =
        reinterpret_cast<Function>(description_.getInstanceProcAddr(description_.instance, name));
    if (function == nullptr) missing(name);
  }

  template <typename Function>
  void deviceFunction(const char* name, Function& function) {
    if (getDeviceProcAddr_ == nullptr) return;
    function = reinterpret_cast<Function>(getDeviceProcAddr_(description_.device, name));
    if (function == nullptr) missing(name);
  }

  bool isEnabled(std::string_view extension) const {
    return std::any_of(description_.enabledExtensions.begin(), description_.enabledExtensions.end(),
                       [&](const char* name) { return name != nullptr && extension == name; });
  }

  PFN_vkGetDeviceProcAddr deviceProcAddr() const { return getDeviceProcAddr_; }

  const std::string& firstMissing() const { return firstMissing_; }

 private:
  void missing(const char* name) {
    if (firstMissing_.empty()) firstMissing_ = name;
  }

  const DeviceDescription& description_;
  PFN_vkGetDeviceProcAddr getDeviceProcAddr_ = nullptr;
  std::string firstMissing_;
};

}  // namespace

Result<DispatchTable> loadDispatchTable(const DeviceDescription& description) {
  DispatchTable table;
  Loader loader(description);
  loader.instanceFunction("vkGetPhysicalDeviceProperties", table.getPhysicalDeviceProperties);
  loader.instanceFunction("vkGetPhysicalDeviceProperties2", table.getPhysicalDeviceProperties2);
  loader.instanceFunction("vkEnumerateDeviceExtensionProperties",
                          table.enumerateDeviceExtensionProperties);
  table.getDeviceProcAddr = loader.deviceProcAddr();

  loader.deviceFunction("vkCreateShaderModule", table.createShaderModule);
  loader.deviceFunction("vkDestroyShaderModule", table.destroyShaderModule);
  loader.deviceFunction("vkCreateDescriptorSetLayout", table.createDescriptorSetLayout);
  loader.deviceFunction("vkDestroyDescriptorSetLayout", table.destroyDescriptorSetLayout);
  loader.deviceFunction("vkCreatePipelineLayout", table.createPipelineLayout);
  loader.deviceFunction("vkDestroyPipelineLayout", table.destroyPipelineLayout);
  loader.deviceFunction("vkCreateComputePipelines", table.createComputePipelines);
  loader.deviceFunction("vkDestroyPipeline", table.destroyPipeline);
  loader.deviceFunction("vkCreateDescriptorPool", table.createDescriptorPool);
  loader.deviceFunction("vkDestroyDescriptorPool", table.destroyDescriptorPool);
  loader.deviceFunction("vkResetDescriptorPool", table.resetDescriptorPool);
  loader.deviceFunction("vkAllocateDescriptorSets", table.allocateDescriptorSets);
  loader.deviceFunction("vkUpdateDescriptorSets", table.updateDescriptorSets);
  loader.deviceFunction("vkCreateBufferView", table.createBufferView);
  loader.deviceFunction("vkDestroyBufferView", table.destroyBufferView);
  loader.deviceFunction("vkCmdBindPipeline", table.cmdBindPipeline);
  loader.deviceFunction("vkCmdBindDescriptorSets", table.cmdBindDescriptorSets);
  loader.deviceFunction("vkCmdPushConstants", table.cmdPushConstants);
  loader.deviceFunction("vkCmdPipelineBarrier", table.cmdPipelineBarrier);
  loader.deviceFunction("vkCmdDispatch", table.cmdDispatch);
  loader.deviceFunction("vkCmdDispatchIndirect", table.cmdDispatchIndirect);
  loader.deviceFunction("vkCmdCopyBuffer", table.cmdCopyBuffer);
  loader.deviceFunction("vkCmdFillBuffer", table.cmdFillBuffer);

  if (loader.isEnabled(VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME)) {
    loader.deviceFunction("vkCmdPushDescriptorSetKHR", table.cmdPushDescriptorSet);
  }
  if (loader.isEnabled(VK_EXT_DEBUG_UTILS_EXTENSION_NAME)) {
    loader.deviceFunction("vkSetDebugUtilsObjectNameEXT", table.setDebugUtilsObjectName);
    loader.deviceFunction("vkCmdBeginDebugUtilsLabelEXT", table.cmdBeginDebugUtilsLabel);
    loader.deviceFunction("vkCmdEndDebugUtilsLabelEXT", table.cmdEndDebugUtilsLabel);
  }
  if (!loader.firstMissing().empty()) {
    return Error{ErrorCode::missingEntryPoint, "the driver has no entry point '" +
                                                   loader.firstMissing() +
                                                   "' of a version or extension that was enabled"};
  }
  return table;
}

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
      return "initialization failed (VK_ERROR_INITIALIZATION_FAILED)";
    case VK_ERROR_OUT_OF_POOL_MEMORY:
      return "the descriptor pool is exhausted (VK_ERROR_OUT_OF_POOL_MEMORY)";
    case VK_ERROR_FRAGMENTATION:
      return "fragmentation (VK_ERROR_FRAGMENTATION)";
    case VK_ERROR_INVALID_SHADER_NV:
      return "the driver rejects the shader (VK_ERROR_INVALID_SHADER_NV)";
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
