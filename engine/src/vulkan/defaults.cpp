#include "vulkan/defaults.h"

namespace dermis::vulkan {
namespace {

// Of VkPhysicalDeviceProperties::vendorID: numbers of the PCI SIG.
constexpr std::uint32_t amd = 0x1002, intel = 0x8086;

}  // namespace

// Comments tell which values were measured and which are guesses; docs/gpus.md has the reasons.
DeviceDefaults defaultsOf(VkPhysicalDeviceType type, std::uint32_t vendor) {
  DeviceDefaults defaults;
  Tuning& tuning = defaults.tuning;
  tuning.workgroupSize = 64;
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_CPU:  // measured on lavapipe (docs/performance.md)
      defaults.texelBuffers = true;
      tuning.instancesPerInvocation = 24;
      tuning.verticesPerInvocation = 8;
      break;
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:  // a guess, but for the stores
      // The compilers of AMD and Intel merge the stores of words.
      defaults.stagedStores = vendor != amd && vendor != intel;
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
  return defaults;
}

}  // namespace dermis::vulkan
