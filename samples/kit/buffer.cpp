#include "kit/buffer.h"

#include <string>

namespace dermis::samples {
namespace {

/// The error of a Vulkan function that failed for a buffer of `size` bytes.
Error bufferError(const char* function, std::uint64_t size, VkResult result) {
  return {ErrorCode::vulkanError,
          std::string(function) + " failed for a buffer of " + std::to_string(size) +
              " bytes with VkResult " + std::to_string(static_cast<int>(result)),
          static_cast<std::int32_t>(result)};
}

}  // namespace

Result<BufferMemory> BufferMemory::create(Device& device, std::uint64_t size,
                                          VkBufferUsageFlags usage, VkMemoryPropertyFlags required,
                                          VkMemoryPropertyFlags preferred) {
  BufferMemory buffer;
  if (size == 0) return buffer;
  buffer.device_ = &device;
  buffer.size_ = size;
  const VulkanFunctions& functions = device.functions();

  VkBufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = size;
  info.usage = usage;
  if (const VkResult result =
          functions.CreateBuffer(device.handle(), &info, nullptr, &buffer.buffer_);
      result != VK_SUCCESS) {
    return bufferError("vkCreateBuffer", size, result);
  }
  VkMemoryRequirements requirements{};
  functions.GetBufferMemoryRequirements(device.handle(), buffer.buffer_, &requirements);
  const Result<std::uint32_t> type =
      device.memoryType(requirements.memoryTypeBits, required, preferred);
  if (!type) return type.error();
  VkMemoryAllocateInfo allocateInfo{};
  allocateInfo.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  allocateInfo.allocationSize = requirements.size;
  allocateInfo.memoryTypeIndex = *type;
  VkMemoryAllocateFlagsInfo flags{};
  flags.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO;
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  if ((usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0) allocateInfo.pNext = &flags;
  if (const VkResult result =
          functions.AllocateMemory(device.handle(), &allocateInfo, nullptr, &buffer.memory_);
      result != VK_SUCCESS) {
    return bufferError("vkAllocateMemory", size, result);
  }
  if (const VkResult result =
          functions.BindBufferMemory(device.handle(), buffer.buffer_, buffer.memory_, 0);
      result != VK_SUCCESS) {
    return bufferError("vkBindBufferMemory", size, result);
  }
  return buffer;
}

BufferMemory::~BufferMemory() {
  if (device_ == nullptr) return;
  device_->functions().DestroyBuffer(device_->handle(), buffer_, nullptr);
  device_->functions().FreeMemory(device_->handle(), memory_, nullptr);
}

BufferMemory& BufferMemory::operator=(BufferMemory&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(buffer_, other.buffer_);
  std::swap(memory_, other.memory_);
  std::swap(size_, other.size_);
  return *this;
}

Result<MappedBuffer> MappedBuffer::create(Device& device, std::uint64_t size,
                                          VkBufferUsageFlags usage, bool readBack) {
  Result<BufferMemory> memory = BufferMemory::create(
      device, size, usage,
      VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT,
      readBack ? VK_MEMORY_PROPERTY_HOST_CACHED_BIT : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
  if (!memory) return memory.error();
  MappedBuffer buffer;
  buffer.buffer_ = std::move(*memory);
  if (size == 0) return buffer;
  void* mapped = nullptr;
  if (const VkResult result = device.functions().MapMemory(device.handle(), buffer.buffer_.memory(),
                                                           0, VK_WHOLE_SIZE, 0, &mapped);
      result != VK_SUCCESS) {
    return bufferError("vkMapMemory", size, result);
  }
  buffer.mapped_ = static_cast<std::byte*>(mapped);
  return buffer;
}

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
  const Result<void> done = device.run([&](VkCommandBuffer commandBuffer) -> Result<void> {
    recordBarrier(device, commandBuffer, Use::dermis, Use::copyRead);
    const VkBufferCopy all{0, 0, buffer_.size()};
    device.functions().CmdCopyBuffer(commandBuffer, buffer_.handle(), copy->handle(), 1, &all);
    recordBarrier(device, commandBuffer, Use::copyWrite, Use::hostRead);
    return {};
  });
  if (!done) return done.error();
  return std::vector<std::byte>(copy->bytes().begin(), copy->bytes().end());
}

}  // namespace dermis::samples
