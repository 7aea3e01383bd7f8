// A buffer in memory that the CPU can access. It stays mapped.
#pragma once

#include <cstddef>
#include <span>

#include "kit/buffer_memory.h"

namespace dermis::samples {

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

}  // namespace dermis::samples
