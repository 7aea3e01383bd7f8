// A buffer in memory that the CPU can access; it stays mapped.
#pragma once

#include <cstddef>
#include <span>

#include "dermis/result.h"
#include "dermis/vulkan/bindings.h"
#include "device.h"

namespace dermis::samples {

class MappedBuffer {
 public:
  /// `size` may be 0: an empty range. `readBack`: in cached memory, for the CPU to read.
  static Result<MappedBuffer> create(Device& device, std::uint64_t size, VkBufferUsageFlags usage,
                                     bool readBack = false);
  MappedBuffer() = default;
  ~MappedBuffer();
  MappedBuffer(MappedBuffer&& other) noexcept { *this = std::move(other); }
  MappedBuffer& operator=(MappedBuffer&& other) noexcept;

  std::span<std::byte> bytes() const { return {mapped_, static_cast<std::size_t>(size_)}; }
  VkBuffer handle() const { return buffer_; }
  /// The whole buffer; a null buffer if it is empty.
  vulkan::BufferRange range() const { return {buffer_, 0, size_}; }

 private:
  Device* device_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  std::byte* mapped_ = nullptr;
  std::uint64_t size_ = 0;
};

}  // namespace dermis::samples
