// `BufferCallbacks` for the Vulkan Memory Allocator, version 3. Include vk_mem_alloc.h first.
#pragma once

#include "dermis/vulkan/scene_recorder.h"

namespace dermis::vulkan {

/// For `SceneRecorderDescription::buffers`. The allocator must outlive the recorder. For buffers
/// with device addresses, it needs VMA_ALLOCATOR_CREATE_BUFFER_DEVICE_ADDRESS_BIT.
inline BufferCallbacks vmaBufferCallbacks(VmaAllocator allocator) {
  const auto create = [](void* user, const VkBufferCreateInfo& info, BufferUse use,
                         const char* name) -> Result<CreatedBuffer> {
    const auto vma = static_cast<VmaAllocator>(user);
    VmaAllocationCreateInfo wanted{};
    wanted.usage = use == BufferUse::readBack ? VMA_MEMORY_USAGE_AUTO_PREFER_HOST
                                              : VMA_MEMORY_USAGE_AUTO_PREFER_DEVICE;
    if (use != BufferUse::device) {
      wanted.flags = VMA_ALLOCATION_CREATE_MAPPED_BIT;
      wanted.flags |= use == BufferUse::upload
                          ? VMA_ALLOCATION_CREATE_HOST_ACCESS_SEQUENTIAL_WRITE_BIT
                          : VMA_ALLOCATION_CREATE_HOST_ACCESS_RANDOM_BIT;
      wanted.requiredFlags = VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    }
    VkBuffer buffer{};
    VmaAllocation allocation{};
    VmaAllocationInfo made{};
    const VkResult result = vmaCreateBuffer(vma, &info, &wanted, &buffer, &allocation, &made);
    if (result != VK_SUCCESS)
      return Error{ErrorCode::vulkanError, "vmaCreateBuffer failed", result};
    vmaSetAllocationName(vma, allocation, name);
    return CreatedBuffer{buffer, made.pMappedData, allocation};
  };
  const auto destroy = [](void* user, const CreatedBuffer& created) {
    vmaDestroyBuffer(static_cast<VmaAllocator>(user), created.buffer,
                     static_cast<VmaAllocation>(created.allocation));
  };
  return {allocator, create, destroy};
}

}  // namespace dermis::vulkan
