#include "mock_vulkan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <utility>

namespace dermis::test {
namespace {

MockVulkan* mock = nullptr;
std::uint64_t nextHandle = 1;

template <typename Handle>
VkResult create(const char* function, const char* kind, const VkAllocationCallbacks* allocator,
                Handle* handle) {
  if (mock->failing == function && mock->failAfter-- <= 0) {
    *handle = reinterpret_cast<Handle>(std::uintptr_t{0xbad});  // undefined: not to be destroyed
    return mock->failure;
  }
  if (allocator != mock->allocator) mock->wrongAllocator = true;
  *handle = reinterpret_cast<Handle>(nextHandle++);
  ++mock->alive[kind];
  return VK_SUCCESS;
}

template <typename Handle>
void destroy(const char* kind, const VkAllocationCallbacks* allocator, Handle handle) {
  if (handle == VK_NULL_HANDLE) return;
  if (allocator != mock->allocator) mock->wrongAllocator = true;
  --mock->alive[kind];
}

void remember(const VkShaderModuleCreateInfo& info, VkShaderModule module) {
  mock->modules.push_back(info.pCode);
  mock->codeOfModule[module] = info.pCode;
}
void remember(const VkDescriptorSetLayoutCreateInfo& info, VkDescriptorSetLayout) {
  mock->setLayouts.push_back({info.flags, {info.pBindings, info.pBindings + info.bindingCount}});
}
void remember(const VkPipelineLayoutCreateInfo&, VkPipelineLayout) {}
void remember(const VkDescriptorPoolCreateInfo& info, VkDescriptorPool) {
  mock->setsInPool = info.maxSets;
  mock->descriptorsInPool = info.pPoolSizes[0].descriptorCount;
  mock->texelDescriptorsInPool = info.poolSizeCount > 1 ? info.pPoolSizes[1].descriptorCount : 0;
}
void remember(const VkBufferViewCreateInfo& info, VkBufferView view) {
  mock->views[view] = info;
}

#define MOCK_CREATE(name, Info, Handle)                                                            \
  VkResult VKAPI_CALL create##name(VkDevice, const Info* info,                                     \
                                   const VkAllocationCallbacks* allocator, Handle* handle) {       \
    const VkResult result = create("vkCreate" #name, #name, allocator, handle);                    \
    if (result == VK_SUCCESS) remember(*info, *handle);                                            \
    return result;                                                                                 \
  }                                                                                                \
  void VKAPI_CALL destroy##name(VkDevice, Handle handle, const VkAllocationCallbacks* allocator) { \
    destroy(#name, allocator, handle);                                                             \
  }
MOCK_CREATE(ShaderModule, VkShaderModuleCreateInfo, VkShaderModule)
MOCK_CREATE(DescriptorSetLayout, VkDescriptorSetLayoutCreateInfo, VkDescriptorSetLayout)
MOCK_CREATE(PipelineLayout, VkPipelineLayoutCreateInfo, VkPipelineLayout)
MOCK_CREATE(DescriptorPool, VkDescriptorPoolCreateInfo, VkDescriptorPool)
MOCK_CREATE(BufferView, VkBufferViewCreateInfo, VkBufferView)

VkResult VKAPI_CALL createComputePipelines(VkDevice, VkPipelineCache cache, std::uint32_t,
                                           const VkComputePipelineCreateInfo* info,
                                           const VkAllocationCallbacks* allocator,
                                           VkPipeline* pipeline) {
  const VkResult result = create("vkCreateComputePipelines", "Pipeline", allocator, pipeline);
  if (result != VK_SUCCESS) return result;
  mock->codeOfPipeline[*pipeline] = mock->codeOfModule.at(info->stage.module);
  mock->cachesOfPipelines.push_back(cache);
  return result;
}
void VKAPI_CALL destroyPipeline(VkDevice, VkPipeline pipeline,
                                const VkAllocationCallbacks* allocator) {
  destroy("Pipeline", allocator, pipeline);
}
VkResult VKAPI_CALL resetDescriptorPool(VkDevice, VkDescriptorPool, VkDescriptorPoolResetFlags) {
  return VK_SUCCESS;
}
VkResult VKAPI_CALL allocateDescriptorSets(VkDevice, const VkDescriptorSetAllocateInfo* info,
                                           VkDescriptorSet* sets) {
  if (mock->failing == "vkAllocateDescriptorSets") return mock->failure;
  for (std::uint32_t i = 0; i < info->descriptorSetCount; ++i)
    sets[i] = reinterpret_cast<VkDescriptorSet>(nextHandle++);
  return VK_SUCCESS;
}
void write(const VkWriteDescriptorSet& descriptor, MockDescriptors& descriptors) {
  if (descriptor.descriptorType == VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER) {
    const VkBufferViewCreateInfo& view = mock->views.at(*descriptor.pTexelBufferView);
    descriptors[descriptor.dstBinding] = {view.buffer, view.offset, view.range};
    return;
  }
  const VkDescriptorBufferInfo& info = *descriptor.pBufferInfo;
  descriptors[descriptor.dstBinding] = {info.buffer, info.offset, info.range};
}
void VKAPI_CALL updateDescriptorSets(VkDevice, std::uint32_t count,
                                     const VkWriteDescriptorSet* writes, std::uint32_t,
                                     const VkCopyDescriptorSet*) {
  for (std::uint32_t i = 0; i < count; ++i) write(writes[i], mock->sets[writes[i].dstSet]);
}

// -- Memory.

VkResult VKAPI_CALL createBuffer(VkDevice, const VkBufferCreateInfo* info,
                                 const VkAllocationCallbacks* allocator, VkBuffer* buffer) {
  const VkResult result = create("vkCreateBuffer", "Buffer", allocator, buffer);
  if (result == VK_SUCCESS) mock->buffers[*buffer] = {info->size, info->usage, VK_NULL_HANDLE};
  return result;
}
void VKAPI_CALL destroyBuffer(VkDevice, VkBuffer buffer, const VkAllocationCallbacks* allocator) {
  destroy("Buffer", allocator, buffer);
  mock->buffers.erase(buffer);
}
void VKAPI_CALL getBufferMemoryRequirements(VkDevice, VkBuffer buffer,
                                            VkMemoryRequirements* requirements) {
  *requirements = {(mock->buffers.at(buffer).size + 255) / 256 * 256, 256,
                   (1u << mock->memoryTypes.memoryTypeCount) - 1};
}
VkResult VKAPI_CALL allocateMemory(VkDevice, const VkMemoryAllocateInfo* info,
                                   const VkAllocationCallbacks* allocator, VkDeviceMemory* memory) {
  VkDeviceSize& left = mock->freeMemory.at(info->memoryTypeIndex);
  if (info->allocationSize > std::min(left, mock->largestAllocation))
    return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  const VkResult result = create("vkAllocateMemory", "Memory", allocator, memory);
  if (result != VK_SUCCESS) return result;
  left -= info->allocationSize;
  MockMemory& made = mock->memories[*memory];
  made.type = info->memoryTypeIndex;
  made.bytes.assign(info->allocationSize, std::byte{0xa5});
  const auto* flags = static_cast<const VkMemoryAllocateFlagsInfo*>(info->pNext);
  made.hasAddress = flags != nullptr && (flags->flags & VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT) != 0;
  return result;
}
void VKAPI_CALL freeMemory(VkDevice, VkDeviceMemory memory,
                           const VkAllocationCallbacks* allocator) {
  destroy("Memory", allocator, memory);
  const auto freed = mock->memories.find(memory);
  if (freed == mock->memories.end()) return;
  mock->freeMemory.at(freed->second.type) += freed->second.bytes.size();
  mock->memories.erase(freed);
}
VkResult VKAPI_CALL mapMemory(VkDevice, VkDeviceMemory memory, VkDeviceSize, VkDeviceSize,
                              VkMemoryMapFlags, void** mapped) {
  if (mock->failing == "vkMapMemory") return mock->failure;
  *mapped = mock->memories.at(memory).bytes.data();
  return VK_SUCCESS;
}
VkResult VKAPI_CALL bindBufferMemory(VkDevice, VkBuffer buffer, VkDeviceMemory memory,
                                     VkDeviceSize) {
  if (mock->failing == "vkBindBufferMemory" && mock->failAfter-- <= 0) return mock->failure;
  mock->buffers.at(buffer).memory = memory;
  return VK_SUCCESS;
}
void VKAPI_CALL getPhysicalDeviceMemoryProperties(VkPhysicalDevice,
                                                  VkPhysicalDeviceMemoryProperties* properties) {
  *properties = mock->memoryTypes;
}

VkResult VKAPI_CALL createQueryPool(VkDevice, const VkQueryPoolCreateInfo*,
                                    const VkAllocationCallbacks* allocator, VkQueryPool* pool) {
  return create("vkCreateQueryPool", "QueryPool", allocator, pool);
}
void VKAPI_CALL destroyQueryPool(VkDevice, VkQueryPool pool,
                                 const VkAllocationCallbacks* allocator) {
  destroy("QueryPool", allocator, pool);
}
VkResult VKAPI_CALL getQueryPoolResults(VkDevice, VkQueryPool, std::uint32_t, std::uint32_t,
                                        std::size_t, void*, VkDeviceSize, VkQueryResultFlags) {
  return VK_NOT_READY;
}
void VKAPI_CALL cmdResetQueryPool(VkCommandBuffer, VkQueryPool, std::uint32_t, std::uint32_t) {}
void VKAPI_CALL cmdWriteTimestamp(VkCommandBuffer, VkPipelineStageFlagBits, VkQueryPool,
                                  std::uint32_t) {}

void VKAPI_CALL getPhysicalDeviceProperties(VkPhysicalDevice,
                                            VkPhysicalDeviceProperties* properties) {
  *properties = {};
  properties->apiVersion = VK_API_VERSION_1_1;
  properties->limits = mock->limits;
  properties->deviceType = mock->deviceType;
  properties->vendorID = mock->vendor;
}

/// An NVIDIA H200, and a Radeon RX 6900 XT.
void VKAPI_CALL getPhysicalDeviceProperties2(VkPhysicalDevice device,
                                             VkPhysicalDeviceProperties2* properties) {
  getPhysicalDeviceProperties(device, &properties->properties);
  auto* next = static_cast<VkBaseOutStructure*>(properties->pNext);
  if (next->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_SM_BUILTINS_PROPERTIES_NV) {
    auto* nvidia = reinterpret_cast<VkPhysicalDeviceShaderSMBuiltinsPropertiesNV*>(next);
    nvidia->shaderSMCount = 132;
    nvidia->shaderWarpsPerSM = 64;
  } else {
    ASSERT_EQ(next->sType, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_CORE_PROPERTIES_AMD);
    auto* amd = reinterpret_cast<VkPhysicalDeviceShaderCorePropertiesAMD*>(next);
    amd->shaderEngineCount = 4;
    amd->shaderArraysPerEngineCount = 2;
    amd->computeUnitsPerShaderArray = 10;
    amd->simdPerComputeUnit = 2;
    amd->wavefrontsPerSimd = 16;
    amd->wavefrontSize = 64;
  }
}

VkResult VKAPI_CALL enumerateDeviceExtensionProperties(VkPhysicalDevice, const char*,
                                                       std::uint32_t* count,
                                                       VkExtensionProperties* extensions) {
  if (extensions == nullptr) {
    *count = static_cast<std::uint32_t>(mock->physicalExtensions.size());
    return VK_SUCCESS;
  }
  for (std::uint32_t i = 0; i < *count; ++i)
    std::snprintf(extensions[i].extensionName, sizeof(extensions[i].extensionName), "%s",
                  mock->physicalExtensions[i]);
  return VK_SUCCESS;
}

void VKAPI_CALL cmdBindPipeline(VkCommandBuffer, VkPipelineBindPoint point, VkPipeline pipeline) {
  mock->next.code = mock->codeOfPipeline.at(pipeline);
  mock->commands.push_back(point == VK_PIPELINE_BIND_POINT_COMPUTE ? "bind pipeline"
                                                                   : "bind graphics pipeline");
}
void VKAPI_CALL cmdBindDescriptorSets(VkCommandBuffer, VkPipelineBindPoint, VkPipelineLayout,
                                      std::uint32_t, std::uint32_t, const VkDescriptorSet* set,
                                      std::uint32_t, const std::uint32_t*) {
  mock->next.descriptors = mock->sets.at(*set);
  mock->commands.push_back("bind sets");
  mock->next.set = *set;
}
void VKAPI_CALL cmdPushDescriptorSet(VkCommandBuffer, VkPipelineBindPoint, VkPipelineLayout,
                                     std::uint32_t, std::uint32_t count,
                                     const VkWriteDescriptorSet* writes) {
  mock->next.descriptors.clear();
  for (std::uint32_t i = 0; i < count; ++i) write(writes[i], mock->next.descriptors);
  mock->commands.push_back("push descriptors");
}
void VKAPI_CALL cmdPushConstants(VkCommandBuffer, VkPipelineLayout, VkShaderStageFlags,
                                 std::uint32_t, std::uint32_t size, const void* values) {
  std::memcpy(mock->next.constants.data(), values,
              std::min<std::size_t>(size, sizeof(mock->next.constants)));
  mock->commands.push_back("push constants");
}
void VKAPI_CALL cmdPipelineBarrier(VkCommandBuffer, VkPipelineStageFlags before,
                                   VkPipelineStageFlags after, VkDependencyFlags,
                                   std::uint32_t memoryCount, const VkMemoryBarrier* memory,
                                   std::uint32_t bufferCount, const VkBufferMemoryBarrier* buffers,
                                   std::uint32_t, const VkImageMemoryBarrier*) {
  mock->commands.push_back("barrier");
  for (std::uint32_t i = 0; i < memoryCount; ++i) {
    mock->memoryBarriers.push_back(
        {before, memory[i].srcAccessMask, after, memory[i].dstAccessMask});
  }
  mock->bufferBarriers.insert(mock->bufferBarriers.end(), buffers, buffers + bufferCount);
}
void VKAPI_CALL cmdDispatch(VkCommandBuffer, std::uint32_t x, std::uint32_t y, std::uint32_t) {
  mock->next.groupCountX = x;
  mock->next.groupCountY = y;
  mock->dispatches.push_back(mock->next);
  mock->commands.push_back("dispatch");
}

void VKAPI_CALL cmdDispatchIndirect(VkCommandBuffer, VkBuffer, VkDeviceSize) {
  mock->commands.push_back("indirect dispatch");
}
void VKAPI_CALL cmdCopyBuffer(VkCommandBuffer, VkBuffer from, VkBuffer to, std::uint32_t count,
                              const VkBufferCopy* regions) {
  mock->copies.push_back({from, to, {regions, regions + count}});
  mock->commands.push_back("copy");
}
void VKAPI_CALL cmdFillBuffer(VkCommandBuffer, VkBuffer, VkDeviceSize, VkDeviceSize,
                              std::uint32_t) {
  mock->commands.push_back("fill");
}

PFN_vkVoidFunction find(const char* name) {
  mock->requested.insert(name);
  if (mock->missing.contains(name)) return nullptr;
  static const std::map<std::string, PFN_vkVoidFunction> functions{
#define MOCK_FUNCTION(vulkanName, function) \
  {vulkanName, reinterpret_cast<PFN_vkVoidFunction>(function)}
      MOCK_FUNCTION("vkGetPhysicalDeviceProperties", getPhysicalDeviceProperties),
      MOCK_FUNCTION("vkGetPhysicalDeviceProperties2", getPhysicalDeviceProperties2),
      MOCK_FUNCTION("vkEnumerateDeviceExtensionProperties", enumerateDeviceExtensionProperties),
      MOCK_FUNCTION("vkCreateShaderModule", createShaderModule),
      MOCK_FUNCTION("vkDestroyShaderModule", destroyShaderModule),
      MOCK_FUNCTION("vkCreateDescriptorSetLayout", createDescriptorSetLayout),
      MOCK_FUNCTION("vkDestroyDescriptorSetLayout", destroyDescriptorSetLayout),
      MOCK_FUNCTION("vkCreatePipelineLayout", createPipelineLayout),
      MOCK_FUNCTION("vkDestroyPipelineLayout", destroyPipelineLayout),
      MOCK_FUNCTION("vkCreateDescriptorPool", createDescriptorPool),
      MOCK_FUNCTION("vkDestroyDescriptorPool", destroyDescriptorPool),
      MOCK_FUNCTION("vkResetDescriptorPool", resetDescriptorPool),
      MOCK_FUNCTION("vkCreateComputePipelines", createComputePipelines),
      MOCK_FUNCTION("vkDestroyPipeline", destroyPipeline),
      MOCK_FUNCTION("vkAllocateDescriptorSets", allocateDescriptorSets),
      MOCK_FUNCTION("vkUpdateDescriptorSets", updateDescriptorSets),
      MOCK_FUNCTION("vkCreateBufferView", createBufferView),
      MOCK_FUNCTION("vkDestroyBufferView", destroyBufferView),
      MOCK_FUNCTION("vkCmdBindPipeline", cmdBindPipeline),
      MOCK_FUNCTION("vkCmdBindDescriptorSets", cmdBindDescriptorSets),
      MOCK_FUNCTION("vkCmdPushDescriptorSetKHR", cmdPushDescriptorSet),
      MOCK_FUNCTION("vkCmdPushConstants", cmdPushConstants),
      MOCK_FUNCTION("vkCmdPipelineBarrier", cmdPipelineBarrier),
      MOCK_FUNCTION("vkCmdDispatch", cmdDispatch),
      MOCK_FUNCTION("vkCmdDispatchIndirect", cmdDispatchIndirect),
      MOCK_FUNCTION("vkCmdCopyBuffer", cmdCopyBuffer),
      MOCK_FUNCTION("vkCmdFillBuffer", cmdFillBuffer),
      MOCK_FUNCTION("vkGetPhysicalDeviceMemoryProperties", getPhysicalDeviceMemoryProperties),
      MOCK_FUNCTION("vkAllocateMemory", allocateMemory),
      MOCK_FUNCTION("vkFreeMemory", freeMemory),
      MOCK_FUNCTION("vkMapMemory", mapMemory),
      MOCK_FUNCTION("vkCreateBuffer", createBuffer),
      MOCK_FUNCTION("vkDestroyBuffer", destroyBuffer),
      MOCK_FUNCTION("vkGetBufferMemoryRequirements", getBufferMemoryRequirements),
      MOCK_FUNCTION("vkBindBufferMemory", bindBufferMemory),
      MOCK_FUNCTION("vkCreateQueryPool", createQueryPool),
      MOCK_FUNCTION("vkDestroyQueryPool", destroyQueryPool),
      MOCK_FUNCTION("vkGetQueryPoolResults", getQueryPoolResults),
      MOCK_FUNCTION("vkCmdResetQueryPool", cmdResetQueryPool),
      MOCK_FUNCTION("vkCmdWriteTimestamp", cmdWriteTimestamp),
  };
  const auto found = functions.find(name);
  return found == functions.end() ? nullptr : found->second;
}

PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice, const char* name) {
  return find(name);
}

PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance, const char* name) {
  if (std::string(name) == "vkGetDeviceProcAddr" && !mock->missing.contains(name)) {
    return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
  }
  return find(name);
}

}  // namespace

MockVulkan::MockVulkan() {
  mock = this;
  limits.maxStorageBufferRange = 1 << 27;
  limits.minStorageBufferOffsetAlignment = 256;
  limits.maxComputeWorkGroupCount[0] = limits.maxComputeWorkGroupCount[1] = 65535;
  limits.maxPerStageDescriptorStorageBuffers = 8;
  memoryTypes.memoryTypeCount = memoryTypes.memoryHeapCount = 1;
  memoryTypes.memoryTypes[0].propertyFlags =
      VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT | VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
      VK_MEMORY_PROPERTY_HOST_COHERENT_BIT | VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
  freeMemory.fill(VkDeviceSize{1} << 30);
}

MockVulkan::~MockVulkan() {
  mock = nullptr;
}

vulkan::DeviceDescription MockVulkan::description() const {
  // What kernels for CPU devices need.
  static VkPhysicalDeviceScalarBlockLayoutFeatures scalar{
      VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SCALAR_BLOCK_LAYOUT_FEATURES, nullptr, VK_TRUE};
  static const VkPhysicalDeviceFeatures2 features = [] {
    VkPhysicalDeviceFeatures2 made{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &scalar, {}};
    made.features.shaderInt64 = VK_TRUE;
    return made;
  }();
  vulkan::DeviceDescription description;
  description.enabledFeatures = &features;
  description.instance = reinterpret_cast<VkInstance>(std::uintptr_t{16});
  description.physicalDevice = reinterpret_cast<VkPhysicalDevice>(std::uintptr_t{32});
  description.device = reinterpret_cast<VkDevice>(std::uintptr_t{48});
  description.getInstanceProcAddr = getInstanceProcAddr;
  description.apiVersion = VK_API_VERSION_1_1;
  description.enabledExtensions = extensions;
  description.allocator = allocator;
  return description;
}

VkDeviceSize MockVulkan::memoryBytes() const {
  VkDeviceSize bytes = 0;
  for (const auto& [handle, memory] : memories) bytes += memory.bytes.size();
  return bytes;
}

int MockVulkan::aliveObjects() const {
  int count = 0;
  for (const auto& [kind, number] : alive) count += number;
  return count;
}

}  // namespace dermis::test
