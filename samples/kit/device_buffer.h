// A buffer in device-local memory that the CPU cannot access, for data that only kernels read and
// write. On many GPUs the CPU can access only 256 MiB of device-local memory.
#pragma once

#include <cstddef>
#include <vector>

#include "kit/buffer_memory.h"

namespace dermis::samples {

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
