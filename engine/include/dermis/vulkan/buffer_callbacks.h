// Where a SkinningSystem gets its buffers from: an engine's allocator, by two functions.
#pragma once

#include <cstdint>

#include "dermis/result.h"
#include "dermis/vulkan/handles.h"

namespace dermis::vulkan {

/// What the memory of a buffer is for.
enum class BufferUse : std::uint8_t {
  device,    ///< only the GPU uses it: device-local if possible
  upload,    ///< the CPU writes it and never reads it, the GPU reads it: host-visible and coherent,
             ///< also device-local if possible
  readBack,  ///< the GPU writes it and the CPU reads it: host-visible and coherent, also cached if
             ///< possible
};

struct BufferRequest {
  /// Size and usage; exclusive to a queue family, nothing in pNext. It lives as long as the call.
  /// With VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT the memory must be allocated with
  /// VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
  const VkBufferCreateInfo* info = nullptr;
  BufferUse use = BufferUse::device;
  const char* name = "";  ///< "dermis output": the same for all buffers of a kind; a constant
};

/// A buffer with its memory.
struct CreatedBuffer {
  VkBuffer buffer{};
  void* mapped = nullptr;      ///< upload, readBack: the address of its first byte; stays mapped
  void* allocation = nullptr;  ///< for the allocator; `destroy` gets it back
};

/// The thread that calls the SkinningSystem calls both functions. They may call Vulkan. With the
/// Vulkan Memory Allocator `create` is one call of vmaCreateBuffer with `info`, and `destroy` one
/// of vmaDestroyBuffer.
struct BufferCallbacks {
  void* user = nullptr;
  /// Creates a buffer and binds memory to it. If it fails, the call of the SkinningSystem fails
  /// with its error.
  Result<CreatedBuffer> (*create)(void* user, const BufferRequest& request) = nullptr;
  /// The GPU no longer uses the buffer.
  void (*destroy)(void* user, const CreatedBuffer& buffer) = nullptr;
};

}  // namespace dermis::vulkan
