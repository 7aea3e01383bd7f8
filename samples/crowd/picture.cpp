#include "picture.h"

#include <algorithm>
#include <array>
#include <cstring>

#include <glm/ext/matrix_clip_space.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec4.hpp>

#include "dermis/vulkan/drawing.h"
#include "dermis_crowd_shaders.h"
#include "kit/program.h"

namespace crowd {

using namespace dermis;
using namespace dermis::samples;
using namespace dermis::samples::render;

namespace {

constexpr std::uint32_t width = 1280, height = 720;

/// `Figure` of the vertex shader.
struct FigureBlock {
  JointMatrix place;
  glm::vec3 color;
  std::int32_t firstVertex;
  std::uint32_t firstTexcoord, padding[3];
};
static_assert(sizeof(FigureBlock) == 80);

template <typename T>
MappedBuffer bufferOf(Device& device, std::span<const T> data, VkBufferUsageFlags usage) {
  MappedBuffer buffer = must(MappedBuffer::create(device, data.size_bytes(), usage));
  std::memcpy(buffer.bytes().data(), data.data(), data.size_bytes());
  return buffer;
}

Owned<VkShaderModule> moduleOf(const Device& device, std::span<const std::uint32_t> words) {
  VkShaderModuleCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  info.codeSize = words.size_bytes();
  info.pCode = words.data();
  return must(DERMIS_MAKE(device, ShaderModule, info));
}

VkPipelineShaderStageCreateInfo stageOf(VkShaderStageFlagBits stage, VkShaderModule module) {
  VkPipelineShaderStageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage = stage;
  info.module = module;
  info.pName = "main";
  return info;
}

}  // namespace

Painter::Painter(Device& device, const Character& character, std::span<const MeshHandle> meshes,
                 const VertexLayout& layout, bool drawsOneByOne)
    : device_(&device), drawsOneByOne_(drawsOneByOne || !device.info().indirectDraws) {
  const VkFormat depthFormat = chooseDepthFormat(device);
  pass_ = must(makePicturePass(device, depthFormat));
  target_ = must(RenderTarget::create(device, pass_.get(), depthFormat, width, height));
  std::vector<std::uint32_t> indices;
  std::vector<float> texcoords;
  for (std::size_t part = 0; part < meshes.size(); ++part) {
    const gltf::Primitive& source = *character.parts()[part].source;
    indexRanges_.resize(std::max(indexRanges_.size(), meshes[part].index + std::size_t{1}));
    indexRanges_[meshes[part].index] = {static_cast<std::uint32_t>(indices.size()),
                                        static_cast<std::uint32_t>(source.triangles.size())};
    indices.insert(indices.end(), source.triangles.begin(), source.triangles.end());
    firstTexcoords_.push_back(static_cast<std::uint32_t>(texcoords.size() / 2));
    const std::size_t end = texcoords.size() + 2 * std::size_t{source.vertexCount};
    if (!source.texcoords.empty()) {
      texcoords.insert(texcoords.end(), source.texcoords[0].begin(), source.texcoords[0].end());
    }
    texcoords.resize(end);
  }
  indices_ = bufferOf<std::uint32_t>(device, indices, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
  texcoords_ = bufferOf<float>(device, texcoords, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  makeSet();
  makePipeline(layout);
}

void Painter::makeSet() {
  std::array<VkDescriptorSetLayoutBinding, 2> bindings{};
  for (std::uint32_t slot = 0; slot < 2; ++slot)
    bindings[slot] = {slot, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_VERTEX_BIT,
                      nullptr};
  VkDescriptorSetLayoutCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  info.bindingCount = 2;
  info.pBindings = bindings.data();
  setLayout_ = must(DERMIS_MAKE(*device_, DescriptorSetLayout, info));
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 2};
  VkDescriptorPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  poolInfo.maxSets = poolInfo.poolSizeCount = 1;
  poolInfo.pPoolSizes = &size;
  pool_ = must(DERMIS_MAKE(*device_, DescriptorPool, poolInfo));
  const VkDescriptorSetLayout layout = setLayout_.get();
  VkDescriptorSetAllocateInfo setInfo{};
  setInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  setInfo.descriptorPool = pool_.get();
  setInfo.descriptorSetCount = 1;
  setInfo.pSetLayouts = &layout;
  if (const VkResult result =
          device_->functions().AllocateDescriptorSets(device_->handle(), &setInfo, &set_);
      result != VK_SUCCESS)
    throw Failure(vulkanError("vkAllocateDescriptorSets", result));
}

void Painter::makePipeline(const VertexLayout& layout) {
  const VkDescriptorSetLayout sets = setLayout_.get();
  const VkPushConstantRange constants{VK_SHADER_STAGE_VERTEX_BIT, 0, sizeof(glm::mat4)};
  VkPipelineLayoutCreateInfo layoutInfo{};
  layoutInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layoutInfo.setLayoutCount = layoutInfo.pushConstantRangeCount = 1;
  layoutInfo.pSetLayouts = &sets;
  layoutInfo.pPushConstantRanges = &constants;
  layout_ = must(DERMIS_MAKE(*device_, PipelineLayout, layoutInfo));

  const Owned<VkShaderModule> vertex = moduleOf(*device_, shaders::crowd_vert_spirv),
                              fragment = moduleOf(*device_, shaders::crowd_frag_spirv);
  const std::array stages{stageOf(VK_SHADER_STAGE_VERTEX_BIT, vertex.get()),
                          stageOf(VK_SHADER_STAGE_FRAGMENT_BIT, fragment.get())};
  const vulkan::VertexInput input = must(vulkan::vertexInput(layout));
  VkPipelineVertexInputStateCreateInfo vertexInput{};
  vertexInput.sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO;
  vertexInput.vertexBindingDescriptionCount = input.bindingCount;
  vertexInput.pVertexBindingDescriptions = input.bindings.data();
  vertexInput.vertexAttributeDescriptionCount = 2;  // not the previous positions
  vertexInput.pVertexAttributeDescriptions = input.attributes.data();
  VkPipelineInputAssemblyStateCreateInfo assembly{};
  assembly.sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO;
  assembly.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  const VkViewport viewport{0, 0, width, height, 0, 1};
  const VkRect2D scissor{{0, 0}, {width, height}};
  VkPipelineViewportStateCreateInfo view{};
  view.sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO;
  view.viewportCount = view.scissorCount = 1;
  view.pViewports = &viewport;
  view.pScissors = &scissor;
  VkPipelineRasterizationStateCreateInfo raster{};
  raster.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO;
  raster.cullMode = VK_CULL_MODE_NONE;
  raster.lineWidth = 1;
  VkPipelineMultisampleStateCreateInfo samples{};
  samples.sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO;
  samples.rasterizationSamples = sampleCount;
  VkPipelineDepthStencilStateCreateInfo depth{};
  depth.sType = VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO;
  depth.depthTestEnable = depth.depthWriteEnable = VK_TRUE;
  depth.depthCompareOp = VK_COMPARE_OP_LESS;
  VkPipelineColorBlendAttachmentState attachment{};
  attachment.colorWriteMask = VK_COLOR_COMPONENT_R_BIT | VK_COLOR_COMPONENT_G_BIT |
                              VK_COLOR_COMPONENT_B_BIT | VK_COLOR_COMPONENT_A_BIT;
  VkPipelineColorBlendStateCreateInfo blend{};
  blend.sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO;
  blend.attachmentCount = 1;
  blend.pAttachments = &attachment;
  VkGraphicsPipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO;
  info.stageCount = 2;
  info.pStages = stages.data();
  info.pVertexInputState = &vertexInput;
  info.pInputAssemblyState = &assembly;
  info.pViewportState = &view;
  info.pRasterizationState = &raster;
  info.pMultisampleState = &samples;
  info.pDepthStencilState = &depth;
  info.pColorBlendState = &blend;
  info.layout = layout_.get();
  info.renderPass = pass_.get();
  VkPipeline pipeline = VK_NULL_HANDLE;
  if (const VkResult result = device_->functions().CreateGraphicsPipelines(
          device_->handle(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline);
      result != VK_SUCCESS)
    throw Failure(vulkanError("vkCreateGraphicsPipelines", result));
  pipeline_ = {device_->handle(), pipeline, device_->functions().DestroyPipeline};
}

void Painter::record(VkCommandBuffer commandBuffer, const Scene& scene, VkBuffer vertices,
                     std::span<const Drawn> figures, const glm::mat4& viewProjection) {
  // [draws]
  std::vector<InstanceHandle> instances;
  for (const Drawn& figure : figures) instances.push_back(figure.instance);
  draws_.resize(instances.size());
  must(scene.indexedDraws(instances, indexRanges_, draws_));
  std::vector<FigureBlock> blocks;
  for (std::size_t i = 0; i < figures.size(); ++i)
    blocks.push_back({figures[i].place,
                      figures[i].color,
                      draws_[i].vertexOffset,
                      firstTexcoords_[figures[i].part],
                      {}});
  // [/draws]
  if (blocks.empty()) blocks.emplace_back();  // a descriptor needs a buffer
  figures_ = bufferOf<FigureBlock>(*device_, blocks, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
  if (!draws_.empty())
    arguments_ = bufferOf<IndexedDraw>(*device_, draws_, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
  const std::array buffers{VkDescriptorBufferInfo{figures_.handle(), 0, VK_WHOLE_SIZE},
                           VkDescriptorBufferInfo{texcoords_.handle(), 0, VK_WHOLE_SIZE}};
  VkWriteDescriptorSet write{};
  write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
  write.dstSet = set_;
  write.descriptorCount = 2;
  write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  write.pBufferInfo = buffers.data();
  const VulkanFunctions& functions = device_->functions();
  functions.UpdateDescriptorSets(device_->handle(), 1, &write, 0, nullptr);

  std::array<VkClearValue, 2> clear{};
  clear[0].color = {{0.35f, 0.5f, 0.65f, 1}};
  clear[1].depthStencil.depth = 1;
  VkRenderPassBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
  begin.renderPass = pass_.get();
  begin.framebuffer = target_.framebuffer();
  begin.renderArea.extent = {width, height};
  begin.clearValueCount = 2;
  begin.pClearValues = clear.data();
  functions.CmdBeginRenderPass(commandBuffer, &begin, VK_SUBPASS_CONTENTS_INLINE);
  functions.CmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline_.get());
  functions.CmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS, layout_.get(), 0,
                                  1, &set_, 0, nullptr);
  functions.CmdPushConstants(commandBuffer, layout_.get(), VK_SHADER_STAGE_VERTEX_BIT, 0,
                             sizeof(viewProjection), &viewProjection);
  const VkDeviceSize zero = 0;
  functions.CmdBindVertexBuffers(commandBuffer, 0, 1, &vertices, &zero);
  functions.CmdBindIndexBuffer(commandBuffer, indices_.handle(), 0, VK_INDEX_TYPE_UINT32);
  draw(commandBuffer);
  functions.CmdEndRenderPass(commandBuffer);
  target_.recordReadBack(*device_, commandBuffer);
}

void Painter::draw(VkCommandBuffer commandBuffer) const {
  const VulkanFunctions& functions = device_->functions();
  // [draw]
  constexpr std::size_t most = 65'535;  // that every device takes by one command
  if (!drawsOneByOne_ && draws_.size() <= most) {
    functions.CmdDrawIndexedIndirect(commandBuffer, arguments_.handle(), 0,
                                     static_cast<std::uint32_t>(draws_.size()),
                                     sizeof(IndexedDraw));
    return;
  }
  for (const IndexedDraw& draw : draws_)
    functions.CmdDrawIndexed(commandBuffer, draw.indexCount, draw.instanceCount, draw.firstIndex,
                             draw.vertexOffset, draw.firstInstance);
  // [/draw]
}

Picture Painter::picture() const {
  return {width, height, target_.pixels()};
}

glm::mat4 viewProjection(const glm::vec3& eye, const glm::vec3& direction) {
  glm::mat4 projection = glm::perspectiveRH_ZO(
      glm::radians(50.0f), static_cast<float>(width) / static_cast<float>(height), 0.1f, 1000.0f);
  projection[1][1] *= -1;  // Vulkan's y goes down
  return projection * glm::lookAtRH(eye, eye + direction, glm::vec3(0, 1, 0));
}

}  // namespace crowd
