// A Vulkan layer that makes a device look like one of another kind: its type, and limits that are
// no better than those of the profile that DERMIS_DEVICE_PROFILE names (device_profiles.h). Below
// the validation layer, which then holds programs to these limits.

#include <vulkan/vk_layer.h>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include "device_profiles.h"
#include "next_layer.h"

namespace dermis::test {
namespace {

struct Layer {
  NextLayer next;
  PFN_vkGetPhysicalDeviceProperties properties = nullptr;
  PFN_vkGetPhysicalDeviceProperties2 properties2 = nullptr;
};

/// Never destroyed: drivers have threads that end late.
Layer& layer() {
  static Layer& made = *new Layer;
  return made;
}

const DeviceProfile& profile() {
  static const DeviceProfile& chosen = []() -> const DeviceProfile& {
    const char* name = std::getenv("DERMIS_DEVICE_PROFILE");
    for (const DeviceProfile& one : deviceProfiles) {
      if (name != nullptr && one.name == name) return one;
    }
    std::fprintf(stderr, "there is no device profile '%s'\n", name != nullptr ? name : "");
    std::abort();
  }();
  return chosen;
}

void change(VkPhysicalDeviceProperties& properties) {
  properties.deviceType = profile().type;
  properties.vendorID = profile().vendor;
  lowerLimits(profile(), properties.limits);
}

VKAPI_ATTR void VKAPI_CALL getProperties(VkPhysicalDevice device,
                                         VkPhysicalDeviceProperties* properties) {
  layer().properties(device, properties);
  change(*properties);
}

VKAPI_ATTR void VKAPI_CALL getProperties2(VkPhysicalDevice device,
                                          VkPhysicalDeviceProperties2* properties) {
  layer().properties2(device, properties);
  change(properties->properties);
}

VKAPI_ATTR VkResult VKAPI_CALL createInstance(const VkInstanceCreateInfo* info,
                                              const VkAllocationCallbacks* callbacks,
                                              VkInstance* instance) {
  const VkResult result = layer().next.createInstance(info, callbacks, instance);
  if (result != VK_SUCCESS) return result;
  layer().properties = reinterpret_cast<PFN_vkGetPhysicalDeviceProperties>(
      layer().next.function(*instance, "vkGetPhysicalDeviceProperties"));
  layer().properties2 = reinterpret_cast<PFN_vkGetPhysicalDeviceProperties2>(
      layer().next.function(*instance, "vkGetPhysicalDeviceProperties2"));
  return result;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance,
                                                             const char* name) {
  const std::map<std::string, PFN_vkVoidFunction> own{
      {"vkGetInstanceProcAddr", reinterpret_cast<PFN_vkVoidFunction>(getInstanceProcAddr)},
      {"vkCreateInstance", reinterpret_cast<PFN_vkVoidFunction>(createInstance)},
      {"vkGetPhysicalDeviceProperties", reinterpret_cast<PFN_vkVoidFunction>(getProperties)},
      {"vkGetPhysicalDeviceProperties2", reinterpret_cast<PFN_vkVoidFunction>(getProperties2)},
      {"vkGetPhysicalDeviceProperties2KHR", reinterpret_cast<PFN_vkVoidFunction>(getProperties2)}};
  if (const auto found = own.find(name); found != own.end()) return found->second;
  return layer().next.function(instance, name);
}

}  // namespace
}  // namespace dermis::test

extern "C" __attribute__((visibility("default"))) VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* interface) {
  interface->loaderLayerInterfaceVersion = 2;
  interface->pfnGetInstanceProcAddr = dermis::test::getInstanceProcAddr;
  interface->pfnGetDeviceProcAddr = nullptr;
  interface->pfnGetPhysicalDeviceProcAddr = nullptr;
  return VK_SUCCESS;
}
