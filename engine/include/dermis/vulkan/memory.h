// Device-memory callbacks of SkinningSystem.
#pragma once

#include <cstdint>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"

namespace dermis::vulkan {

/// What the memory of one buffer is for.
enum class MemoryUse : std::uint8_t {
  device,    ///< only the GPU uses it: device-local if possible
  upload,    ///< the CPU writes it, front to back, and the GPU reads it: host-visible and coherent,
             ///< also device-local if possible
  readBack,  ///< the GPU writes it and the CPU reads it: host-visible and coherent, also cached if
             ///< possible
};

struct MemoryRequest {
  VkMemoryRequirements requirements{};  ///< of the buffer
  MemoryUse use = MemoryUse::device;
  /// The buffer has the usage VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT: its memory must be
  /// allocated with VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
  bool hasDeviceAddress = false;
  const char* name = "";  ///< of the buffer: "dermis output"; valid during the call
};

/// A part of a VkDeviceMemory.
struct MemoryBlock {
  VkDeviceMemory memory = VK_NULL_HANDLE;
  VkDeviceSize offset = 0;
  void* mapped = nullptr;  ///< upload, readBack: the address of `offset`; must stay mapped
  void* owner = nullptr;   ///< for the allocator; `free` gets it back
};

/// The thread that calls the SkinningSystem calls both functions. They may call Vulkan.
struct MemoryCallbacks {
  void* user = nullptr;
  /// Allocates memory for a buffer. If it fails, the call of the SkinningSystem fails with its
  /// error.
  Result<MemoryBlock> (*allocate)(void* user, const MemoryRequest& request) = nullptr;
  /// Frees a block. The GPU no longer uses it, and its buffer is destroyed.
  void (*free)(void* user, const MemoryBlock& block) = nullptr;
};

}  // namespace dermis::vulkan
