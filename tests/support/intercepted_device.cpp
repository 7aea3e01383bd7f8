#include "intercepted_device.h"

#include <utility>

namespace dermis::test {
namespace {

InterceptedDevice* current = nullptr;

}  // namespace

InterceptedDevice::InterceptedDevice(vulkan::DeviceDescription description)
    : description_(description) {
  current = this;
  realProperties_ = reinterpret_cast<PFN_vkGetPhysicalDeviceProperties>(
      description.getInstanceProcAddr(description.instance, "vkGetPhysicalDeviceProperties"));
  realDeviceProcAddr_ = reinterpret_cast<PFN_vkGetDeviceProcAddr>(
      description.getInstanceProcAddr(description.instance, "vkGetDeviceProcAddr"));
}

InterceptedDevice::~InterceptedDevice() {
  current = nullptr;
}

void InterceptedDevice::changeLimits(std::function<void(VkPhysicalDeviceLimits&)> change) {
  changeLimits_ = std::move(change);
  replace("vkGetPhysicalDeviceProperties", getPhysicalDeviceProperties);
}

vulkan::DeviceDescription InterceptedDevice::description() const {
  vulkan::DeviceDescription description = description_;
  description.getInstanceProcAddr = getInstanceProcAddr;
  return description;
}

PFN_vkVoidFunction VKAPI_CALL InterceptedDevice::getInstanceProcAddr(VkInstance instance,
                                                                     const char* name) {
  if (std::string(name) == "vkGetDeviceProcAddr")
    return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
  const auto replacement = current->replacements_.find(name);
  if (replacement != current->replacements_.end()) return replacement->second;
  return current->description_.getInstanceProcAddr(instance, name);
}

PFN_vkVoidFunction VKAPI_CALL InterceptedDevice::getDeviceProcAddr(VkDevice device,
                                                                   const char* name) {
  const auto replacement = current->replacements_.find(name);
  if (replacement != current->replacements_.end()) return replacement->second;
  return current->realDeviceProcAddr_(device, name);
}

void VKAPI_CALL InterceptedDevice::getPhysicalDeviceProperties(
    VkPhysicalDevice device, VkPhysicalDeviceProperties* properties) {
  current->realProperties_(device, properties);
  current->changeLimits_(properties->limits);
}

}  // namespace dermis::test
