#include "kit/validation.h"

#include <algorithm>
#include <cstring>
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

}  // namespace dermis::samples
