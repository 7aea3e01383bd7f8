#include "kit/bench/storage_kernels.h"

#include <utility>
#include <vector>

namespace dermis::samples {

Result<StorageKernels> StorageKernels::create(Device& device, std::uint32_t bindings,
                                              std::uint32_t pushConstantBytes, std::uint32_t sets) {
  StorageKernels kernels;
  kernels.device_ = &device;
  std::vector<VkDescriptorSetLayoutBinding> buffers(bindings);
  for (std::uint32_t binding = 0; binding < bindings; ++binding) {
    buffers[binding] = {binding, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT,
                        nullptr};
  }
  VkDescriptorSetLayoutCreateInfo setInfo{};
  setInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  setInfo.bindingCount = bindings;
  setInfo.pBindings = buffers.data();
  auto setLayout = DERMIS_MAKE(device, DescriptorSetLayout, setInfo);
  if (!setLayout) return setLayout.error();
  kernels.setLayout_ = std::move(*setLayout);
  const VkDescriptorSetLayout set = kernels.setLayout_.get();
  const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, pushConstantBytes};
  VkPipelineLayoutCreateInfo layoutInfo{};
  layoutInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layoutInfo.setLayoutCount = 1;
  layoutInfo.pSetLayouts = &set;
  layoutInfo.pushConstantRangeCount = 1;
  layoutInfo.pPushConstantRanges = &range;
  auto layout = DERMIS_MAKE(device, PipelineLayout, layoutInfo);
  if (!layout) return layout.error();
  kernels.layout_ = std::move(*layout);
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, sets * bindings};
  VkDescriptorPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  poolInfo.maxSets = sets;
  poolInfo.poolSizeCount = 1;
  poolInfo.pPoolSizes = &size;
  auto pool = DERMIS_MAKE(device, DescriptorPool, poolInfo);
  if (!pool) return pool.error();
  kernels.pool_ = std::move(*pool);
  return kernels;
}

Result<render::Owned<VkPipeline>> StorageKernels::makePipeline(
    std::span<const std::uint32_t> spirv) const {
  VkShaderModuleCreateInfo moduleInfo{};
  moduleInfo.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  moduleInfo.codeSize = spirv.size_bytes();
  moduleInfo.pCode = spirv.data();
  const auto module = DERMIS_MAKE(*device_, ShaderModule, moduleInfo);
  if (!module) return module.error();
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module->get();
  info.stage.pName = "main";
  info.layout = layout_.get();
  const VulkanFunctions& functions = device_->functions();
  VkPipeline made = VK_NULL_HANDLE;
  const VkResult result =
      functions.CreateComputePipelines(device_->handle(), VK_NULL_HANDLE, 1, &info, nullptr, &made);
  if (result != VK_SUCCESS) return vulkanError("vkCreateComputePipelines", result);
  return render::Owned<VkPipeline>(device_->handle(), made, functions.DestroyPipeline);
}

Result<void> StorageKernels::bind(VkCommandBuffer commandBuffer, VkPipeline pipeline,
                                  std::span<const vulkan::BufferRange> buffers) const {
  VkDescriptorSetAllocateInfo allocateInfo{};
  allocateInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  const VkDescriptorSetLayout layout = setLayout_.get();
  allocateInfo.descriptorPool = pool_.get();
  allocateInfo.descriptorSetCount = 1;
  allocateInfo.pSetLayouts = &layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  const VulkanFunctions& functions = device_->functions();
  if (Result<void> good =
          checkVulkan("vkAllocateDescriptorSets",
                      functions.AllocateDescriptorSets(device_->handle(), &allocateInfo, &set));
      !good)
    return good;
  std::vector<VkDescriptorBufferInfo> infos(buffers.size());
  std::vector<VkWriteDescriptorSet> writes(buffers.size());
  for (std::uint32_t binding = 0; binding < buffers.size(); ++binding) {
    const vulkan::BufferRange& range = buffers[binding];
    infos[binding] = {range.buffer, range.offset, range.size};
    writes[binding].sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    writes[binding].dstSet = set;
    writes[binding].dstBinding = binding;
    writes[binding].descriptorCount = 1;
    writes[binding].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    writes[binding].pBufferInfo = &infos[binding];
  }
  functions.UpdateDescriptorSets(device_->handle(), static_cast<std::uint32_t>(buffers.size()),
                                 writes.data(), 0, nullptr);
  functions.CmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
  functions.CmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, layout_.get(), 0,
                                  1, &set, 0, nullptr);
  return {};
}

void StorageKernels::push(VkCommandBuffer commandBuffer,
                          std::span<const std::uint32_t> values) const {
  device_->functions().CmdPushConstants(commandBuffer, layout_.get(), VK_SHADER_STAGE_COMPUTE_BIT,
                                        0, static_cast<std::uint32_t>(values.size_bytes()),
                                        values.data());
}

}  // namespace dermis::samples
