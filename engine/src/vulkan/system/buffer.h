// A buffer of a SkinningSystem, with its memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/memory.h"
#include "vulkan/system/functions.h"

namespace dermis::vulkan {

/// What buffers are made with; outlives them.
struct BufferSource {
  const ContextState* context = nullptr;
  const SystemFunctions* functions = nullptr;
  MemoryCallbacks memory;
  std::uint64_t allocatedBytes = 0;  ///< that are not freed
};

class SystemBuffer {
 public:
  struct Description {
    std::uint64_t size = 0;
    VkBufferUsageFlags usage = 0;
    MemoryUse use = MemoryUse::device;
    const char* name = "";
  };
  static Result<SystemBuffer> create(BufferSource& source, const Description& description);

  SystemBuffer() = default;
  ~SystemBuffer();
  SystemBuffer(SystemBuffer&& other) noexcept;
  SystemBuffer& operator=(SystemBuffer&& other) noexcept;

  VkBuffer handle() const { return buffer_; }
  std::uint64_t size() const { return size_; }
  BufferRange range() const { return {buffer_, 0, size_}; }
  std::span<std::byte> bytes() const {
    return {static_cast<std::byte*>(memory_.mapped), static_cast<std::size_t>(size_)};
  }

 private:
  void release();

  BufferSource* source_ = nullptr;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  MemoryBlock memory_;
  std::uint64_t size_ = 0;
  std::uint64_t allocated_ = 0;
};

}  // namespace dermis::vulkan
