#include "kit/ray_tracing_features.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <span>

namespace dermis::samples {
namespace {

// Each extension with those that it depends on and that Vulkan 1.1 does not contain.
constexpr std::array structureExtensions{
    VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME, VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
    VK_KHR_BUFFER_DEVICE_ADDRESS_EXTENSION_NAME, VK_EXT_DESCRIPTOR_INDEXING_EXTENSION_NAME};
constexpr std::array queryExtensions{VK_KHR_RAY_QUERY_EXTENSION_NAME,
                                     VK_KHR_SPIRV_1_4_EXTENSION_NAME,
                                     VK_KHR_SHADER_FLOAT_CONTROLS_EXTENSION_NAME};

bool hasAll(const std::vector<VkExtensionProperties>& extensions,
            std::span<const char* const> names) {
  return std::ranges::all_of(names, [&](const char* name) {
    return std::ranges::any_of(extensions, [&](const VkExtensionProperties& extension) {
      return std::strcmp(extension.extensionName, name) == 0;
    });
  });
}

}  // namespace

RayTracingFeatures::RayTracingFeatures(const VulkanFunctions& functions, VkPhysicalDevice device,
                                       const std::vector<VkExtensionProperties>& extensions) {
  if (!hasAll(extensions, structureExtensions)) return;
  VkPhysicalDeviceBufferDeviceAddressFeatures addresses{};
  addresses.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES;
  VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{};
  structures.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR;
  structures.pNext = &addresses;
  VkPhysicalDeviceRayQueryFeaturesKHR queries{};
  queries.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR;
  if (hasAll(extensions, queryExtensions)) addresses.pNext = &queries;
  VkPhysicalDeviceFeatures2 features{};
  features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  features.pNext = &structures;
  functions.GetPhysicalDeviceFeatures2(device, &features);
  if (addresses.bufferDeviceAddress != VK_TRUE || structures.accelerationStructure != VK_TRUE)
    return;
  // Optional features, such as capture and replay or host builds, stay disabled.
  addresses_.sType = addresses.sType;
  addresses_.bufferDeviceAddress = VK_TRUE;
  structures_.sType = structures.sType;
  structures_.accelerationStructure = VK_TRUE;
  queries_.sType = queries.sType;
  queries_.rayQuery = queries.rayQuery;
}

std::vector<const char*> RayTracingFeatures::extensions() const {
  std::vector<const char*> names;
  if (accelerationStructures()) std::ranges::copy(structureExtensions, std::back_inserter(names));
  if (rayQueries()) std::ranges::copy(queryExtensions, std::back_inserter(names));
  return names;
}

void* RayTracingFeatures::chain() {
  if (!accelerationStructures()) return nullptr;
  structures_.pNext = &addresses_;
  addresses_.pNext = rayQueries() ? &queries_ : nullptr;
  return &structures_;
}

}  // namespace dermis::samples
