#include "kit/barrier.h"

namespace dermis::samples {

void recordBarrier(const Device& device, VkCommandBuffer commandBuffer,
                   const vulkan::Dependency& dependency) {
  const VkMemoryBarrier barrier = vulkan::memoryBarrier(dependency);
  device.functions().CmdPipelineBarrier(commandBuffer, dependency.source.stages,
                                        dependency.destination.stages, 0, 1, &barrier, 0, nullptr,
                                        0, nullptr);
}

}  // namespace dermis::samples
