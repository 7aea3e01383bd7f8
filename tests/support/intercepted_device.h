// A device description whose entry points a test exchanges: what Dermis does on a device that lies
// about its limits, or when a command goes missing on its way to the driver.
#pragma once

#include <functional>
#include <map>
#include <string>

#include <vulkan/vulkan_core.h>

#include "dermis/vulkan/context.h"

namespace dermis::test {

/// One at a time: entry points are plain functions, so that what they refer to is global.
class InterceptedDevice {
 public:
  explicit InterceptedDevice(vulkan::DeviceDescription description);
  ~InterceptedDevice();
  InterceptedDevice(const InterceptedDevice&) = delete;
  InterceptedDevice& operator=(const InterceptedDevice&) = delete;

  /// Puts another function in the place of the one of that name.
  template <typename Function>
  void replace(const char* name, Function function) {
    replacements_[name] = reinterpret_cast<PFN_vkVoidFunction>(function);
  }
  /// Changes the limits that Dermis sees.
  void changeLimits(std::function<void(VkPhysicalDeviceLimits&)> change);

  vulkan::DeviceDescription description() const;

 private:
  static PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char* name);
  static PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char* name);
  static void VKAPI_CALL getPhysicalDeviceProperties(VkPhysicalDevice device,
                                                     VkPhysicalDeviceProperties* properties);

  vulkan::DeviceDescription description_;
  std::map<std::string, PFN_vkVoidFunction> replacements_;
  std::function<void(VkPhysicalDeviceLimits&)> changeLimits_;
  PFN_vkGetPhysicalDeviceProperties realProperties_ = nullptr;
  PFN_vkGetDeviceProcAddr realDeviceProcAddr_ = nullptr;
};

}  // namespace dermis::test
