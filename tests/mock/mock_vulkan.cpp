#include "mock_vulkan.h"

#include <algorithm>
#include <cstring>

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

void VKAPI_CALL getPhysicalDeviceProperties(VkPhysicalDevice,
                                            VkPhysicalDeviceProperties* properties) {
  *properties = {};
  properties->apiVersion = VK_API_VERSION_1_1;
  properties->limits = mock->limits;
  properties->deviceType = mock->deviceType;
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
void VKAPI_CALL cmdPipelineBarrier(VkCommandBuffer, VkPipelineStageFlags, VkPipelineStageFlags,
                                   VkDependencyFlags, std::uint32_t memoryCount,
                                   const VkMemoryBarrier* memory, std::uint32_t bufferCount,
                                   const VkBufferMemoryBarrier* buffers, std::uint32_t,
                                   const VkImageMemoryBarrier*) {
  mock->commands.push_back("barrier");
  mock->memoryBarriers.insert(mock->memoryBarriers.end(), memory, memory + memoryCount);
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
void VKAPI_CALL cmdCopyBuffer(VkCommandBuffer, VkBuffer, VkBuffer, std::uint32_t,
                              const VkBufferCopy*) {
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
      MOCK_FUNCTION("vkCreateShaderModule", createShaderModule),
      MOCK_FUNCTION("vkDestroyShaderModule", destroyShaderModule),
      MOCK_FUNCTION("vkCreateDescriptorSetLayout", createDescriptorSetLayout),
      MOCK_FUNCTION("vkDestroyDescriptorSetLayout", destroyDescriptorSetLayout),
      MOCK_FUNCTION("vkCreatePipelineLayout", createPipelineLayout),
      MOCK_FUNCTION("vkDestroyPipelineLayout", destroyPipelineLayout),
      MOCK_FUNCTION("vkCreateDescriptorPool", createDescriptorPool),
      MOCK_FUNCTION("vkDestroyDescriptorPool", destroyDescriptorPool),
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
}

MockVulkan::~MockVulkan() {
  mock = nullptr;
}

vulkan::DeviceDescription MockVulkan::description() const {
  vulkan::DeviceDescription description;
  description.instance = reinterpret_cast<VkInstance>(std::uintptr_t{16});
  description.physicalDevice = reinterpret_cast<VkPhysicalDevice>(std::uintptr_t{32});
  description.device = reinterpret_cast<VkDevice>(std::uintptr_t{48});
  description.getInstanceProcAddr = getInstanceProcAddr;
  description.enabledExtensions = extensions;
  description.allocator = allocator;
  return description;
}

int MockVulkan::aliveObjects() const {
  int count = 0;
  for (const auto& [kind, number] : alive) count += number;
  return count;
}

}  // namespace dermis::test
