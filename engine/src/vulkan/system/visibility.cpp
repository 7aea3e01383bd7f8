#include "vulkan/system/visibility.h"

#include <array>

#include "abi.h"
#include "dermis_kernels.h"

namespace dermis::vulkan {
namespace {

/// In the order of the ranges of `Visibility::Buffers`.
constexpr std::array<std::uint32_t, 5> bindingNumbers{
    0, abi::BINDING_VISIBILITY, abi::BINDING_HISTORY, abi::BINDING_COUNTERS, abi::BINDING_RESULTS};
static_assert(abi::BINDING_TABLES == 0);

}  // namespace

Visibility::~Visibility() {
  if (context_ == nullptr) return;
  const DispatchTable& table = context_->table;
  table.destroyPipeline(context_->device, pipeline_, context_->allocator);
  table.destroyDescriptorPool(context_->device, pool_, context_->allocator);
  table.destroyPipelineLayout(context_->device, pipelineLayout_, context_->allocator);
  table.destroyDescriptorSetLayout(context_->device, setLayout_, context_->allocator);
}

bool Visibility::hasResults() const {
  return context_->bindingCount() == abi::BINDING_COUNT;
}

Result<void> Visibility::create(const ContextState& context, const Tuning& tuning,
                                std::uint32_t setCount) {
  context_ = &context;
  if (Result<void> made = createLayouts(setCount); !made) return made;
  return createPipeline(tuning);
}

Result<void> Visibility::createLayouts(std::uint32_t setCount) {
  const DispatchTable& table = context_->table;
  const std::uint32_t bindingCount = hasResults() ? 5 : 4;
  std::array<VkDescriptorSetLayoutBinding, bindingNumbers.size()> bindings{};
  for (std::uint32_t index = 0; index < bindingCount; ++index) {
    bindings[index] = {bindingNumbers[index], VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1,
                       VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
  }
  VkDescriptorSetLayoutCreateInfo setInfo{};
  setInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  if (context_->pushesDescriptors())
    setInfo.flags = VK_DESCRIPTOR_SET_LAYOUT_CREATE_PUSH_DESCRIPTOR_BIT_KHR;
  setInfo.bindingCount = bindingCount;
  setInfo.pBindings = bindings.data();
  VkResult result =
      table.createDescriptorSetLayout(context_->device, &setInfo, context_->allocator, &setLayout_);
  if (result != VK_SUCCESS) {
    setLayout_ = VK_NULL_HANDLE;  // what a failed call leaves there is undefined
    return vulkanError("vkCreateDescriptorSetLayout", result);
  }
  const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(abi::VisibilityPush)};
  VkPipelineLayoutCreateInfo layoutInfo{};
  layoutInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layoutInfo.setLayoutCount = 1;
  layoutInfo.pSetLayouts = &setLayout_;
  layoutInfo.pushConstantRangeCount = 1;
  layoutInfo.pPushConstantRanges = &range;
  result = table.createPipelineLayout(context_->device, &layoutInfo, context_->allocator,
                                      &pipelineLayout_);
  if (result != VK_SUCCESS) {
    pipelineLayout_ = VK_NULL_HANDLE;
    return vulkanError("vkCreatePipelineLayout", result);
  }
  if (context_->pushesDescriptors()) return {};

  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, setCount * bindingCount};
  VkDescriptorPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  poolInfo.maxSets = setCount;
  poolInfo.poolSizeCount = 1;
  poolInfo.pPoolSizes = &size;
  result = table.createDescriptorPool(context_->device, &poolInfo, context_->allocator, &pool_);
  if (result != VK_SUCCESS) {
    pool_ = VK_NULL_HANDLE;
    return vulkanError("vkCreateDescriptorPool", result);
  }
  const std::vector<VkDescriptorSetLayout> layouts(setCount, setLayout_);
  sets_.resize(setCount);
  VkDescriptorSetAllocateInfo allocateInfo{};
  allocateInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  allocateInfo.descriptorPool = pool_;
  allocateInfo.descriptorSetCount = setCount;
  allocateInfo.pSetLayouts = layouts.data();
  result = table.allocateDescriptorSets(context_->device, &allocateInfo, sets_.data());
  if (result != VK_SUCCESS) return vulkanError("vkAllocateDescriptorSets", result);
  return {};
}

Result<void> Visibility::createPipeline(const Tuning& tuning) {
  const DispatchTable& table = context_->table;
  const std::span<const std::uint32_t> spirv =
      hasResults() ? kernels::visibility_spirv : kernels::visibility_one_output_spirv;
  VkShaderModuleCreateInfo moduleInfo{};
  moduleInfo.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  moduleInfo.codeSize = spirv.size_bytes();
  moduleInfo.pCode = spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  VkResult result =
      table.createShaderModule(context_->device, &moduleInfo, context_->allocator, &module);
  if (result != VK_SUCCESS) return vulkanError("vkCreateShaderModule", result);

  const VkSpecializationMapEntry entry{abi::CONSTANT_WORKGROUP_SIZE, 0, 4};
  VkSpecializationInfo specialization{};
  specialization.mapEntryCount = 1;
  specialization.pMapEntries = &entry;
  specialization.dataSize = 4;
  specialization.pData = &tuning.workgroupSize;
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = &specialization;
  info.layout = pipelineLayout_;
  result = table.createComputePipelines(context_->device, context_->pipelines->cache(), 1, &info,
                                        context_->allocator, &pipeline_);
  table.destroyShaderModule(context_->device, module, context_->allocator);
  if (result != VK_SUCCESS) {
    pipeline_ = VK_NULL_HANDLE;
    return vulkanError("vkCreateComputePipelines", result);
  }
  const VkDevice device = context_->device;
  nameObject(table, device, VK_OBJECT_TYPE_PIPELINE, pipeline_, "dermis visibility");
  nameObject(table, device, VK_OBJECT_TYPE_PIPELINE_LAYOUT, pipelineLayout_, "dermis visibility");
  nameObject(table, device, VK_OBJECT_TYPE_DESCRIPTOR_SET_LAYOUT, setLayout_, "dermis visibility");
  nameObject(table, device, VK_OBJECT_TYPE_DESCRIPTOR_POOL, pool_, "dermis visibility");
  return {};
}

void Visibility::bind(VkCommandBuffer commandBuffer, const Buffers& buffers,
                      std::uint32_t set) const {
  const DispatchTable& table = context_->table;
  std::array<VkDescriptorBufferInfo, bindingNumbers.size()> infos{};
  std::array<VkWriteDescriptorSet, bindingNumbers.size()> writes{};
  const std::array<const BufferRange*, bindingNumbers.size()> ranges{
      &buffers.tables, &buffers.visibility, &buffers.history, &buffers.counters,
      // Without bounds there is no such buffer, and no record that names one.
      buffers.results.buffer != VK_NULL_HANDLE ? &buffers.results : &buffers.counters};
  const std::uint32_t count = hasResults() ? 5 : 4;
  for (std::uint32_t index = 0; index < count; ++index) {
    infos[index] = {ranges[index]->buffer, ranges[index]->offset, ranges[index]->size};
    writes[index].sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    writes[index].dstSet = sets_.empty() ? VK_NULL_HANDLE : sets_[set];
    writes[index].dstBinding = bindingNumbers[index];
    writes[index].descriptorCount = 1;
    writes[index].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    writes[index].pBufferInfo = &infos[index];
  }
  table.cmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
  if (context_->pushesDescriptors()) {
    table.cmdPushDescriptorSet(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, pipelineLayout_, 0,
                               count, writes.data());
  } else {
    table.updateDescriptorSets(context_->device, count, writes.data(), 0, nullptr);
    table.cmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, pipelineLayout_, 0,
                                1, &sets_[set], 0, nullptr);
  }
}

void Visibility::record(VkCommandBuffer commandBuffer, const CulledTables& tables,
                        const Buffers& buffers, std::uint32_t frame, std::uint32_t set) const {
  const DispatchTable& table = context_->table;
  const Label label(table, commandBuffer, "dermis: choose visible instances");
  bind(commandBuffer, buffers, set);
  abi::VisibilityPush push{};
  push.groups = tables.groups;
  push.candidates = tables.candidates;
  push.instances = tables.instances;
  push.firstInstance = tables.firstInstance;
  push.frame = frame;
  push.dispatches = tables.dispatches;
  push.arguments = tables.arguments;
  push.mostWorkgroups = context_->limits.maxWorkgroupCountX;
  const auto pass = [&](std::uint32_t which, std::uint32_t workgroups, VkPipelineStageFlags readers,
                        VkAccessFlags accesses) {
    push.pass = which;
    table.cmdPushConstants(commandBuffer, pipelineLayout_, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                           sizeof(push), &push);
    table.cmdDispatch(commandBuffer, workgroups, 1, 1);
    VkMemoryBarrier barrier{};
    barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
    barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
    barrier.dstAccessMask = accesses;
    table.cmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, readers, 0, 1,
                             &barrier, 0, nullptr, 0, nullptr);
  };
  constexpr VkAccessFlags shader = VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT;
  pass(abi::VISIBILITY_CHOOSES, tables.groupCount, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, shader);
  pass(abi::VISIBILITY_COUNTS, tables.dispatchCount,
       VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT,
       shader | VK_ACCESS_INDIRECT_COMMAND_READ_BIT);
}

}  // namespace dermis::vulkan
