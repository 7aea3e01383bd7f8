// An engine's own vertex shader decodes by dermis_decode.glsl: what it found out about each vertex
// is drawn into a pixel, and read back.

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "dermis/vulkan/context.h"
#include "dermis_test_shaders.h"
#include "kit/batch_runner.h"
#include "kit/buffer.h"
#include "kit/render/owned.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

using samples::MappedBuffer;
using samples::render::Owned;

template <typename T>
T must(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}
void must(const Result<void>& result) {
  if (!result) throw std::runtime_error(result.error().message);
}
void must(VkResult result) {
  if (result != VK_SUCCESS) throw std::runtime_error("Vulkan: " + std::to_string(result));
}

constexpr std::uint32_t width = 64, height = 32;  // pixels: the most vertices
constexpr std::size_t valueCount = 3;
constexpr VkFormat valueFormat = VK_FORMAT_R32G32B32A32_SFLOAT;
constexpr std::uint32_t valueBytes = 16;

/// As values.glsl has them.
struct Push {
  std::uint32_t pictureWidth = width, pictureHeight = height;
  std::uint32_t padding[2] = {};
  float boxMin[4] = {}, boxMax[4] = {};
};
static_assert(sizeof(Push) == 48);

/// Four floats a vertex: positions, normals, tangents.
using Values = std::array<std::vector<float>, valueCount>;

/// Draws a point for each vertex into three images.
class ValueDrawer {
 public:
  explicit ValueDrawer(samples::Device& device) : device_(device) {
    for (std::size_t index = 0; index < valueCount; ++index) makeImage(index);
    makePass();
    makeLayout();
  }

  struct Inputs {
    const MappedBuffer* vertices = nullptr;
    std::span<const VkVertexInputAttributeDescription> attributes;
    std::uint32_t stride = 0;
    Push push;
  };
  Values draw(const Inputs& inputs, std::uint32_t vertexCount) {
    if (vertexCount > width * height) throw std::runtime_error("too many vertices");
    const Owned<VkPipeline> pipeline = makePipeline(inputs);
    const samples::VulkanFunctions& functions = device_.functions();
    MappedBuffer read =
        must(MappedBuffer::create(device_, std::uint64_t{valueCount} * width * height * valueBytes,
                                  VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
    const VkCommandBuffer commands = device_.allocateCommandBuffer();
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    must(functions.BeginCommandBuffer(commands, &begin));
    const std::array<VkClearValue, valueCount> clear{};
    VkRenderPassBeginInfo pass{};
    pass.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
    pass.renderPass = pass_.get();
    pass.framebuffer = framebuffer_.get();
    pass.renderArea.extent = {width, height};
    pass.clearValueCount = valueCount;
    pass.pClearValues = clear.data();
    functions.CmdBeginRenderPass(commands, &pass, VK_SUBPASS_CONTENTS_INLINE);
    functions.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.get());
    const VkBuffer buffer = inputs.vertices->handle();
    const VkDeviceSize offset = 0;
    functions.CmdBindVertexBuffers(commands, 0, 1, &buffer, &offset);
    functions.CmdPushConstants(commands, pipelineLayout_.get(), VK_SHADER_STAGE_VERTEX_BIT, 0,
                               sizeof(Push), &inputs.push);
    functions.CmdDraw(commands, vertexCount, 1, 0, 0);
    functions.CmdEndRenderPass(commands);
    for (std::size_t index = 0; index < valueCount; ++index) {
      VkBufferImageCopy region{};
      region.bufferOffset = index * width * height * valueBytes;
      region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
      region.imageExtent = {width, height, 1};
      functions.CmdCopyImageToBuffer(commands, images_[index].image.get(),
                                     VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, read.handle(), 1,
                                     &region);
    }
    recordBarrier(device_, commands, Use::copyWrite, Use::hostRead);
    must(functions.EndCommandBuffer(commands));
    must(device_.submitAndWait(commands));
    device_.freeCommandBuffer(commands);
    Values values;
    for (std::size_t index = 0; index < valueCount; ++index) {
      values[index].resize(std::size_t{vertexCount} * 4);
      std::memcpy(values[index].data(), read.bytes().data() + index * width * height * valueBytes,
                  values[index].size() * sizeof(float));
    }
    return values;
  }

 private:
  struct Image {
    Owned<VkImage> image;
    Owned<VkDeviceMemory> memory;
    Owned<VkImageView> view;
  };

  void makeImage(std::size_t index) {
    const samples::VulkanFunctions& functions = device_.functions();
    VkImageCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
    info.imageType = VK_IMAGE_TYPE_2D;
    info.format = valueFormat;
    info.extent = {width, height, 1};
    info.mipLevels = info.arrayLayers = 1;
    info.samples = VK_SAMPLE_COUNT_1_BIT;
    info.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
    Image& made = images_[index];
    made.image = must(DERMIS_MAKE(device_, Image, info));
    VkMemoryRequirements needs{};
    functions.GetImageMemoryRequirements(device_.handle(), made.image.get(), &needs);
    VkMemoryAllocateInfo allocate{};
    allocate.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
    allocate.allocationSize = needs.size;
    allocate.memoryTypeIndex = must(device_.memoryType(needs.memoryTypeBits, 0, 0));
    VkDeviceMemory memory = VK_NULL_HANDLE;
    must(functions.AllocateMemory(device_.handle(), &allocate, nullptr, &memory));
    made.memory = Owned<VkDeviceMemory>(device_.handle(), memory, functions.FreeMemory);
    must(functions.BindImageMemory(device_.handle(), made.image.get(), memory, 0));
    VkImageViewCreateInfo view{};
    view.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
    view.image = made.image.get();
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = valueFormat;
    view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    made.view = must(DERMIS_MAKE(device_, ImageView, view));
  }

  void makePass() {
    std::array<VkAttachmentDescription, valueCount> attachments{};
    std::array<VkAttachmentReference, valueCount> references{};
    std::array<VkImageView, valueCount> views{};
    for (std::uint32_t index = 0; index < valueCount; ++index) {
      attachments[index].format = valueFormat;
      attachments[index].samples = VK_SAMPLE_COUNT_1_BIT;
      attachments[index].loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
      attachments[index].storeOp = VK_ATTACHMENT_STORE_OP_STORE;
      attachments[index].stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
      attachments[index].stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
      attachments[index].finalLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
      references[index] = {index, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
      views[index] = images_[index].view.get();
    }
    VkSubpassDescription subpass{};
    subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
    subpass.colorAttachmentCount = valueCount;
    subpass.pColorAttachments = references.data();
    std::array<VkSubpassDependency, 2> dependencies{};
    dependencies[0].srcSubpass = dependencies[1].dstSubpass = VK_SUBPASS_EXTERNAL;
    dependencies[0].srcStageMask = VK_PIPELINE_STAGE_TRANSFER_BIT;
    dependencies[0].srcAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
    dependencies[0].dstStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
    dependencies[0].dstAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
    dependencies[1].srcStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
    dependencies[1].srcAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
    dependencies[1].dstStageMask = VK_PIPELINE_STAGE_TRANSFER_BIT;
    dependencies[1].dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
    VkRenderPassCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
    info.attachmentCount = valueCount;
    info.pAttachments = attachments.data();
    info.subpassCount = 1;
    info.pSubpasses = &subpass;
    info.dependencyCount = 2;
    info.pDependencies = dependencies.data();
    pass_ = must(DERMIS_MAKE(device_, RenderPass, info));
    VkFramebufferCreateInfo framebuffer{};
    framebuffer.sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO;
    framebuffer.renderPass = pass_.get();
    framebuffer.attachmentCount = valueCount;
    framebuffer.pAttachments = views.data();
    framebuffer.width = width;
    framebuffer.height = height;
    framebuffer.layers = 1;
    framebuffer_ = must(DERMIS_MAKE(device_, Framebuffer, framebuffer));
  }

  void makeLayout() {
    const VkPushConstantRange range{VK_SHADER_STAGE_VERTEX_BIT, 0, sizeof(Push)};
    VkPipelineLayoutCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    info.pushConstantRangeCount = 1;
    info.pPushConstantRanges = &range;
    pipelineLayout_ = must(DERMIS_MAKE(device_, PipelineLayout, info));
  }

  Owned<VkPipeline> makePipeline(const Inputs& inputs) {
    const samples::VulkanFunctions& functions = device_.functions();
    std::array<Owned<VkShaderModule>, 2> modules;
    std::array<VkPipelineShaderStageCreateInfo, 2> stages{};
    for (std::size_t index = 0; index < 2; ++index) {
      const std::span<const std::uint32_t> spirv =
          index == 0 ? shaders::decode_vert_spirv : shaders::values_frag_spirv;
      VkShaderModuleCreateInfo info{};
      info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
      info.codeSize = spirv.size_bytes();
      info.pCode = spirv.data();
      modules[index] = must(DERMIS_MAKE(device_, ShaderModule, info));
      stages[index].sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
      stages[index].stage = index == 0 ? VK_SHADER_STAGE_VERTEX_BIT : VK_SHADER_STAGE_FRAGMENT_BIT;
      stages[index].module = modules[index].get();
      stages[index].pName = "main";
    }
    const VkVertexInputBindingDescription binding{0, inputs.stride, VK_VERTEX_INPUT_RATE_VERTEX};
    VkPipelineVertexInputStateCreateInfo vertexInput{};
    vertexInput.sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO;
    vertexInput.vertexBindingDescriptionCount = 1;
    vertexInput.pVertexBindingDescriptions = &binding;
    vertexInput.vertexAttributeDescriptionCount =
        static_cast<std::uint32_t>(inputs.attributes.size());
    vertexInput.pVertexAttributeDescriptions = inputs.attributes.data();
    VkPipelineInputAssemblyStateCreateInfo assembly{};
    assembly.sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO;
    assembly.topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST;
    const VkViewport area{0, 0, width, height, 0, 1};
    const VkRect2D scissor{{0, 0}, {width, height}};
    VkPipelineViewportStateCreateInfo viewport{};
    viewport.sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO;
    viewport.viewportCount = viewport.scissorCount = 1;
    viewport.pViewports = &area;
    viewport.pScissors = &scissor;
    VkPipelineRasterizationStateCreateInfo rasterization{};
    rasterization.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO;
    rasterization.lineWidth = 1;
    VkPipelineMultisampleStateCreateInfo multisample{};
    multisample.sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO;
    multisample.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
    std::array<VkPipelineColorBlendAttachmentState, valueCount> blends{};
    for (VkPipelineColorBlendAttachmentState& blend : blends) blend.colorWriteMask = 0xf;
    VkPipelineColorBlendStateCreateInfo blending{};
    blending.sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO;
    blending.attachmentCount = valueCount;
    blending.pAttachments = blends.data();
    VkGraphicsPipelineCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO;
    info.stageCount = 2;
    info.pStages = stages.data();
    info.pVertexInputState = &vertexInput;
    info.pInputAssemblyState = &assembly;
    info.pViewportState = &viewport;
    info.pRasterizationState = &rasterization;
    info.pMultisampleState = &multisample;
    info.pColorBlendState = &blending;
    info.layout = pipelineLayout_.get();
    info.renderPass = pass_.get();
    VkPipeline pipeline = VK_NULL_HANDLE;
    must(functions.CreateGraphicsPipelines(device_.handle(), VK_NULL_HANDLE, 1, &info, nullptr,
                                           &pipeline));
    return {device_.handle(), pipeline, functions.DestroyPipeline};
  }

  samples::Device& device_;
  std::array<Image, valueCount> images_;
  Owned<VkRenderPass> pass_;
  Owned<VkFramebuffer> framebuffer_;
  Owned<VkPipelineLayout> pipelineLayout_;
};

class DecodeTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string reason;
    if (testDevice(true, reason) == nullptr) {
      if (isContinuousIntegration()) FAIL() << reason;
      GTEST_SKIP() << reason;
    }
    samples::DeviceOptions options = testDeviceOptions();
    options.graphics = true;
    open_.emplace(must(samples::openDevice(options)));
  }
  void TearDown() override {
    if (!open_) return;
    for (const std::string& message : open_->device->takeValidationMessages())
      ADD_FAILURE() << message;
  }
  samples::Device& device() { return *open_->device; }
  vulkan::Context& context() { return open_->context; }

  std::optional<samples::OpenDevice> open_;
};

TEST_F(DecodeTest, AVertexShaderDecodesWhatTheKernelsStore) {
  constexpr std::uint32_t vertexCount = 2000, jointCount = 8;
  OwnedMesh mesh = randomMesh(21, vertexCount, jointCount, 4);
  addTangents(mesh, 22);
  const PackedMesh packed = must(pack(mesh.view(), jointCount));
  const std::vector<JointMatrix> pose = randomPose(23, jointCount, Rigidity::rigid);
  samples::SkinRequest request{&packed, pose, JointPromise::scaling, Method::dualQuaternion, {}};
  request.box = {{-30, -20, -25}, {30, 40, 35}};
  samples::RunOptions options;
  options.output.positions = VertexFormat::snorm16x4;
  options.output.normals = VertexFormat::octahedral8x2;
  options.output.tangents = VertexFormat::octahedral8x2;
  const samples::BatchResult result =
      must(samples::runBatch(device(), context(), {&request, 1}, options));
  const samples::SkinnedVertices& skinned = result.instances[0];

  constexpr std::uint32_t stride = 12;
  const MappedBuffer vertices = must(MappedBuffer::create(
      device(), std::uint64_t{vertexCount} * stride, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT));
  for (std::size_t vertex = 0; vertex < vertexCount; ++vertex) {
    std::byte* place = vertices.bytes().data() + vertex * stride;
    std::memcpy(place, skinned.streams[0].data() + vertex * 8, 8);
    std::memcpy(place + 8, skinned.streams[1].data() + vertex * 2, 2);
    std::memcpy(place + 10, skinned.streams[2].data() + vertex * 2, 2);
  }
  const std::array<VkVertexInputAttributeDescription, 3> attributes{
      {{0, 0, VK_FORMAT_R16G16B16A16_SNORM, 0},
       {1, 0, VK_FORMAT_R8G8_SNORM, 8},
       {2, 0, VK_FORMAT_R8G8_SNORM, 10}}};
  ValueDrawer::Inputs inputs;
  inputs.vertices = &vertices;
  inputs.attributes = attributes;
  inputs.stride = stride;
  std::copy_n(request.box.min, 3, inputs.push.boxMin);
  std::copy_n(request.box.max, 3, inputs.push.boxMax);
  ValueDrawer drawer(device());
  const Values values = drawer.draw(inputs, vertexCount);
  for (std::size_t vertex = 0; vertex < vertexCount; ++vertex) {
    SCOPED_TRACE(vertex);
    const std::array<double, 3> position = decodePosition(
        VertexFormat::snorm16x4, skinned.streams[0].data() + vertex * 8, request.box);
    const std::array<double, 3> normal =
        decodeNormal(VertexFormat::octahedral8x2, skinned.streams[1].data() + vertex * 2);
    const std::array<double, 4> tangent =
        decodeTangent(VertexFormat::octahedral8x2, skinned.streams[2].data() + vertex * 2);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ASSERT_NEAR(static_cast<double>(values[0][vertex * 4 + axis]), position[axis], 1e-4);
      ASSERT_NEAR(static_cast<double>(values[1][vertex * 4 + axis]), normal[axis], 1e-6);
      ASSERT_NEAR(static_cast<double>(values[2][vertex * 4 + axis]), tangent[axis], 1e-6);
    }
    ASSERT_EQ(static_cast<double>(values[2][vertex * 4 + 3]), tangent[3]);
  }
}

}  // namespace
}  // namespace dermis::test
