// A buffer in the device's own memory, which the CPU does not see: for what only kernels write and
// read. Many GPUs have no more than 256 MiB that both see.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "dermis/result.h"
#include "dermis/vulkan/bindings.h"
#include "device.h"

namespace dermis::samples {

class DeviceBuffer {
 public:
  /// `size` may be 0: an empty range.
  static Result<DeviceBuffer> create(Device& device, std::uint64_t size, VkBufferUsageFlags usage);
  DeviceBuffer() = default;
  ~DeviceBuffer();
  DeviceBuffer(DeviceBuffer&& other) noexcept { *this = std::move(other); }
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept;

  /// All of it; a null buffer where it is empty.
  vulkan::BufferRange range() const { return {buffer_, 0, size_}; }
  /// What kernels that were submitted before have written; waits for them.
  Result<std::vector<std::byte>> read() const;

 private:
  Device* device_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  std::uint64_t size_ = 0;
};

}  // namespace dermis::samples
