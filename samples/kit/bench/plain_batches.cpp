#include "kit/bench/plain_batches.h"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "dermis/vulkan/context.h"
#include "plain_kernels.h"

namespace dermis::samples {
namespace {

constexpr std::uint32_t workgroupSize = 64;  // of all kernels
constexpr std::uint64_t outputStride = 24;
constexpr std::uint64_t copiedTogether = 24;  // instances per invocation of plain_copy.comp
constexpr std::uint32_t bindingCount = 3;
/// A dispatch skins whole instances, in multiples of this. With 24 bytes per vertex, their output
/// then begins at a multiple of 256 bytes, the largest alignment that a device may require.
constexpr std::uint64_t instanceStep = 32;

std::uint32_t groupsOf(std::uint64_t invocations) {
  return static_cast<std::uint32_t>((invocations + workgroupSize - 1) / workgroupSize);
}

/// The number of instances per dispatch.
std::uint64_t instancesTogether(std::uint64_t maxRange, std::uint64_t instanceSize) {
  const std::uint64_t most = maxRange / instanceSize;
  return std::max(most - most % instanceStep, instanceStep);
}

}  // namespace

PlainBatches::~PlainBatches() {
  for (const VkCommandBuffer commandBuffer : commandBuffers_) {
    if (commandBuffer != VK_NULL_HANDLE) device_.freeCommandBuffer(commandBuffer);
  }
}

Result<std::unique_ptr<PlainBatches>> PlainBatches::create(OpenDevice& open, const Crowd& crowd) {
  std::unique_ptr<PlainBatches> batches(new PlainBatches(open));
  if (Result<void> made = batches->make(crowd); !made) return made.error();
  return batches;
}

Result<void> PlainBatches::make(const Crowd& crowd) {
  Result<Timestamps> timestamps = Timestamps::create(device_);
  if (!timestamps) return timestamps.error();
  timestamps_ = std::move(*timestamps);
  if (Result<void> made = makeBuffers(crowd); !made) return made;
  const std::uint64_t step =
      instancesTogether(maxRange_, std::uint64_t{crowd.vertexCount()} * outputStride);
  const std::uint64_t dispatches = (crowd.instanceCount() + step - 1) / step;
  if (Result<void> made = makeLayouts(static_cast<std::uint32_t>(dispatches)); !made) return made;
  if (Result<void> made = makePipeline(palettePipeline_, plain_kernels::plain_palette_spirv); !made)
    return made;
  const std::array spirv{plain_kernels::plain_skin_spirv, plain_kernels::plain_linear_spirv,
                         plain_kernels::plain_copy_spirv};
  for (std::size_t kernel = 0; kernel < plainKernelCount; ++kernel) {
    if (Result<void> made = makePipeline(pipelines_[kernel], spirv[kernel]); !made) return made;
    if (Result<void> recorded = record(crowd, static_cast<PlainKernel>(kernel)); !recorded)
      return recorded;
    const Result<double> first = skin(static_cast<PlainKernel>(kernel));
    if (!first) return first.error();
  }
  return {};
}

Result<void> PlainBatches::makeBuffers(const Crowd& crowd) {
  const std::uint64_t joints = std::uint64_t{crowd.instanceCount()} * crowd.jointCount();
  const std::uint64_t vertices = crowd.vertices.size();
  const auto make = [this](auto& buffer, std::uint64_t size) -> Result<void> {
    using Buffer = std::remove_reference_t<decltype(buffer)>;
    Result<Buffer> made = Buffer::create(device_, size, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    if (!made) return made.error();
    buffer = std::move(*made);
    return {};
  };
  for (const Result<void>& made :
       {make(vertices_, vertices * sizeof(PlainVertex)),
        make(matrices_, joints * sizeof(JointMatrix)), make(palettes_, joints * 32),
        make(output_, crowd.instanceCount() * vertices * outputStride)}) {
    if (!made) return made;
  }
  std::memcpy(vertices_.bytes().data(), crowd.vertices.data(),
              crowd.vertices.size() * sizeof(PlainVertex));
  std::byte* place = matrices_.bytes().data();
  for (const std::vector<JointMatrix>& pose : crowd.poses) {
    std::memcpy(place, pose.data(), pose.size() * sizeof(JointMatrix));
    place += pose.size() * sizeof(JointMatrix);
  }
  return {};
}

Result<void> PlainBatches::makeLayouts(std::uint32_t dispatches) {
  std::array<VkDescriptorSetLayoutBinding, bindingCount> bindings{};
  for (std::uint32_t binding = 0; binding < bindingCount; ++binding) {
    bindings[binding] = {binding, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT,
                         nullptr};
  }
  VkDescriptorSetLayoutCreateInfo setInfo{};
  setInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  setInfo.bindingCount = bindingCount;
  setInfo.pBindings = bindings.data();
  Result<render::Owned<VkDescriptorSetLayout>> setLayout =
      DERMIS_MAKE(device_, DescriptorSetLayout, setInfo);
  if (!setLayout) return setLayout.error();
  setLayout_ = std::move(*setLayout);
  const VkDescriptorSetLayout set = setLayout_.get();
  const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, 12};
  VkPipelineLayoutCreateInfo layoutInfo{};
  layoutInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layoutInfo.setLayoutCount = 1;
  layoutInfo.pSetLayouts = &set;
  layoutInfo.pushConstantRangeCount = 1;
  layoutInfo.pPushConstantRanges = &range;
  Result<render::Owned<VkPipelineLayout>> layout = DERMIS_MAKE(device_, PipelineLayout, layoutInfo);
  if (!layout) return layout.error();
  layout_ = std::move(*layout);
  // The sets of the three kernels, and that of the palettes.
  const std::uint32_t sets = dispatches * std::uint32_t{plainKernelCount} + 1;
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, sets * bindingCount};
  VkDescriptorPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  poolInfo.maxSets = sets;
  poolInfo.poolSizeCount = 1;
  poolInfo.pPoolSizes = &size;
  Result<render::Owned<VkDescriptorPool>> pool = DERMIS_MAKE(device_, DescriptorPool, poolInfo);
  if (!pool) return pool.error();
  pool_ = std::move(*pool);
  return {};
}

Result<void> PlainBatches::makePipeline(render::Owned<VkPipeline>& pipeline,
                                        std::span<const std::uint32_t> spirv) {
  VkShaderModuleCreateInfo moduleInfo{};
  moduleInfo.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  moduleInfo.codeSize = spirv.size_bytes();
  moduleInfo.pCode = spirv.data();
  const Result<render::Owned<VkShaderModule>> module =
      DERMIS_MAKE(device_, ShaderModule, moduleInfo);
  if (!module) return module.error();
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module->get();
  info.stage.pName = "main";
  info.layout = layout_.get();
  const VulkanFunctions& functions = device_.functions();
  VkPipeline made = VK_NULL_HANDLE;
  const VkResult result =
      functions.CreateComputePipelines(device_.handle(), VK_NULL_HANDLE, 1, &info, nullptr, &made);
  pipeline = {device_.handle(), made, functions.DestroyPipeline};
  return checkVulkan("vkCreateComputePipelines", result);
}

Result<void> PlainBatches::bind(VkCommandBuffer commandBuffer, VkPipeline pipeline,
                                std::span<const vulkan::BufferRange> buffers) {
  VkDescriptorSetAllocateInfo allocateInfo{};
  allocateInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  const VkDescriptorSetLayout layout = setLayout_.get();
  allocateInfo.descriptorPool = pool_.get();
  allocateInfo.descriptorSetCount = 1;
  allocateInfo.pSetLayouts = &layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  if (Result<void> good = checkVulkan(
          "vkAllocateDescriptorSets",
          device_.functions().AllocateDescriptorSets(device_.handle(), &allocateInfo, &set));
      !good)
    return good;
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
  device_.functions().UpdateDescriptorSets(
      device_.handle(), static_cast<std::uint32_t>(buffers.size()), writes.data(), 0, nullptr);
  device_.functions().CmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
  device_.functions().CmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE,
                                            layout_.get(), 0, 1, &set, 0, nullptr);
  return {};
}

Result<void> PlainBatches::recordPalettes(const Crowd& crowd, VkCommandBuffer commandBuffer) {
  if (Result<void> bound = bind(commandBuffer, palettePipeline_.get(),
                                std::array{matrices_.range(), palettes_.range()});
      !bound)
    return bound;
  const std::uint32_t jointTotal = crowd.instanceCount() * crowd.jointCount();
  device_.functions().CmdPushConstants(commandBuffer, layout_.get(), VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                       4, &jointTotal);
  device_.functions().CmdDispatch(commandBuffer, groupsOf(jointTotal), 1, 1);
  recordBarrier(device_, commandBuffer,
                vulkan::barrierBetween(Use::computeWrite, Use::computeRead));
  return {};
}

Result<void> PlainBatches::recordSkinning(const Crowd& crowd, PlainKernel kernel,
                                          VkCommandBuffer commandBuffer) {
  const std::uint64_t instanceSize = std::uint64_t{crowd.vertexCount()} * outputStride;
  const std::uint64_t step = instancesTogether(maxRange_, instanceSize);
  const vulkan::BufferRange joints =
      kernel == PlainKernel::dualQuaternion ? palettes_.range() : matrices_.range();
  for (std::uint64_t first = 0; first < crowd.instanceCount(); first += step) {
    const std::uint64_t count = std::min(step, crowd.instanceCount() - first);
    const vulkan::BufferRange written{output_.range().buffer, first * instanceSize,
                                      count * instanceSize};
    if (Result<void> bound = bind(commandBuffer, pipelines_[static_cast<std::size_t>(kernel)].get(),
                                  std::array{vertices_.range(), joints, written});
        !bound)
      return bound;
    const bool copies = kernel == PlainKernel::copy;
    const std::array<std::uint32_t, 3> push{
        crowd.vertexCount(), copies ? static_cast<std::uint32_t>(count) : crowd.jointCount(),
        static_cast<std::uint32_t>(first)};
    const std::uint64_t rows = copies ? (count + copiedTogether - 1) / copiedTogether : count;
    device_.functions().CmdPushConstants(commandBuffer, layout_.get(), VK_SHADER_STAGE_COMPUTE_BIT,
                                         0, sizeof(push), push.data());
    device_.functions().CmdDispatch(commandBuffer, groupsOf(crowd.vertexCount()),
                                    static_cast<std::uint32_t>(rows), 1);
  }
  return {};
}

Result<void> PlainBatches::record(const Crowd& crowd, PlainKernel kernel) {
  VkCommandBuffer& commandBuffer = commandBuffers_[static_cast<std::size_t>(kernel)];
  commandBuffer = device_.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT;
  if (Result<void> begun = checkVulkan(
          "vkBeginCommandBuffer", device_.functions().BeginCommandBuffer(commandBuffer, &begin));
      !begun)
    return begun;
  // After the previous execution.
  recordBarrier(device_, commandBuffer,
                vulkan::barrierBetween(Use::computeWrite, Use::computeWrite | Use::computeRead));
  timestamps_.recordBegin(commandBuffer);
  if (kernel == PlainKernel::dualQuaternion) {
    if (Result<void> recorded = recordPalettes(crowd, commandBuffer); !recorded) return recorded;
  }
  if (Result<void> recorded = recordSkinning(crowd, kernel, commandBuffer); !recorded)
    return recorded;
  timestamps_.recordEnd(commandBuffer);
  return checkVulkan("vkEndCommandBuffer", device_.functions().EndCommandBuffer(commandBuffer));
}

Result<double> PlainBatches::skin(PlainKernel kernel) {
  return timestamps_.measure(commandBuffers_[static_cast<std::size_t>(kernel)]);
}

}  // namespace dermis::samples
