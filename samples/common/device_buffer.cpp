#include "device_buffer.h"

#include <string>
#include <utility>

#include "buffer.h"

namespace dermis::samples {
namespace {

Error failed(const char* function, std::uint64_t size, VkResult result) {
  return {ErrorCode::vulkanError,
          std::string(function) + " failed for a buffer of " + std::to_string(size) +
              " bytes with VkResult " + std::to_string(static_cast<int>(result)),
          static_cast<std::int32_t>(result)};
}

}  // namespace

Result<DeviceBuffer> DeviceBuffer::create(Device& device, std::uint64_t size,
                                          VkBufferUsageFlags usage) {
  DeviceBuffer buffer;
  if (size == 0) return buffer;
  buffer.device_ = &device;
  buffer.size_ = size;
  const VulkanFunctions& functions = device.functions();
  VkBufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = size;
  info.usage = usage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
  if (const VkResult result =
          functions.CreateBuffer(device.handle(), &info, nullptr, &buffer.buffer_);
      result != VK_SUCCESS)
    return failed("vkCreateBuffer", size, result);
  VkMemoryRequirements requirements{};
  functions.GetBufferMemoryRequirements(device.handle(), buffer.buffer_, &requirements);
  const Result<std::uint32_t> type =
      device.memoryType(requirements.memoryTypeBits, 0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
  if (!type) return type.error();
  VkMemoryAllocateInfo allocateInfo{};
  allocateInfo.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  allocateInfo.allocationSize = requirements.size;
  allocateInfo.memoryTypeIndex = *type;
  if (const VkResult result =
          functions.AllocateMemory(device.handle(), &allocateInfo, nullptr, &buffer.memory_);
      result != VK_SUCCESS)
    return failed("vkAllocateMemory", size, result);
  if (const VkResult result =
          functions.BindBufferMemory(device.handle(), buffer.buffer_, buffer.memory_, 0);
      result != VK_SUCCESS)
    return failed("vkBindBufferMemory", size, result);
  return buffer;
}

DeviceBuffer::~DeviceBuffer() {
  if (device_ == nullptr) return;
  device_->functions().DestroyBuffer(device_->handle(), buffer_, nullptr);
  device_->functions().FreeMemory(device_->handle(), memory_, nullptr);
}

DeviceBuffer& DeviceBuffer::operator=(DeviceBuffer&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(buffer_, other.buffer_);
  std::swap(memory_, other.memory_);
  std::swap(size_, other.size_);
  return *this;
}

Result<std::vector<std::byte>> DeviceBuffer::read() const {
  if (size_ == 0) return std::vector<std::byte>();
  const Result<MappedBuffer> copy =
      MappedBuffer::create(*device_, size_, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
  if (!copy) return copy.error();
  const VulkanFunctions& functions = device_->functions();
  const VkCommandBuffer commandBuffer = device_->allocateCommandBuffer();
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
  const VkBufferCopy all{0, 0, size_};
  functions.CmdCopyBuffer(commandBuffer, buffer_, copy->handle(), 1, &all);
  barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
  functions.CmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_TRANSFER_BIT,
                               VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0, nullptr, 0, nullptr);
  functions.EndCommandBuffer(commandBuffer);
  const Result<void> done = device_->submitAndWait(commandBuffer);
  device_->freeCommandBuffer(commandBuffer);
  if (!done) return done.error();
  return std::vector<std::byte>(copy->bytes().begin(), copy->bytes().end());
}

}  // namespace dermis::samples
