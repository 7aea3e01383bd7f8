#include "kit/device_extensions.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <span>
#include <string>

namespace dermis::samples {
namespace {

constexpr const char* layerSettingsExtension = "VK_EXT_layer_settings";
constexpr auto layerSettingsType = static_cast<VkStructureType>(1000496000);

}  // namespace

Result<void> ValidationRequest::prepare(PFN_vkGetInstanceProcAddr getInstanceProcAddr,
                                        const char* layer) {
  const auto enumerateLayers = reinterpret_cast<PFN_vkEnumerateInstanceLayerProperties>(
      getInstanceProcAddr(nullptr, "vkEnumerateInstanceLayerProperties"));
  const auto enumerateExtensions = reinterpret_cast<PFN_vkEnumerateInstanceExtensionProperties>(
      getInstanceProcAddr(nullptr, "vkEnumerateInstanceExtensionProperties"));
  std::uint32_t count = 0;
  enumerateLayers(&count, nullptr);
  std::vector<VkLayerProperties> layers(count);
  enumerateLayers(&count, layers.data());
  if (std::none_of(layers.begin(), layers.end(), [&](const VkLayerProperties& found) {
        return std::strcmp(found.layerName, layer) == 0;
      })) {
    return Error{ErrorCode::missingFeature,
                 std::string("the layer ") + layer + " is not installed"};
  }
  enumerateExtensions(layer, &count, nullptr);
  std::vector<VkExtensionProperties> extensions(count);
  enumerateExtensions(layer, &count, extensions.data());
  const bool hasSettings =
      std::any_of(extensions.begin(), extensions.end(), [](const VkExtensionProperties& found) {
        return std::strcmp(found.extensionName, layerSettingsExtension) == 0;
      });

  features_.sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT;
  features_.enabledValidationFeatureCount = 1;
  features_.pEnabledValidationFeatures = &synchronization_;
  extensions_ = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME, VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
  if (hasSettings) {
    // Newer layers check the accesses of shaders only with this setting. Without it, they do not
    // report a missing barrier between two dispatches.
    shaderAccesses_ = {layer, "syncval_shader_accesses_heuristic", 0, 1, &on_};
    settings_ = {layerSettingsType, nullptr, 1, &shaderAccesses_};
    features_.pNext = &settings_;
    extensions_.push_back(layerSettingsExtension);
  }
  return {};
}

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
