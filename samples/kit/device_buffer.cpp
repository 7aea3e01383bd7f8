#include "kit/device_buffer.h"

#include <utility>

#include "kit/buffer.h"

namespace dermis::samples {

Result<DeviceBuffer> DeviceBuffer::create(Device& device, std::uint64_t size,
                                          VkBufferUsageFlags usage) {
  Result<BufferMemory> memory =
      BufferMemory::create(device, size, usage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT, 0,
                           VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
  if (!memory) return memory.error();
  DeviceBuffer buffer;
  buffer.buffer_ = std::move(*memory);
  return buffer;
}

Result<std::vector<std::byte>> DeviceBuffer::read() const {
  if (buffer_.size() == 0) return std::vector<std::byte>();
  Device& device = buffer_.device();
  const Result<MappedBuffer> copy =
      MappedBuffer::create(device, buffer_.size(), VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
  if (!copy) return copy.error();
  const VulkanFunctions& functions = device.functions();
  const VkCommandBuffer commandBuffer = device.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  functions.BeginCommandBuffer(commandBuffer, &begin);
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
  functions.CmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                               VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 1, &barrier, 0, nullptr, 0,
                               nullptr);
  const VkBufferCopy all{0, 0, buffer_.size()};
  functions.CmdCopyBuffer(commandBuffer, buffer_.handle(), copy->handle(), 1, &all);
  barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
  functions.CmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_TRANSFER_BIT,
                               VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0, nullptr, 0, nullptr);
  functions.EndCommandBuffer(commandBuffer);
  const Result<void> done = device.submitAndWait(commandBuffer);
  device.freeCommandBuffer(commandBuffer);
  if (!done) return done.error();
  return std::vector<std::byte>(copy->bytes().begin(), copy->bytes().end());
}

}  // namespace dermis::samples
