// Stands in for vk_mem_alloc.h: what dermis/vulkan/vma.h uses of the Vulkan Memory Allocator, with
// its values. vma_test.cpp defines the functions.
#pragma once

#include <vulkan/vulkan_core.h>

VK_DEFINE_HANDLE(VmaAllocator)
VK_DEFINE_HANDLE(VmaAllocation)

enum VmaMemoryUsage {
  VMA_MEMORY_USAGE_UNKNOWN = 0,
  VMA_MEMORY_USAGE_AUTO_PREFER_DEVICE = 8,
  VMA_MEMORY_USAGE_AUTO_PREFER_HOST = 9,
};
enum VmaAllocationCreateFlagBits {
  VMA_ALLOCATION_CREATE_MAPPED_BIT = 0x4,
  VMA_ALLOCATION_CREATE_HOST_ACCESS_SEQUENTIAL_WRITE_BIT = 0x400,
  VMA_ALLOCATION_CREATE_HOST_ACCESS_RANDOM_BIT = 0x800,
};
struct VmaAllocationCreateInfo {
  VkFlags flags;
  VmaMemoryUsage usage;
  VkMemoryPropertyFlags requiredFlags;
};
struct VmaAllocationInfo {
  void* pMappedData;
};

VkResult vmaCreateBuffer(VmaAllocator allocator, const VkBufferCreateInfo* info,
                         const VmaAllocationCreateInfo* wanted, VkBuffer* buffer,
                         VmaAllocation* allocation, VmaAllocationInfo* made);
void vmaDestroyBuffer(VmaAllocator allocator, VkBuffer buffer, VmaAllocation allocation);
void vmaSetAllocationName(VmaAllocator allocator, VmaAllocation allocation, const char* name);
