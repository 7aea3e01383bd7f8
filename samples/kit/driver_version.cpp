#include "kit/driver_version.h"

#include <algorithm>
#include <string_view>
#include <vector>

namespace dermis::samples {

std::string driverVersion(const Device& device) {
  const VulkanFunctions& functions = device.functions();
  const VkPhysicalDevice physicalDevice = device.description().physicalDevice;
  std::uint32_t count = 0;
  functions.EnumerateDeviceExtensionProperties(physicalDevice, nullptr, &count, nullptr);
  std::vector<VkExtensionProperties> extensions(count);
  functions.EnumerateDeviceExtensionProperties(physicalDevice, nullptr, &count, extensions.data());
  const bool isDescribed =
      std::any_of(extensions.begin(), extensions.end(), [](const VkExtensionProperties& extension) {
        return std::string_view(extension.extensionName) == VK_KHR_DRIVER_PROPERTIES_EXTENSION_NAME;
      });
  VkPhysicalDeviceDriverProperties driver{};
  driver.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES;
  VkPhysicalDeviceProperties2 properties{};
  properties.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
  if (isDescribed) properties.pNext = &driver;
  functions.GetPhysicalDeviceProperties2(physicalDevice, &properties);
  if (driver.driverName[0] == '\0')
    return "version " + std::to_string(properties.properties.driverVersion);
  return std::string(driver.driverName) + " " + driver.driverInfo;
}

}  // namespace dermis::samples
