// Buffers of the samples and tests: each has its own memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dermis/result.h"
#include "dermis/vulkan/context.h"
#include "kit/device.h"

namespace dermis::samples {

/// A Vulkan buffer and its memory.
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

/// A buffer in memory that the CPU can access. It stays mapped.
class MappedBuffer {
 public:
  /// If `size` is 0, the range is empty. `readBack`: in cached memory, for the CPU to read.
  static Result<MappedBuffer> create(Device& device, std::uint64_t size, VkBufferUsageFlags usage,
                                     bool readBack = false);
  MappedBuffer() = default;

  std::span<std::byte> bytes() const { return {mapped_, static_cast<std::size_t>(buffer_.size())}; }
  VkBuffer handle() const { return buffer_.handle(); }
  vulkan::BufferRange range() const { return buffer_.range(); }

 private:
  BufferMemory buffer_;
  std::byte* mapped_ = nullptr;
};

/// A buffer in device-local memory that the CPU cannot access, for data that only kernels read and
/// write. On many GPUs the CPU can access only 256 MiB of device-local memory.
class DeviceBuffer {
 public:
  /// If `size` is 0, the range is empty.
  static Result<DeviceBuffer> create(Device& device, std::uint64_t size, VkBufferUsageFlags usage);
  DeviceBuffer() = default;

  vulkan::BufferRange range() const { return buffer_.range(); }
  /// Waits for all kernels that were submitted, and returns the contents.
  Result<std::vector<std::byte>> read() const;

 private:
  BufferMemory buffer_;
};

}  // namespace dermis::samples
