// Calls what dermis::vulkan can do without a device.

#include <cstdio>
#include <string>

#include "dermis/dermis.h"
#include "dermis/vulkan/vulkan.h"

namespace {

using namespace dermis;

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL knowsNothing(VkInstance, const char*) {
  return nullptr;
}

/// Whether making a Context fails with that code.
bool refuses(const vulkan::DeviceDescription& description, ErrorCode code) {
  const Result<vulkan::Context> context = vulkan::Context::create(description);
  if (context) return false;
  std::printf("%s: %s\n", std::string(errorCodeName(context.error().code)).c_str(),
              context.error().message.c_str());
  return context.error().code == code;
}

}  // namespace

int main() {
  for (const Kernel kernel : {Kernel::palette, Kernel::skin}) {
    const std::span<const std::uint32_t> words = vulkan::kernelSpirv(kernel);
    if (words.size() < 100 || words[0] != 0x07230203u) return 1;
  }
  if (vulkan::specializationConstants(Variant{}).values[0] != Variant{}.workgroupSize) return 2;
  if (vulkan::outputScope(vulkan::Consumer::vertexInput).destination.accesses !=
      VK_ACCESS_VERTEX_ATTRIBUTE_READ_BIT)
    return 3;

  vulkan::DeviceDescription description;
  if (!refuses(description, ErrorCode::invalidArgument)) return 4;
  int anything = 0;  // handles are never looked into
  description.instance = reinterpret_cast<VkInstance>(&anything);
  description.physicalDevice = reinterpret_cast<VkPhysicalDevice>(&anything);
  description.device = reinterpret_cast<VkDevice>(&anything);
  description.getInstanceProcAddr = knowsNothing;
  if (!refuses(description, ErrorCode::missingEntryPoint)) return 5;
  return 0;
}
