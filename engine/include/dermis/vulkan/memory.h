// Where a SkinningSystem has its device memory from: two functions that an engine may replace by
// its own allocator.
#pragma once

#include <cstdint>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"

namespace dermis::vulkan {

/// What the memory of one buffer is for.
enum class MemoryUse : std::uint8_t {
  device,    ///< Written and read by the GPU only: device-local where there is such memory.
  upload,    ///< Written by the CPU, front to back, and read by the GPU: host-visible and coherent,
             ///< device-local too where there is such memory.
  readBack,  ///< Written by the GPU and read by the CPU: host-visible and coherent, cached where
             ///< there is such memory.
};

struct MemoryRequest {
  VkMemoryRequirements requirements{};  ///< of the buffer
  MemoryUse use = MemoryUse::device;
  /// The buffer may have an address (VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT): its memory needs
  /// VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
  bool hasDeviceAddress = false;
  const char* name = "";  ///< what the buffer is for: "dermis output"; lives as long as the call
};

/// A part of a VkDeviceMemory.
struct MemoryBlock {
  VkDeviceMemory memory = VK_NULL_HANDLE;
  VkDeviceSize offset = 0;
  void* mapped = nullptr;  ///< upload, readBack: where `offset` stands; stays mapped
  void* owner = nullptr;   ///< the allocator's own, handed back to `free`
};

/// Both functions are called by the thread that calls the SkinningSystem, and may call Vulkan.
struct MemoryCallbacks {
  void* user = nullptr;
  /// Finds memory that fits the request. What it fails with is what the caller of the
  /// SkinningSystem gets.
  Result<MemoryBlock> (*allocate)(void* user, const MemoryRequest& request) = nullptr;
  /// The GPU is done with it, and its buffer destroyed.
  void (*free)(void* user, const MemoryBlock& block) = nullptr;
};

}  // namespace dermis::vulkan
