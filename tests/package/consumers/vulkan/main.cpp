// Calls what dermis::core and dermis::vulkan can do without a device, and prints a hash of the
// kernels.

#include <bit>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include <vulkan/vulkan_core.h>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"

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
  job.places[Stream::positions] = {0, 16, VertexFormat::float16x4};
  job.places[Stream::normals] = {8, 16, VertexFormat::octahedral16x2};
  job.places[Stream::tangents] = {12, 16, VertexFormat::octahedral16x2};
  for (const std::uint32_t buffers : {storageBuffersWanted, 4u}) {
    DeviceLimits limits;
    limits.maxStorageBuffersPerStage = buffers;
    const std::vector<PipelineId> all = *pipelines(job, limits, Tuning{});
    std::printf("%zu pipelines\n", all.size());
    for (const PipelineId id : all) {
      const Result<vulkan::PipelineDescription> pipeline = vulkan::pipelineDescription(id);
      if (!pipeline || pipeline->spirv.size() < 100 || pipeline->spirv[0] != 0x07230203u)
        return false;
      if (pipeline->constants.empty() || pipeline->storageBuffers != buffers) return false;
    }
    if (all.empty()) return false;
  }
  return true;
}

/// The last pipeline for positions by one method.
std::optional<vulkan::PipelineDescription> skinKernel(Method method, bool texels) {
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  limits.texelBuffers = texels;
  const std::vector<PipelineId> all = *pipelines(PipelineNeeds{.method = method}, limits, Tuning{});
  Result<vulkan::PipelineDescription> pipeline = vulkan::pipelineDescription(all.back());
  if (!pipeline) return std::nullopt;
  return *pipeline;
}

/// Whether the kernels for comparison are there where no option leaves them out, and only there.
bool hasChosenKernels() {
#ifdef HAS_EVERYDAY_KERNELS_ONLY
  constexpr bool isLeftOut = true;
#else
  constexpr bool isLeftOut = false;
#endif
  const std::optional<vulkan::PipelineDescription> comparison =
      skinKernel(Method::logMatrix, false);
  return !comparison.has_value() == isLeftOut;
}

/// A hash (FNV-1a) of the kernels for every method, for GPUs and for CPU devices.
std::uint64_t hashOfKernels() {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (std::uint32_t method = 0; method < 9; ++method) {
    for (const bool texels : {false, true}) {
      const std::optional<vulkan::PipelineDescription> pipeline =
          skinKernel(static_cast<Method>(method), texels);
      if (!pipeline) continue;
      for (const std::uint32_t word : pipeline->spirv) hash = (hash ^ word) * 0x100000001b3u;
    }
  }
  return hash;
}

/// A triangle of one joint, with `value` for a coordinate.
bool isPackable(float value) {
  const float positions[9] = {value, 0, 0, 1, 0, 0, 0, 1, 0};
  const float weights[3] = {1, 1, 1};
  const std::uint8_t joints[3] = {};
  InfluenceSet influences;
  influences.joints = {joints, 3, 1, ComponentType::uint8, 1};
  influences.weights = attributeView(weights, 3, 1);
  MeshView mesh;
  mesh.name = "triangle";
  mesh.vertexCount = 3;
  mesh.positions = attributeView(positions, 3, 3);
  mesh.influenceSets = {&influences, 1};
  return pack(mesh, 1).ok();
}

}  // namespace

int main() {
  if (!libraryFitsHeaders()) {
    std::printf("the library is not of the headers' version\n");
    return 6;
  }
  if (libraryVersion() != headerVersion) return 7;
  // However this program is compiled, the library sees it.
  if (!isPackable(0) || isPackable(std::bit_cast<float>(0x7fc00000u))) {
    std::printf("pack accepts NaN\n");
    return 8;
  }
  std::printf("kernels %016llx\n", static_cast<unsigned long long>(hashOfKernels()));
  if (!hasKernels()) return 1;
  if (!hasChosenKernels()) return 5;
  if (vulkan::barrierBetween(Use::dermis, Use::vertexInput).destinationAccesses !=
      VK_ACCESS_VERTEX_ATTRIBUTE_READ_BIT)
    return 2;

  vulkan::DeviceDescription description;
  if (!refuses(description, ErrorCode::invalidArgument)) return 3;
  int anything = 0;  // handles are never looked into
  description.instance = reinterpret_cast<VkInstance>(&anything);
  description.physicalDevice = reinterpret_cast<VkPhysicalDevice>(&anything);
  description.device = reinterpret_cast<VkDevice>(&anything);
  description.getInstanceProcAddr = knowsNothing;
  description.apiVersion = VK_API_VERSION_1_1;
  if (!refuses(description, ErrorCode::missingEntryPoint)) return 4;
  return 0;
}
