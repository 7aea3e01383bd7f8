// Helpers for Vulkan objects, and for command buffers that are submitted once and waited for.
#pragma once

#include <utility>

#include "dermis/result.h"
#include "kit/device.h"

namespace dermis::viewer {

/// Moves what was made to its place.
template <typename Made, typename Place>
Result<void> keep(Result<Made> made, Place& place) {
  if (!made) return made.error();
  place = std::move(*made);
  return {};
}

inline VkCommandBuffer beginCommands(samples::Device& device) {
  const VkCommandBuffer commandBuffer = device.allocateCommandBuffer();
  VkCommandBufferBeginInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  device.functions().BeginCommandBuffer(commandBuffer, &info);
  return commandBuffer;
}

/// Makes copies to buffers visible to the CPU after `endCommands`.
inline void recordHostBarrier(const samples::Device& device, VkCommandBuffer commandBuffer) {
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
  device.functions().CmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_TRANSFER_BIT,
                                        VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0, nullptr, 0,
                                        nullptr);
}

/// Submits the commands and waits, unless recording them has failed. Returns what failed.
inline Result<void> endCommands(samples::Device& device, VkCommandBuffer commandBuffer,
                                Result<void> recorded) {
  device.functions().EndCommandBuffer(commandBuffer);
  if (recorded) recorded = device.submitAndWait(commandBuffer);
  device.freeCommandBuffer(commandBuffer);
  return recorded;
}

}  // namespace dermis::viewer
