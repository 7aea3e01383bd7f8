#include "plain_scene.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "bench_scene.h"
#include "plain_kernels.h"

namespace dermis::bench {
namespace {

constexpr std::uint32_t workgroupSize = 64;  // of both kernels
constexpr std::uint64_t outputStride = 24;
constexpr std::uint64_t copiedTogether = 24;  // instances, by an invocation of plain_copy.comp
constexpr std::uint32_t bindingCount = 3;
constexpr std::uint32_t mostSets = 64;
/// Whole instances to a dispatch, so many at a time: with 24 bytes a vertex their output begins at
/// a multiple of 256 bytes, the largest alignment that a device may ask for.
constexpr std::uint64_t instanceStep = 32;

void orStop(VkResult result, const char* function) {
  if (result == VK_SUCCESS) return;
  std::fprintf(stderr, "dermis bench: error: %s failed with VkResult %d\n", function,
               static_cast<int>(result));
  std::exit(1);
}

std::uint32_t groupsOf(std::uint64_t invocations) {
  return static_cast<std::uint32_t>((invocations + workgroupSize - 1) / workgroupSize);
}

PlainFunctions loadFunctions(const samples::Device& device) {
  PlainFunctions functions;
  const auto load = [&device](auto& function, const char* name) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(
        device.functions().GetDeviceProcAddr(device.handle(), name));
  };
  load(functions.createShaderModule, "vkCreateShaderModule");
  load(functions.destroyShaderModule, "vkDestroyShaderModule");
  load(functions.createDescriptorSetLayout, "vkCreateDescriptorSetLayout");
  load(functions.destroyDescriptorSetLayout, "vkDestroyDescriptorSetLayout");
  load(functions.createPipelineLayout, "vkCreatePipelineLayout");
  load(functions.destroyPipelineLayout, "vkDestroyPipelineLayout");
  load(functions.createComputePipelines, "vkCreateComputePipelines");
  load(functions.destroyPipeline, "vkDestroyPipeline");
  load(functions.createDescriptorPool, "vkCreateDescriptorPool");
  load(functions.destroyDescriptorPool, "vkDestroyDescriptorPool");
  load(functions.allocateDescriptorSets, "vkAllocateDescriptorSets");
  load(functions.updateDescriptorSets, "vkUpdateDescriptorSets");
  load(functions.cmdBindPipeline, "vkCmdBindPipeline");
  load(functions.cmdBindDescriptorSets, "vkCmdBindDescriptorSets");
  load(functions.cmdPushConstants, "vkCmdPushConstants");
  load(functions.cmdDispatch, "vkCmdDispatch");
  return functions;
}

}  // namespace

PlainScene::PlainScene(samples::OpenDevice& open, const Crowd& crowd, PlainKernel kernel)
    : device_(*open.device),
      kernel_(kernel),
      maxRange_(open.context.limits().maxStorageBufferRange),
      functions_(loadFunctions(device_)) {
  makeBuffers(crowd);
  makeLayouts();
  if (kernel == PlainKernel::dualQuaternion)
    palettePipeline_ = makePipeline(plain_kernels::plain_palette_spirv);
  skinPipeline_ = makePipeline(kernel == PlainKernel::linear ? plain_kernels::plain_linear_spirv
                               : kernel == PlainKernel::copy ? plain_kernels::plain_copy_spirv
                                                             : plain_kernels::plain_skin_spirv);
  record(crowd);
  // The first time drivers compile, and memory is touched.
  skin();
}

PlainScene::~PlainScene() {
  const VkDevice device = device_.handle();
  device_.freeCommandBuffer(commandBuffer_);
  functions_.destroyPipeline(device, palettePipeline_, nullptr);
  functions_.destroyPipeline(device, skinPipeline_, nullptr);
  functions_.destroyDescriptorPool(device, pool_, nullptr);
  functions_.destroyPipelineLayout(device, layout_, nullptr);
  functions_.destroyDescriptorSetLayout(device, setLayout_, nullptr);
}

void PlainScene::makeBuffers(const Crowd& crowd) {
  const std::uint64_t joints = std::uint64_t{crowd.instanceCount()} * crowd.jointCount();
  const auto make = [this](std::uint64_t size) {
    Result<samples::MappedBuffer> buffer =
        samples::MappedBuffer::create(device_, size, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    if (buffer) return std::move(*buffer);
    std::fprintf(stderr, "dermis bench: error: %s\n", buffer.error().message.c_str());
    std::exit(1);
  };
  vertices_ = make(crowd.vertices.size() * sizeof(PlainVertex));
  matrices_ = make(joints * sizeof(JointMatrix));
  palettes_ = make(joints * 32);
  output_ = make(std::uint64_t{crowd.instanceCount()} * crowd.vertexCount() * outputStride);
  std::memcpy(vertices_.bytes().data(), crowd.vertices.data(), vertices_.bytes().size());
  std::byte* place = matrices_.bytes().data();
  for (const std::vector<JointMatrix>& pose : crowd.poses) {
    std::memcpy(place, pose.data(), pose.size() * sizeof(JointMatrix));
    place += pose.size() * sizeof(JointMatrix);
  }
}

void PlainScene::makeLayouts() {
  const VkDevice device = device_.handle();
  std::array<VkDescriptorSetLayoutBinding, bindingCount> bindings{};
  for (std::uint32_t binding = 0; binding < bindingCount; ++binding) {
    bindings[binding] = {binding, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT,
                         nullptr};
  }
  VkDescriptorSetLayoutCreateInfo setInfo{};
  setInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  setInfo.bindingCount = bindingCount;
  setInfo.pBindings = bindings.data();
  orStop(functions_.createDescriptorSetLayout(device, &setInfo, nullptr, &setLayout_),
         "vkCreateDescriptorSetLayout");
  const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, 12};
  VkPipelineLayoutCreateInfo layoutInfo{};
  layoutInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layoutInfo.setLayoutCount = 1;
  layoutInfo.pSetLayouts = &setLayout_;
  layoutInfo.pushConstantRangeCount = 1;
  layoutInfo.pPushConstantRanges = &range;
  orStop(functions_.createPipelineLayout(device, &layoutInfo, nullptr, &layout_),
         "vkCreatePipelineLayout");
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, mostSets * bindingCount};
  VkDescriptorPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  poolInfo.maxSets = mostSets;
  poolInfo.poolSizeCount = 1;
  poolInfo.pPoolSizes = &size;
  orStop(functions_.createDescriptorPool(device, &poolInfo, nullptr, &pool_),
         "vkCreateDescriptorPool");
}

VkPipeline PlainScene::makePipeline(std::span<const std::uint32_t> spirv) {
  const VkDevice device = device_.handle();
  VkShaderModuleCreateInfo moduleInfo{};
  moduleInfo.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  moduleInfo.codeSize = spirv.size_bytes();
  moduleInfo.pCode = spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  orStop(functions_.createShaderModule(device, &moduleInfo, nullptr, &module),
         "vkCreateShaderModule");
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.layout = layout_;
  VkPipeline pipeline = VK_NULL_HANDLE;
  orStop(functions_.createComputePipelines(device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline),
         "vkCreateComputePipelines");
  functions_.destroyShaderModule(device, module, nullptr);
  return pipeline;
}

void PlainScene::bind(VkPipeline pipeline, std::span<const vulkan::BufferRange> buffers) {
  VkDescriptorSetAllocateInfo allocateInfo{};
  allocateInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  allocateInfo.descriptorPool = pool_;
  allocateInfo.descriptorSetCount = 1;
  allocateInfo.pSetLayouts = &setLayout_;
  VkDescriptorSet set = VK_NULL_HANDLE;
  orStop(functions_.allocateDescriptorSets(device_.handle(), &allocateInfo, &set),
         "vkAllocateDescriptorSets");
  std::array<VkDescriptorBufferInfo, bindingCount> infos{};
  std::array<VkWriteDescriptorSet, bindingCount> writes{};
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
  functions_.updateDescriptorSets(device_.handle(), static_cast<std::uint32_t>(buffers.size()),
                                  writes.data(), 0, nullptr);
  functions_.cmdBindPipeline(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
  functions_.cmdBindDescriptorSets(commandBuffer_, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 1,
                                   &set, 0, nullptr);
}

void PlainScene::recordPalettes(const Crowd& crowd) {
  bind(palettePipeline_, std::array{matrices_.range(), palettes_.range()});
  const std::uint32_t jointTotal = crowd.instanceCount() * crowd.jointCount();
  functions_.cmdPushConstants(commandBuffer_, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, 4,
                              &jointTotal);
  functions_.cmdDispatch(commandBuffer_, groupsOf(jointTotal), 1, 1);
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
  device_.functions().CmdPipelineBarrier(commandBuffer_, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                                         VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, 1, &barrier, 0,
                                         nullptr, 0, nullptr);
}

void PlainScene::recordSkinning(const Crowd& crowd) {
  const std::uint64_t instanceSize = crowd.vertexCount() * outputStride;
  const std::uint64_t most = maxRange_ / instanceSize;
  const std::uint64_t step = std::max(most - most % instanceStep, instanceStep);
  for (std::uint64_t first = 0; first < crowd.instanceCount(); first += step) {
    const std::uint64_t count = std::min(step, crowd.instanceCount() - first);
    const samples::MappedBuffer& joints =
        kernel_ == PlainKernel::dualQuaternion ? palettes_ : matrices_;
    bind(skinPipeline_, std::array{vertices_.range(), joints.range(),
                                   vulkan::BufferRange{output_.range().buffer, first * instanceSize,
                                                       count * instanceSize}});
    const bool copies = kernel_ == PlainKernel::copy;
    const std::array<std::uint32_t, 3> push{
        crowd.vertexCount(), copies ? static_cast<std::uint32_t>(count) : crowd.jointCount(),
        static_cast<std::uint32_t>(first)};
    const std::uint64_t rows = copies ? (count + copiedTogether - 1) / copiedTogether : count;
    functions_.cmdPushConstants(commandBuffer_, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                sizeof(push), push.data());
    functions_.cmdDispatch(commandBuffer_, groupsOf(crowd.vertexCount()),
                           static_cast<std::uint32_t>(rows), 1);
  }
}

void PlainScene::record(const Crowd& crowd) {
  commandBuffer_ = device_.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  orStop(device_.functions().BeginCommandBuffer(commandBuffer_, &begin), "vkBeginCommandBuffer");
  if (kernel_ == PlainKernel::dualQuaternion) recordPalettes(crowd);
  recordSkinning(crowd);
  orStop(device_.functions().EndCommandBuffer(commandBuffer_), "vkEndCommandBuffer");
}

double PlainScene::skin() {
  return timedSubmission(device_, commandBuffer_);
}

}  // namespace dermis::bench
