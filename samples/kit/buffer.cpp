#include "kit/buffer.h"

#include <utility>

namespace dermis::samples {

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

}  // namespace dermis::samples
