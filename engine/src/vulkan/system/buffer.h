// A buffer of a SkinningSystem, with its memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/buffer_callbacks.h"
#include "vulkan/state.h"

namespace dermis::vulkan {

/// The context and the callbacks that create buffers. Must outlive the buffers.
struct BufferSource {
  const ContextState* context = nullptr;
  BufferCallbacks callbacks;
  std::uint64_t bytes = 0;  ///< of all existing buffers
};

class SystemBuffer {
 public:
  struct Description {
    std::uint64_t size = 0;
    VkBufferUsageFlags usage = 0;
    BufferUse use = BufferUse::device;
    const char* name = "";
  };
  static Result<SystemBuffer> create(BufferSource& source, const Description& description);

  SystemBuffer() = default;
  ~SystemBuffer();
  SystemBuffer(SystemBuffer&& other) noexcept;
  SystemBuffer& operator=(SystemBuffer&& other) noexcept;

  VkBuffer handle() const { return created_.buffer; }
  std::uint64_t size() const { return size_; }
  BufferRange range() const { return {created_.buffer, 0, size_}; }
  std::span<std::byte> bytes() const {
    return {static_cast<std::byte*>(created_.mapped), static_cast<std::size_t>(size_)};
  }

 private:
  void release();

  BufferSource* source_ = nullptr;
  CreatedBuffer created_;
  std::uint64_t size_ = 0;
};

/// A buffer of the system, or a range of the engine. The next `record` may replace a buffer of the
/// system by a larger one; it copies the contents, except palettes, which it converts again.
struct GrowingBuffer {
  SystemBuffer own;     ///< as of the last `record`
  SystemBuffer larger;  ///< from the next one on
  BufferRange engines;

  /// For the next `record`.
  BufferRange range() const {
    if (engines.buffer != VK_NULL_HANDLE) return engines;
    return larger.size() != 0 ? larger.range() : own.range();
  }
  BufferRange lastRange() const { return engines.buffer != VK_NULL_HANDLE ? engines : own.range(); }
};

}  // namespace dermis::vulkan
