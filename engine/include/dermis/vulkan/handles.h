// Declares the Vulkan types that Dermis' headers use, as vulkan_core.h does, but does not include
// it. So an engine may include volk, or Vulkan's header with or without prototypes, before or after
// Dermis' headers. Only vertex_input.h and acceleration_structure.h include vulkan_core.h.
#pragma once

#include <cstdint>

#include <vulkan/vk_platform.h>

struct VkAllocationCallbacks;
struct VkBufferCreateInfo;
struct VkBufferMemoryBarrier;
struct VkBufferMemoryBarrier2;
struct VkMemoryBarrier;
struct VkMemoryBarrier2;

using VkDeviceSize = std::uint64_t;
using VkFlags = std::uint32_t;
using VkAccessFlags = VkFlags;
using VkBufferUsageFlags = VkFlags;
using VkPipelineStageFlags = VkFlags;

using VkInstance = struct VkInstance_T*;
using VkPhysicalDevice = struct VkPhysicalDevice_T*;
using VkDevice = struct VkDevice_T*;
using VkCommandBuffer = struct VkCommandBuffer_T*;
// The same condition as in vulkan_core.h.
#if defined(__LP64__) || defined(_WIN64) || (defined(__x86_64__) && !defined(__ILP32__)) || \
    defined(_M_X64) || defined(__ia64) || defined(_M_IA64) || defined(__aarch64__) ||       \
    defined(__powerpc64__)
using VkBuffer = struct VkBuffer_T*;
using VkPipelineCache = struct VkPipelineCache_T*;
#else
using VkBuffer = std::uint64_t;
using VkPipelineCache = std::uint64_t;
#endif

using PFN_vkVoidFunction = void(VKAPI_PTR*)();
using PFN_vkGetInstanceProcAddr = PFN_vkVoidFunction(VKAPI_PTR*)(VkInstance instance,
                                                                 const char* name);

namespace dermis::vulkan {

inline constexpr VkBufferUsageFlags vertexBufferUsage =
    0x80;  ///< VK_BUFFER_USAGE_VERTEX_BUFFER_BIT

}  // namespace dermis::vulkan
