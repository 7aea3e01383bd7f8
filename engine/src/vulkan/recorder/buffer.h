// A buffer of a SceneRecorder, with its memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "vulkan/state.h"

namespace dermis::vulkan {

/// The context and the callbacks that create buffers. Must outlive the buffers.
struct BufferSource {
  const ContextState* context = nullptr;
  BufferCallbacks callbacks;
  std::uint64_t bytes = 0;  ///< of all existing buffers
};

class OwnBuffer {
 public:
  struct Description {
    std::uint64_t size = 0;
    VkBufferUsageFlags usage = 0;
    BufferUse use = BufferUse::device;
    const char* name = "";
  };
  static Result<OwnBuffer> create(BufferSource& source, const Description& description);

  OwnBuffer() = default;
  ~OwnBuffer();
  OwnBuffer(OwnBuffer&& other) noexcept;
  OwnBuffer& operator=(OwnBuffer&& other) noexcept;

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

}  // namespace dermis::vulkan
