// Two functions by which a SceneRecorder creates its buffers with the engine's allocator.
#pragma once

#include <cstdint>

#include "dermis/result.h"
#include "dermis/vulkan/handles.h"

namespace dermis::vulkan {

/// Who uses the memory of a buffer. This decides on the memory type.
enum class BufferUse : std::uint8_t {
  /// Only the GPU: device-local if possible.
  device = 0,
  /// The CPU writes it and never reads it, the GPU reads it: host-visible and host-coherent, also
  /// device-local if possible.
  upload = 1,
  /// The GPU writes it, the CPU reads it: host-visible and host-coherent, also host-cached if
  /// possible.
  readBack = 2,
};

/// What `BufferCallbacks::create` creates.
struct BufferRequest {
  /// Size and usage, with VK_SHARING_MODE_EXCLUSIVE and an empty pNext chain. The pointer is valid
  /// during the call only. If the usage has VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT, the memory
  /// must be allocated with VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
  const VkBufferCreateInfo* info = nullptr;
  BufferUse use = BufferUse::device;
  /// For debugging, for example "dermis output". A constant, the same for all buffers of a kind.
  const char* name = "";
};

/// A buffer with its memory.
struct CreatedBuffer {
  VkBuffer buffer{};
  /// For `upload` and `readBack`: address of the first byte. The memory stays mapped.
  void* mapped = nullptr;
  void* allocation = nullptr;  ///< for the engine's allocator; `destroy` gets it
};

/// Create and destroy the buffers of a SceneRecorder. They are called in the thread that calls the
/// recorder or its scene, and may call Vulkan. They must not throw, and must not call either. vma.h
/// has them for the Vulkan Memory Allocator.
struct BufferCallbacks {
  void* user = nullptr;  ///< passed to both functions
  /// Creates a buffer and binds memory to it. If it fails, the function that needs it fails
  /// with the same error.
  Result<CreatedBuffer> (*create)(void* user, const BufferRequest& request) = nullptr;
  /// Destroys a buffer that the GPU no longer uses, and frees its memory.
  void (*destroy)(void* user, const CreatedBuffer& buffer) = nullptr;
};

}  // namespace dermis::vulkan
