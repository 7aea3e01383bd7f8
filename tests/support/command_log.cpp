#include "command_log.h"

#include <algorithm>
#include <optional>

namespace dermis::test {
namespace {

CommandLog* commandLog = nullptr;

/// The driver's own functions.
struct RealFunctions {
  PFN_vkCmdDispatch CmdDispatch;
  PFN_vkCmdDispatchIndirect CmdDispatchIndirect;
  PFN_vkCmdCopyBuffer CmdCopyBuffer;
  PFN_vkCmdFillBuffer CmdFillBuffer;
  PFN_vkCmdUpdateBuffer CmdUpdateBuffer;
  PFN_vkCmdPipelineBarrier CmdPipelineBarrier;
  PFN_vkCmdPushDescriptorSetKHR CmdPushDescriptorSetKHR;
  PFN_vkCreateBuffer CreateBuffer;
  PFN_vkDestroyBuffer DestroyBuffer;
  PFN_vkAllocateMemory AllocateMemory;
  PFN_vkFreeMemory FreeMemory;
  PFN_vkBindBufferMemory BindBufferMemory;
  PFN_vkMapMemory MapMemory;
  PFN_vkCreateQueryPool CreateQueryPool;
  PFN_vkCreateBufferView CreateBufferView;
  PFN_vkCreateShaderModule CreateShaderModule;
  PFN_vkCreateComputePipelines CreateComputePipelines;
} real;

/// Counts the call; what it fails with, if it does.
std::optional<VkResult> failureOf(const char* name) {
  ++commandLog->calls[name];
  if (commandLog->failsAt >= 0 && commandLog->failsAt-- == 0) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  const auto failure = commandLog->failures.find(name);
  if (failure == commandLog->failures.end()) return std::nullopt;
  return failure->second;
}

void VKAPI_CALL cmdDispatch(VkCommandBuffer commandBuffer, std::uint32_t x, std::uint32_t y,
                            std::uint32_t z) {
  ++commandLog->calls["vkCmdDispatch"];
  real.CmdDispatch(commandBuffer, x, y, z);
}
void VKAPI_CALL cmdDispatchIndirect(VkCommandBuffer commandBuffer, VkBuffer buffer,
                                    VkDeviceSize offset) {
  ++commandLog->calls["vkCmdDispatchIndirect"];
  real.CmdDispatchIndirect(commandBuffer, buffer, offset);
}
void VKAPI_CALL cmdCopyBuffer(VkCommandBuffer commandBuffer, VkBuffer source, VkBuffer destination,
                              std::uint32_t count, const VkBufferCopy* regions) {
  ++commandLog->calls["vkCmdCopyBuffer"];
  commandLog->copies.emplace_back(regions, regions + count);
  real.CmdCopyBuffer(commandBuffer, source, destination, count, regions);
}
void VKAPI_CALL cmdFillBuffer(VkCommandBuffer commandBuffer, VkBuffer buffer, VkDeviceSize offset,
                              VkDeviceSize size, std::uint32_t value) {
  ++commandLog->calls["vkCmdFillBuffer"];
  real.CmdFillBuffer(commandBuffer, buffer, offset, size, value);
}
void VKAPI_CALL cmdUpdateBuffer(VkCommandBuffer commandBuffer, VkBuffer buffer, VkDeviceSize offset,
                                VkDeviceSize size, const void* data) {
  ++commandLog->calls["vkCmdUpdateBuffer"];
  real.CmdUpdateBuffer(commandBuffer, buffer, offset, size, data);
}
void VKAPI_CALL cmdPushDescriptorSet(VkCommandBuffer commandBuffer, VkPipelineBindPoint bindPoint,
                                     VkPipelineLayout layout, std::uint32_t set,
                                     std::uint32_t count, const VkWriteDescriptorSet* writes) {
  for (std::uint32_t i = 0; i < count; ++i) {
    for (std::uint32_t j = 0; writes[i].pBufferInfo != nullptr && j < writes[i].descriptorCount;
         ++j)
      commandLog->longestRange = std::max(commandLog->longestRange, writes[i].pBufferInfo[j].range);
  }
  real.CmdPushDescriptorSetKHR(commandBuffer, bindPoint, layout, set, count, writes);
}
void VKAPI_CALL cmdPipelineBarrier(VkCommandBuffer commandBuffer, VkPipelineStageFlags source,
                                   VkPipelineStageFlags destination, VkDependencyFlags flags,
                                   std::uint32_t memoryCount, const VkMemoryBarrier* memory,
                                   std::uint32_t bufferCount, const VkBufferMemoryBarrier* buffers,
                                   std::uint32_t imageCount, const VkImageMemoryBarrier* images) {
  const std::uint32_t number = commandLog->calls["vkCmdPipelineBarrier"]++;
  commandLog->barriers.emplace_back(source, destination);
  if (commandLog->forgetsBarrier && commandLog->forgetsBarrier(number)) return;
  real.CmdPipelineBarrier(commandBuffer, source, destination, flags, memoryCount, memory,
                          bufferCount, buffers, imageCount, images);
}

VkResult VKAPI_CALL createBuffer(VkDevice device, const VkBufferCreateInfo* info,
                                 const VkAllocationCallbacks* allocator, VkBuffer* buffer) {
  if (const auto failure = failureOf("vkCreateBuffer")) return *failure;
  const VkResult result = real.CreateBuffer(device, info, allocator, buffer);
  if (result == VK_SUCCESS) ++commandLog->buffersAlive;
  return result;
}
void VKAPI_CALL destroyBuffer(VkDevice device, VkBuffer buffer,
                              const VkAllocationCallbacks* allocator) {
  if (buffer != VK_NULL_HANDLE) --commandLog->buffersAlive;
  real.DestroyBuffer(device, buffer, allocator);
}
VkResult VKAPI_CALL allocateMemory(VkDevice device, const VkMemoryAllocateInfo* info,
                                   const VkAllocationCallbacks* allocator, VkDeviceMemory* memory) {
  if (const auto failure = failureOf("vkAllocateMemory")) return *failure;
  const VkResult result = real.AllocateMemory(device, info, allocator, memory);
  if (result != VK_SUCCESS) return result;
  ++commandLog->allocationsAlive;
  commandLog->allocatedBytes += info->allocationSize;
  return result;
}
void VKAPI_CALL freeMemory(VkDevice device, VkDeviceMemory memory,
                           const VkAllocationCallbacks* allocator) {
  if (memory != VK_NULL_HANDLE) --commandLog->allocationsAlive;
  real.FreeMemory(device, memory, allocator);
}
VkResult VKAPI_CALL bindBufferMemory(VkDevice device, VkBuffer buffer, VkDeviceMemory memory,
                                     VkDeviceSize offset) {
  if (const auto failure = failureOf("vkBindBufferMemory")) return *failure;
  return real.BindBufferMemory(device, buffer, memory, offset);
}
VkResult VKAPI_CALL mapMemory(VkDevice device, VkDeviceMemory memory, VkDeviceSize offset,
                              VkDeviceSize size, VkMemoryMapFlags flags, void** data) {
  if (const auto failure = failureOf("vkMapMemory")) return *failure;
  return real.MapMemory(device, memory, offset, size, flags, data);
}
VkResult VKAPI_CALL createQueryPool(VkDevice device, const VkQueryPoolCreateInfo* info,
                                    const VkAllocationCallbacks* allocator, VkQueryPool* pool) {
  if (const auto failure = failureOf("vkCreateQueryPool")) return *failure;
  return real.CreateQueryPool(device, info, allocator, pool);
}
VkResult VKAPI_CALL createBufferView(VkDevice device, const VkBufferViewCreateInfo* info,
                                     const VkAllocationCallbacks* allocator, VkBufferView* view) {
  if (const auto failure = failureOf("vkCreateBufferView")) return *failure;
  return real.CreateBufferView(device, info, allocator, view);
}
VkResult VKAPI_CALL createShaderModule(VkDevice device, const VkShaderModuleCreateInfo* info,
                                       const VkAllocationCallbacks* allocator,
                                       VkShaderModule* module) {
  if (const auto failure = failureOf("vkCreateShaderModule")) return *failure;
  return real.CreateShaderModule(device, info, allocator, module);
}
VkResult VKAPI_CALL createComputePipelines(VkDevice device, VkPipelineCache cache,
                                           std::uint32_t count,
                                           const VkComputePipelineCreateInfo* infos,
                                           const VkAllocationCallbacks* allocator,
                                           VkPipeline* pipelines) {
  if (const auto failure = failureOf("vkCreateComputePipelines")) {
    std::fill_n(pipelines, count, VK_NULL_HANDLE);
    return *failure;
  }
  return real.CreateComputePipelines(device, cache, count, infos, allocator, pipelines);
}

}  // namespace

CommandLog::CommandLog(InterceptedDevice& device) {
  commandLog = this;
  const vulkan::DeviceDescription description = device.description();
  const auto getDeviceProcAddr = reinterpret_cast<PFN_vkGetDeviceProcAddr>(
      description.getInstanceProcAddr(description.instance, "vkGetDeviceProcAddr"));
  const auto intercept = [&]<typename Function>(const char* name, Function& realFunction,
                                                Function replacement) {
    realFunction = reinterpret_cast<Function>(getDeviceProcAddr(description.device, name));
    device.replace(name, replacement);
  };
  intercept("vkCmdDispatch", real.CmdDispatch, cmdDispatch);
  intercept("vkCmdDispatchIndirect", real.CmdDispatchIndirect, cmdDispatchIndirect);
  intercept("vkCmdCopyBuffer", real.CmdCopyBuffer, cmdCopyBuffer);
  intercept("vkCmdFillBuffer", real.CmdFillBuffer, cmdFillBuffer);
  intercept("vkCmdPushDescriptorSetKHR", real.CmdPushDescriptorSetKHR, cmdPushDescriptorSet);
  intercept("vkCmdUpdateBuffer", real.CmdUpdateBuffer, cmdUpdateBuffer);
  intercept("vkCmdPipelineBarrier", real.CmdPipelineBarrier, cmdPipelineBarrier);
  intercept("vkCreateBuffer", real.CreateBuffer, createBuffer);
  intercept("vkDestroyBuffer", real.DestroyBuffer, destroyBuffer);
  intercept("vkAllocateMemory", real.AllocateMemory, allocateMemory);
  intercept("vkFreeMemory", real.FreeMemory, freeMemory);
  intercept("vkBindBufferMemory", real.BindBufferMemory, bindBufferMemory);
  intercept("vkMapMemory", real.MapMemory, mapMemory);
  intercept("vkCreateQueryPool", real.CreateQueryPool, createQueryPool);
  intercept("vkCreateBufferView", real.CreateBufferView, createBufferView);
  intercept("vkCreateShaderModule", real.CreateShaderModule, createShaderModule);
  intercept("vkCreateComputePipelines", real.CreateComputePipelines, createComputePipelines);
}

CommandLog::~CommandLog() {
  commandLog = nullptr;
}

}  // namespace dermis::test
