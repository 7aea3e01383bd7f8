// The Vulkan loader, opened at run time, so that a program starts on a machine without it, and the
// Vulkan functions that the samples and tests call. dermis::vulkan does not use this file.
#pragma once

#include <memory>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"

#define DERMIS_SAMPLE_INSTANCE_FUNCTIONS(X) \
  X(DestroyInstance)                        \
  X(EnumeratePhysicalDevices)               \
  X(GetPhysicalDeviceProperties)            \
  X(GetPhysicalDeviceProperties2)           \
  X(GetPhysicalDeviceFeatures2)             \
  X(GetPhysicalDeviceFormatProperties)      \
  X(GetPhysicalDeviceImageFormatProperties) \
  X(GetPhysicalDeviceMemoryProperties)      \
  X(GetPhysicalDeviceQueueFamilyProperties) \
  X(EnumerateDeviceExtensionProperties)     \
  X(CreateDevice)                           \
  X(GetDeviceProcAddr)

/// The functions that draw, and those of compute pipelines outside Dermis.
#define DERMIS_SAMPLE_GRAPHICS_FUNCTIONS(X) \
  X(CreateImage)                            \
  X(DestroyImage)                           \
  X(GetImageMemoryRequirements)             \
  X(BindImageMemory)                        \
  X(CreateImageView)                        \
  X(DestroyImageView)                       \
  X(CreateSampler)                          \
  X(DestroySampler)                         \
  X(CreateRenderPass)                       \
  X(DestroyRenderPass)                      \
  X(CreateFramebuffer)                      \
  X(DestroyFramebuffer)                     \
  X(CreateShaderModule)                     \
  X(DestroyShaderModule)                    \
  X(CreateDescriptorSetLayout)              \
  X(DestroyDescriptorSetLayout)             \
  X(CreateDescriptorPool)                   \
  X(DestroyDescriptorPool)                  \
  X(AllocateDescriptorSets)                 \
  X(UpdateDescriptorSets)                   \
  X(CreatePipelineLayout)                   \
  X(DestroyPipelineLayout)                  \
  X(CreateComputePipelines)                 \
  X(CreateGraphicsPipelines)                \
  X(DestroyPipeline)                        \
  X(CmdBeginRenderPass)                     \
  X(CmdEndRenderPass)                       \
  X(CmdBindPipeline)                        \
  X(CmdBindDescriptorSets)                  \
  X(CmdBindVertexBuffers)                   \
  X(CmdBindIndexBuffer)                     \
  X(CmdPushConstants)                       \
  X(CmdSetViewport)                         \
  X(CmdSetScissor)                          \
  X(CmdDispatch)                            \
  X(CmdDraw)                                \
  X(CmdDrawIndexed)                         \
  X(CmdDrawIndexedIndirect)                 \
  X(CmdBlitImage)                           \
  X(CmdCopyBufferToImage)                   \
  X(CmdCopyImageToBuffer)

#define DERMIS_SAMPLE_DEVICE_FUNCTIONS(X) \
  X(DestroyDevice)                        \
  X(GetDeviceQueue)                       \
  X(CreateBuffer)                         \
  X(DestroyBuffer)                        \
  X(GetBufferMemoryRequirements)          \
  X(AllocateMemory)                       \
  X(FreeMemory)                           \
  X(BindBufferMemory)                     \
  X(MapMemory)                            \
  X(CreateCommandPool)                    \
  X(DestroyCommandPool)                   \
  X(AllocateCommandBuffers)               \
  X(FreeCommandBuffers)                   \
  X(BeginCommandBuffer)                   \
  X(EndCommandBuffer)                     \
  X(CmdPipelineBarrier)                   \
  X(CmdFillBuffer)                        \
  X(CmdUpdateBuffer)                      \
  X(CmdCopyBuffer)                        \
  X(CmdExecuteCommands)                   \
  X(CmdBeginQuery)                        \
  X(CmdEndQuery)                          \
  X(CreateQueryPool)                      \
  X(DestroyQueryPool)                     \
  X(CmdResetQueryPool)                    \
  X(CmdWriteTimestamp)                    \
  X(GetQueryPoolResults)                  \
  X(QueueSubmit)                          \
  X(CreateFence)                          \
  X(DestroyFence)                         \
  X(ResetFences)                          \
  X(WaitForFences)                        \
  X(DeviceWaitIdle)                       \
  DERMIS_SAMPLE_GRAPHICS_FUNCTIONS(X)

namespace dermis::samples {

struct VulkanFunctions {
#define DERMIS_DECLARE(name) PFN_vk##name name = nullptr;
  DERMIS_SAMPLE_INSTANCE_FUNCTIONS(DERMIS_DECLARE)
  DERMIS_SAMPLE_DEVICE_FUNCTIONS(DERMIS_DECLARE)
#undef DERMIS_DECLARE
};

class VulkanLoader {
 public:
  /// Opens libvulkan.so.1, or vulkan-1.dll on Windows. Fails with `missingFeature` if there is
  /// none.
  static Result<std::shared_ptr<VulkanLoader>> open();
  ~VulkanLoader();
  VulkanLoader(const VulkanLoader&) = delete;
  VulkanLoader& operator=(const VulkanLoader&) = delete;

  PFN_vkGetInstanceProcAddr getInstanceProcAddr = nullptr;

 private:
  VulkanLoader() = default;
  void* library_ = nullptr;
};

}  // namespace dermis::samples
