// A Vulkan layer that makes a device look like one of another kind: its type, and limits that are
// no better than those of the profile that DERMIS_DEVICE_PROFILE names (device_profiles.h). Below
// the validation layer, which then holds programs to these limits.

#include <vulkan/vk_layer.h>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <string>

#include "device_profiles.h"

namespace dermis::test {
namespace {

struct Layer {
  std::mutex mutex;
  std::map<VkInstance, PFN_vkGetInstanceProcAddr> instances;
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
  auto* link = static_cast<VkLayerInstanceCreateInfo*>(const_cast<void*>(info->pNext));
  while (link->sType != VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO ||
         link->function != VK_LAYER_LINK_INFO)
    link = static_cast<VkLayerInstanceCreateInfo*>(const_cast<void*>(link->pNext));
  const PFN_vkGetInstanceProcAddr next = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
  link->u.pLayerInfo = link->u.pLayerInfo->pNext;
  const auto create = reinterpret_cast<PFN_vkCreateInstance>(next(nullptr, "vkCreateInstance"));
  const VkResult result = create(info, callbacks, instance);
  if (result != VK_SUCCESS) return result;
  const std::lock_guard lock(layer().mutex);
  layer().instances[*instance] = next;
  layer().properties = reinterpret_cast<PFN_vkGetPhysicalDeviceProperties>(
      next(*instance, "vkGetPhysicalDeviceProperties"));
  layer().properties2 = reinterpret_cast<PFN_vkGetPhysicalDeviceProperties2>(
      next(*instance, "vkGetPhysicalDeviceProperties2"));
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
  PFN_vkGetInstanceProcAddr next = nullptr;
  {
    const std::lock_guard lock(layer().mutex);
    next = layer().instances[instance];
  }
  return next != nullptr ? next(instance, name) : nullptr;
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
