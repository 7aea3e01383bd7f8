#include "dermis/vulkan/scope.h"

#include <vulkan/vulkan_core.h>

#include "dermis/vulkan/bindings.h"

namespace dermis::vulkan {
namespace {

constexpr VkPipelineStageFlags compute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;

/// Of a number that is no value of its enum: a barrier with it is right for any use.
constexpr Scope anyUse{VK_PIPELINE_STAGE_ALL_COMMANDS_BIT,
                       VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT};

Scope scopeOf(Consumer consumer) {
  switch (consumer) {
    case Consumer::vertexInput:
      return {VK_PIPELINE_STAGE_VERTEX_INPUT_BIT, VK_ACCESS_VERTEX_ATTRIBUTE_READ_BIT};
    case Consumer::vertexShader:
      return {VK_PIPELINE_STAGE_VERTEX_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT};
    case Consumer::fragmentShader:
      return {VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT};
    case Consumer::taskShader:
      return {VK_PIPELINE_STAGE_TASK_SHADER_BIT_EXT, VK_ACCESS_SHADER_READ_BIT};
    case Consumer::meshShader:
      return {VK_PIPELINE_STAGE_MESH_SHADER_BIT_EXT, VK_ACCESS_SHADER_READ_BIT};
    case Consumer::rayTracingShader:
      return {VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR, VK_ACCESS_SHADER_READ_BIT};
    case Consumer::compute:
      return {compute, VK_ACCESS_SHADER_READ_BIT};
    case Consumer::accelerationStructureBuild:
      // The build reads its geometry as shader reads (VK_KHR_acceleration_structure).
      return {VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR, VK_ACCESS_SHADER_READ_BIT};
    case Consumer::transfer:
      return {VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_READ_BIT};
    case Consumer::hostRead:
      return {VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT};
  }
  return anyUse;
}

// The structures of Vulkan 1.0 and of synchronization2 have the same members, except for the
// stages.

template <typename Barrier>
Barrier withAccesses(VkStructureType type, const Dependency& dependency) {
  Barrier barrier{};
  barrier.sType = type;
  barrier.srcAccessMask = dependency.source.accesses;
  barrier.dstAccessMask = dependency.destination.accesses;
  return barrier;
}

template <typename Barrier>
void setStages(Barrier& barrier, const Dependency& dependency) {
  barrier.srcStageMask = dependency.source.stages;
  barrier.dstStageMask = dependency.destination.stages;
}

template <typename Barrier>
void setRange(Barrier& barrier, const BufferRange& range, std::uint32_t sourceFamily,
              std::uint32_t destinationFamily) {
  barrier.srcQueueFamilyIndex = sourceFamily;
  barrier.dstQueueFamilyIndex = destinationFamily;
  barrier.buffer = range.buffer;
  barrier.offset = range.offset;
  barrier.size = range.size;
}

}  // namespace

Dependency inputScope(PreviousUse use) {
  const Scope reads{compute, VK_ACCESS_SHADER_READ_BIT};
  const Scope uses{compute, VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT};
  // To overwrite data that was only read, an execution dependency is enough.
  const auto afterReader = [](Consumer reader) {
    return Dependency{{scopeOf(reader).stages, 0}, {compute, 0}};
  };
  switch (use) {
    case PreviousUse::hostWrite:
      return {{VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_WRITE_BIT}, reads};
    case PreviousUse::transferWrite:
      return {{VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT}, uses};
    case PreviousUse::computeWrite:
      return {{compute, VK_ACCESS_SHADER_WRITE_BIT}, uses};
    case PreviousUse::vertexInput:
      return afterReader(Consumer::vertexInput);
    case PreviousUse::vertexShader:
      return afterReader(Consumer::vertexShader);
    case PreviousUse::fragmentShader:
      return afterReader(Consumer::fragmentShader);
    case PreviousUse::taskShader:
      return afterReader(Consumer::taskShader);
    case PreviousUse::meshShader:
      return afterReader(Consumer::meshShader);
    case PreviousUse::rayTracingShader:
      return afterReader(Consumer::rayTracingShader);
    case PreviousUse::compute:
      return afterReader(Consumer::compute);
    case PreviousUse::accelerationStructureBuild:
      return afterReader(Consumer::accelerationStructureBuild);
    case PreviousUse::transfer:
      return afterReader(Consumer::transfer);
    case PreviousUse::previousRecord:
      return {{compute, VK_ACCESS_SHADER_WRITE_BIT}, uses};
  }
  return {anyUse, uses};
}

// The kernels only read, so the source needs no access. The barrier before that `record` made the
// earlier writes available. To write after them, the destination needs an access.
Dependency overwriteScope(Writer writer) {
  switch (writer) {
    case Writer::compute:
      return {{compute, 0}, {compute, VK_ACCESS_SHADER_WRITE_BIT}};
    case Writer::transfer:
      return {{compute, 0}, {VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT}};
  }
  return {{compute, 0}, anyUse};
}

Dependency outputScope(Consumer consumer, QueueTransfer transfer) {
  Dependency dependency{{compute, VK_ACCESS_SHADER_WRITE_BIT}, scopeOf(consumer)};
  if (consumer == Consumer::hostRead) return dependency;
  if (transfer == QueueTransfer::release)
    dependency.destination = {VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 0};
  if (transfer == QueueTransfer::acquire)
    dependency.source = {VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, 0};
  return dependency;
}

VkMemoryBarrier memoryBarrier(const Dependency& dependency) {
  return withAccesses<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER, dependency);
}

VkBufferMemoryBarrier bufferBarrier(const Dependency& dependency, VkBuffer buffer,
                                    VkDeviceSize offset, VkDeviceSize size,
                                    std::uint32_t sourceFamily, std::uint32_t destinationFamily) {
  auto barrier =
      withAccesses<VkBufferMemoryBarrier>(VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER, dependency);
  setRange(barrier, {buffer, offset, size}, sourceFamily, destinationFamily);
  return barrier;
}

VkMemoryBarrier2 memoryBarrier2(const Dependency& dependency) {
  auto barrier = withAccesses<VkMemoryBarrier2>(VK_STRUCTURE_TYPE_MEMORY_BARRIER_2, dependency);
  setStages(barrier, dependency);
  return barrier;
}

VkBufferMemoryBarrier2 bufferBarrier2(const Dependency& dependency, VkBuffer buffer,
                                      VkDeviceSize offset, VkDeviceSize size,
                                      std::uint32_t sourceFamily, std::uint32_t destinationFamily) {
  auto barrier =
      withAccesses<VkBufferMemoryBarrier2>(VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER_2, dependency);
  setStages(barrier, dependency);
  setRange(barrier, {buffer, offset, size}, sourceFamily, destinationFamily);
  return barrier;
}

}  // namespace dermis::vulkan
