// A Vulkan buffer and its memory. MappedBuffer and DeviceBuffer are built on it.
#pragma once

#include <cstdint>
#include <utility>

#include "dermis/result.h"
#include "dermis/vulkan/bindings.h"
#include "kit/device.h"

namespace dermis::samples {

class BufferMemory {
 public:
  /// If `size` is 0, the range is empty. The memory type has all flags of `required`, and those of
  /// `preferred` if there is such a type.
  static Result<BufferMemory> create(Device& device, std::uint64_t size, VkBufferUsageFlags usage,
                                     VkMemoryPropertyFlags required,
                                     VkMemoryPropertyFlags preferred);
  BufferMemory() = default;
  ~BufferMemory();
  BufferMemory(BufferMemory&& other) noexcept { *this = std::move(other); }
  BufferMemory& operator=(BufferMemory&& other) noexcept;

  /// The buffer must not be empty.
  Device& device() const { return *device_; }
  VkDeviceMemory memory() const { return memory_; }
  VkBuffer handle() const { return buffer_; }
  std::uint64_t size() const { return size_; }
  /// The whole buffer. If it is empty, the range has a null buffer.
  vulkan::BufferRange range() const { return {buffer_, 0, size_}; }

 private:
  Device* device_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  std::uint64_t size_ = 0;
};

/// The error of a Vulkan function that failed for a buffer of `size` bytes.
Error bufferError(const char* function, std::uint64_t size, VkResult result);

}  // namespace dermis::samples
