// Calls what dermis::vulkan can do without a device.

#include <cstdio>
#include <string>
#include <vector>

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

/// What an engine with a vertex of 16 bytes asks for while loading, and the modules of its
/// pipelines.
bool hasKernels() {
  Job job;
  job.positions = {0, 16, VertexFormat::float16x4};
  job.normals = {8, 16, VertexFormat::octahedral16x2};
  job.tangents = {12, 16, VertexFormat::octahedral16x2};
  const std::vector<Variant> variants = everyVariant(job, DeviceLimits{}, Tuning{});
  std::printf("%zu variants\n", variants.size());
  for (const std::uint32_t buffers : {storageBuffersWanted, 4u}) {
    DeviceLimits limits;
    limits.maxStorageBuffersPerStage = buffers;
    for (const Variant& variant : variants) {
      const std::span<const std::uint32_t> words = vulkan::kernelSpirv(variant, limits);
      if (words.size() < 100 || words[0] != 0x07230203u) return false;
      const vulkan::SpecializationConstants constants = vulkan::specializationConstants(variant);
      if (constants.count == 0 || constants.values[0] != variant.workgroupSize) return false;
    }
  }
  return !variants.empty();
}

/// Whether kernels that an option leaves out are there where it does not, and only there.
bool hasChosenKernels() {
#ifdef HAS_EVERYDAY_KERNELS_ONLY
  constexpr bool isLeftOut = true;
#else
  constexpr bool isLeftOut = false;
#endif
  Variant comparison, halves;
  comparison.method = Method::logMatrix;
  halves.units[0] = 2;
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  limits.storage16Bit = true;
  return vulkan::kernelSpirv(comparison, limits).empty() == isLeftOut &&
         vulkan::kernelSpirv(halves, limits).empty() == isLeftOut;
}

}  // namespace

int main() {
  if (!hasKernels()) return 1;
  if (!hasChosenKernels()) return 5;
  if (vulkan::outputScope(vulkan::Consumer::vertexInput).destination.accesses !=
      VK_ACCESS_VERTEX_ATTRIBUTE_READ_BIT)
    return 2;

  vulkan::DeviceDescription description;
  if (!refuses(description, ErrorCode::invalidArgument)) return 3;
  int anything = 0;  // handles are never looked into
  description.instance = reinterpret_cast<VkInstance>(&anything);
  description.physicalDevice = reinterpret_cast<VkPhysicalDevice>(&anything);
  description.device = reinterpret_cast<VkDevice>(&anything);
  description.getInstanceProcAddr = knowsNothing;
  if (!refuses(description, ErrorCode::missingEntryPoint)) return 4;
  return 0;
}
