// A buffer in device-local memory that the CPU cannot access, for data that only kernels read and
// write. On many GPUs the CPU can access only 256 MiB of device-local memory.
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

  /// The whole buffer; a null buffer if it is empty.
  vulkan::BufferRange range() const { return {buffer_, 0, size_}; }
  /// Waits for the kernels that were submitted before, and returns what they wrote.
  Result<std::vector<std::byte>> read() const;

 private:
  Device* device_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  std::uint64_t size_ = 0;
};

}  // namespace dermis::samples
