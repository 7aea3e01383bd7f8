#include "vulkan/defaults.h"

#include <string_view>
#include <vector>

namespace dermis::vulkan {
namespace {

// Of VkPhysicalDeviceProperties::vendorID: numbers of the PCI SIG.
constexpr std::uint32_t amd = 0x1002, intel = 0x8086;

constexpr std::uint32_t workgroupSize = 64;

/// Properties of an extension that the physical device has. The device need not have enabled it.
template <typename Properties>
Properties propertiesOf(const DispatchTable& table, VkPhysicalDevice device, VkStructureType type) {
  Properties properties{};
  properties.sType = type;
  VkPhysicalDeviceProperties2 all{};
  all.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
  all.pNext = &properties;
  table.getPhysicalDeviceProperties2(device, &all);
  return properties;
}

/// The workgroups that a GPU has place for at a time; 0 if it does not tell.
std::uint32_t residentWorkgroups(const DispatchTable& table, VkPhysicalDevice device) {
  std::uint32_t count = 0;
  if (table.enumerateDeviceExtensionProperties(device, nullptr, &count, nullptr) != VK_SUCCESS)
    return 0;
  std::vector<VkExtensionProperties> extensions(count);
  if (table.enumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data()) !=
      VK_SUCCESS)
    return 0;
  for (const VkExtensionProperties& extension : extensions) {
    const std::string_view name = extension.extensionName;
    if (name == VK_NV_SHADER_SM_BUILTINS_EXTENSION_NAME) {
      const auto properties = propertiesOf<VkPhysicalDeviceShaderSMBuiltinsPropertiesNV>(
          table, device, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_SM_BUILTINS_PROPERTIES_NV);
      return properties.shaderSMCount * properties.shaderWarpsPerSM * 32 / workgroupSize;
    }
    if (name == VK_AMD_SHADER_CORE_PROPERTIES_EXTENSION_NAME) {
      const auto properties = propertiesOf<VkPhysicalDeviceShaderCorePropertiesAMD>(
          table, device, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_CORE_PROPERTIES_AMD);
      return properties.shaderEngineCount * properties.shaderArraysPerEngineCount *
             properties.computeUnitsPerShaderArray * properties.simdPerComputeUnit *
             properties.wavefrontsPerSimd * properties.wavefrontSize / workgroupSize;
    }
  }
  return 0;
}

}  // namespace

// Comments tell which values were measured and which are guesses; docs/gpus.md has the reasons.
DeviceDefaults defaultsOf(const DispatchTable& table, VkPhysicalDevice device,
                          const VkPhysicalDeviceProperties& properties) {
  DeviceDefaults defaults;
  Tuning& tuning = defaults.tuning;
  tuning.workgroupSize = workgroupSize;
  switch (properties.deviceType) {
    case VK_PHYSICAL_DEVICE_TYPE_CPU:  // measured on lavapipe (docs/performance.md)
      defaults.texelBuffers = true;
      tuning.instancesPerInvocation = 24;
      tuning.verticesPerInvocation = 8;
      break;
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:  // a guess, but for the stores
      // The compilers of AMD and Intel merge the stores of words.
      defaults.stagedStores = properties.vendorID != amd && properties.vendorID != intel;
      tuning.instancesPerInvocation = 4;
      tuning.minWorkgroups = 2048;
      break;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:  // a guess
      tuning.instancesPerInvocation = 4;
      tuning.minWorkgroups = 256;
      break;
    default:  // a guess
      tuning.instancesPerInvocation = 4;
      tuning.minWorkgroups = 2048;
  }
  if (tuning.minWorkgroups != 0) {
    if (const std::uint32_t resident = residentWorkgroups(table, device); resident != 0)
      tuning.minWorkgroups = resident;
  }
  return defaults;
}

}  // namespace dermis::vulkan
