#include "kit/render/pipelines.h"

#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/vulkan/drawing.h"
#include "dermis_render_shaders.h"
#include "kit/render/lighting.h"
#include "kit/render/target.h"

namespace dermis::samples::render {
namespace {

/// The IDs of the shaders' specialization constants, in order.
struct Specialization {
  std::int32_t blockerTaps = 0;
  std::int32_t penumbraTaps = 0;
  std::int32_t skyTaps = 0;
  VkBool32 normalsAreOctahedral = VK_FALSE;
  VkBool32 isFlat = VK_FALSE;
  std::int32_t alphaMode = 0;
};
constexpr std::uint32_t specializationCount = sizeof(Specialization) / 4;

bool isOctahedral(VertexFormat format) {
  return format == VertexFormat::octahedral16x2 || format == VertexFormat::octahedral8x2;
}

Result<void> checkFormats(const PipelineKey& key) {
  const bool positions = key.positions == VertexFormat::float32x3 ||
                         key.positions == VertexFormat::float32x4 ||
                         key.positions == VertexFormat::float16x4;
  const bool normals = key.normals == VertexFormat::none ||
                       vulkan::vertexInputFormat(key.normals) != VK_FORMAT_UNDEFINED;
  if (positions && normals) return {};
  return Error{ErrorCode::invalidArgument,
               std::string("the renderer cannot draw from ") +
                   std::string(formatName(positions ? key.normals : key.positions)) +
                   (positions ? " normals" : " positions")};
}

/// Vertex buffer bindings: 0 positions, 1 normals, 2 static data, 3 values.
struct VertexState {
  std::vector<VkVertexInputBindingDescription> bindings;
  std::vector<VkVertexInputAttributeDescription> attributes;
};

VertexState vertexState(const PipelineKey& key) {
  VertexState state;
  state.bindings = {{0, key.positionStride, VK_VERTEX_INPUT_RATE_VERTEX},
                    {2, sizeof(StaticVertex), VK_VERTEX_INPUT_RATE_VERTEX}};
  state.attributes = {
      {0, 0, vulkan::vertexInputFormat(key.positions), 0},
      {2, 2, VK_FORMAT_R32G32_SFLOAT, offsetof(StaticVertex, texcoord)},
      {3, 2, VK_FORMAT_R16G16B16A16_UNORM, offsetof(StaticVertex, color)},
  };
  if (key.step == Step::shadow) return state;
  // The shader declares every attribute, even if it does not need it. A missing attribute is
  // replaced by another one that exists.
  if (key.normals == VertexFormat::none) {
    state.attributes.push_back({1, 0, vulkan::vertexInputFormat(key.positions), 0});
  } else {
    state.bindings.push_back({1, key.normalStride, VK_VERTEX_INPUT_RATE_VERTEX});
    state.attributes.push_back({1, 1, vulkan::vertexInputFormat(key.normals), 0});
  }
  if (key.valueStride == 0) {
    state.attributes.push_back({4, 2, VK_FORMAT_R32_SFLOAT, 0});
  } else {
    state.bindings.push_back({3, key.valueStride, VK_VERTEX_INPUT_RATE_VERTEX});
    state.attributes.push_back({4, 3, VK_FORMAT_R32_SFLOAT, 0});
  }
  return state;
}

VkPipelineShaderStageCreateInfo stage(VkShaderStageFlagBits which, VkShaderModule module,
                                      const VkSpecializationInfo& specialization) {
  VkPipelineShaderStageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage = which;
  info.module = module;
  info.pName = "main";
  info.pSpecializationInfo = &specialization;
  return info;
}

VkPipelineRasterizationStateCreateInfo rasterization(const PipelineKey& key) {
  VkPipelineRasterizationStateCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO;
  info.polygonMode = VK_POLYGON_MODE_FILL;
  info.lineWidth = 1;
  info.frontFace = key.isMirrored ? VK_FRONT_FACE_CLOCKWISE : VK_FRONT_FACE_COUNTER_CLOCKWISE;
  if (key.step == Step::mesh && !key.isDoubleSided) info.cullMode = VK_CULL_MODE_BACK_BIT;
  if (key.step == Step::shadow) {
    info.depthBiasEnable = VK_TRUE;
    info.depthBiasConstantFactor = 2;
    info.depthBiasSlopeFactor = 2;
  }
  return info;
}

VkPipelineDepthStencilStateCreateInfo depthState(const PipelineKey& key) {
  VkPipelineDepthStencilStateCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO;
  info.depthTestEnable = VK_TRUE;
  info.depthWriteEnable = key.step == Step::background || (key.step == Step::mesh &&
                                                           key.transparency == Transparency::blend)
                              ? VK_FALSE
                              : VK_TRUE;
  info.depthCompareOp = VK_COMPARE_OP_LESS_OR_EQUAL;
  return info;
}

VkPipelineColorBlendAttachmentState blendState(const PipelineKey& key) {
  VkPipelineColorBlendAttachmentState state{};
  state.colorWriteMask = VK_COLOR_COMPONENT_R_BIT | VK_COLOR_COMPONENT_G_BIT |
                         VK_COLOR_COMPONENT_B_BIT | VK_COLOR_COMPONENT_A_BIT;
  if (key.step == Step::mesh && key.transparency == Transparency::blend) {
    state.blendEnable = VK_TRUE;
    state.srcColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
    state.dstColorBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
    state.colorBlendOp = VK_BLEND_OP_ADD;
    state.srcAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
    state.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
    state.alphaBlendOp = VK_BLEND_OP_ADD;
  }
  return state;
}

/// The specialization constants of both shaders. Not copyable: its members point to each other.
class SpecializedConstants {
 public:
  SpecializedConstants(const PipelineKey& key, const FilterTaps& taps)
      : numbers_{taps.blockers, taps.penumbra,
                 // The ground is large and uniform, so coarse filtering is most visible there.
                 key.step == Step::ground ? 2 * taps.sky : taps.sky,
                 isOctahedral(key.normals) ? VK_TRUE : VK_FALSE,
                 key.normals == VertexFormat::none ? VK_TRUE : VK_FALSE,
                 static_cast<std::int32_t>(key.transparency)} {
    for (std::uint32_t index = 0; index < specializationCount; ++index)
      entries_[index] = {index, index * 4, 4};
    info_ = {specializationCount, entries_.data(), sizeof(numbers_), &numbers_};
  }
  SpecializedConstants(const SpecializedConstants&) = delete;
  SpecializedConstants& operator=(const SpecializedConstants&) = delete;

  const VkSpecializationInfo& info() const { return info_; }

 private:
  Specialization numbers_;
  std::array<VkSpecializationMapEntry, specializationCount> entries_{};
  VkSpecializationInfo info_{};
};

/// All state of a pipeline except its shaders. Not copyable, for the same reason.
class FixedState {
 public:
  FixedState(const PipelineKey& key, const VertexState& vertices)
      : raster_(rasterization(key)), depth_(depthState(key)), attachment_(blendState(key)) {
    const bool colors = key.step != Step::shadow;
    vertexInput_.sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO;
    vertexInput_.vertexBindingDescriptionCount =
        static_cast<std::uint32_t>(vertices.bindings.size());
    vertexInput_.pVertexBindingDescriptions = vertices.bindings.data();
    vertexInput_.vertexAttributeDescriptionCount =
        static_cast<std::uint32_t>(vertices.attributes.size());
    vertexInput_.pVertexAttributeDescriptions = vertices.attributes.data();
    assembly_.sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO;
    assembly_.topology = key.step == Step::ground ? VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP
                                                  : VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
    viewport_.sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO;
    viewport_.viewportCount = viewport_.scissorCount = 1;
    multisample_.sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO;
    multisample_.rasterizationSamples = colors ? sampleCount : VK_SAMPLE_COUNT_1_BIT;
    multisample_.alphaToCoverageEnable =
        key.step == Step::mesh && key.transparency == Transparency::mask ? VK_TRUE : VK_FALSE;
    blend_.sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO;
    blend_.attachmentCount = colors ? 1 : 0;
    blend_.pAttachments = &attachment_;
    dynamic_.sType = VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO;
    dynamic_.dynamicStateCount = static_cast<std::uint32_t>(dynamicStates_.size());
    dynamic_.pDynamicStates = dynamicStates_.data();
  }
  FixedState(const FixedState&) = delete;
  FixedState& operator=(const FixedState&) = delete;

  void addTo(VkGraphicsPipelineCreateInfo& info) const {
    info.pVertexInputState = &vertexInput_;
    info.pInputAssemblyState = &assembly_;
    info.pViewportState = &viewport_;
    info.pRasterizationState = &raster_;
    info.pMultisampleState = &multisample_;
    info.pDepthStencilState = &depth_;
    info.pColorBlendState = &blend_;
    info.pDynamicState = &dynamic_;
  }

 private:
  VkPipelineVertexInputStateCreateInfo vertexInput_{};
  VkPipelineInputAssemblyStateCreateInfo assembly_{};
  VkPipelineViewportStateCreateInfo viewport_{};
  VkPipelineRasterizationStateCreateInfo raster_;
  VkPipelineMultisampleStateCreateInfo multisample_{};
  VkPipelineDepthStencilStateCreateInfo depth_;
  VkPipelineColorBlendAttachmentState attachment_;
  VkPipelineColorBlendStateCreateInfo blend_{};
  const std::array<VkDynamicState, 2> dynamicStates_{VK_DYNAMIC_STATE_VIEWPORT,
                                                     VK_DYNAMIC_STATE_SCISSOR};
  VkPipelineDynamicStateCreateInfo dynamic_{};
};

VkDescriptorSetLayoutBinding binding(std::uint32_t number, VkDescriptorType type,
                                     VkShaderStageFlags stages) {
  return {number, type, 1, stages, nullptr};
}

Result<Owned<VkDescriptorSetLayout>> makeSetLayout(
    const Device& device, std::span<const VkDescriptorSetLayoutBinding> bindings) {
  VkDescriptorSetLayoutCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  info.bindingCount = static_cast<std::uint32_t>(bindings.size());
  info.pBindings = bindings.data();
  return DERMIS_MAKE(device, DescriptorSetLayout, info);
}

}  // namespace

Result<Pipelines> Pipelines::create(const Device& device, VkRenderPass shadowPass,
                                    VkRenderPass picturePass, const FilterTaps& taps) {
  Pipelines pipelines;
  pipelines.shadowPass_ = shadowPass;
  pipelines.picturePass_ = picturePass;
  pipelines.taps_ = taps;
  if (Result<void> made = pipelines.makeLayouts(device); !made) return made.error();
  if (Result<void> loaded = pipelines.loadShaders(device); !loaded) return loaded.error();
  return pipelines;
}

Result<void> Pipelines::makeLayouts(const Device& device) {
  constexpr VkShaderStageFlags both = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;
  constexpr VkDescriptorType image = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
  const std::array viewBindings{binding(0, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, both),
                                binding(1, image, VK_SHADER_STAGE_FRAGMENT_BIT),
                                binding(2, image, VK_SHADER_STAGE_FRAGMENT_BIT),
                                binding(3, image, VK_SHADER_STAGE_FRAGMENT_BIT)};
  Result<Owned<VkDescriptorSetLayout>> view = makeSetLayout(device, viewBindings);
  if (!view) return view.error();
  viewLayout_ = std::move(*view);
  const std::array textureBindings{binding(0, image, VK_SHADER_STAGE_FRAGMENT_BIT)};
  Result<Owned<VkDescriptorSetLayout>> texture = makeSetLayout(device, textureBindings);
  if (!texture) return texture.error();
  textureLayout_ = std::move(*texture);

  const std::array sets{viewLayout_.get(), textureLayout_.get()};
  const VkPushConstantRange range{both, 0, sizeof(DrawBlock)};
  VkPipelineLayoutCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  info.setLayoutCount = static_cast<std::uint32_t>(sets.size());
  info.pSetLayouts = sets.data();
  info.pushConstantRangeCount = 1;
  info.pPushConstantRanges = &range;
  Result<Owned<VkPipelineLayout>> layout = DERMIS_MAKE(device, PipelineLayout, info);
  if (!layout) return layout.error();
  layout_ = std::move(*layout);
  return {};
}

Result<void> Pipelines::loadShaders(const Device& device) {
  const std::array<std::pair<Owned<VkShaderModule>*, std::span<const std::uint32_t>>, 8> shaders{{
      {&shadowVertex_, shaders::shadow_vert_spirv},
      {&shadowFragment_, shaders::shadow_mask_frag_spirv},
      {&meshVertex_, shaders::mesh_vert_spirv},
      {&meshFragment_, shaders::mesh_frag_spirv},
      {&backgroundVertex_, shaders::background_vert_spirv},
      {&backgroundFragment_, shaders::background_frag_spirv},
      {&groundVertex_, shaders::ground_vert_spirv},
      {&groundFragment_, shaders::ground_frag_spirv},
  }};
  for (const auto& [module, words] : shaders) {
    VkShaderModuleCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
    info.codeSize = words.size_bytes();
    info.pCode = words.data();
    Result<Owned<VkShaderModule>> made = DERMIS_MAKE(device, ShaderModule, info);
    if (!made) return made.error();
    *module = std::move(*made);
  }
  return {};
}

Result<VkPipeline> Pipelines::get(const Device& device, const PipelineKey& key) {
  const auto found = pipelines_.find(key);
  if (found != pipelines_.end()) return found->second.get();
  Result<Owned<VkPipeline>> built = build(device, key);
  if (!built) return built.error();
  return pipelines_.emplace(key, std::move(*built)).first->second.get();
}

Result<Owned<VkPipeline>> Pipelines::build(const Device& device, const PipelineKey& key) const {
  const bool drawsMesh = key.step == Step::mesh || key.step == Step::shadow;
  if (drawsMesh) {
    if (Result<void> checked = checkFormats(key); !checked) return checked.error();
  }
  const SpecializedConstants constants(key, taps_);
  const std::array<std::pair<VkShaderModule, VkShaderModule>, 4> modules{{
      {shadowVertex_.get(), shadowFragment_.get()},
      {backgroundVertex_.get(), backgroundFragment_.get()},
      {groundVertex_.get(), groundFragment_.get()},
      {meshVertex_.get(), meshFragment_.get()},
  }};
  const auto& [vertex, fragment] = modules[static_cast<std::size_t>(key.step)];
  const std::array stages{stage(VK_SHADER_STAGE_VERTEX_BIT, vertex, constants.info()),
                          stage(VK_SHADER_STAGE_FRAGMENT_BIT, fragment, constants.info())};
  // Shadows of opaque surfaces need no fragment shader.
  const bool colors = key.step != Step::shadow;
  const bool hasFragmentShader = colors || key.transparency != Transparency::opaque;
  const VertexState vertices = drawsMesh ? vertexState(key) : VertexState();
  const FixedState fixed(key, vertices);

  VkGraphicsPipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO;
  info.stageCount = hasFragmentShader ? 2 : 1;
  info.pStages = stages.data();
  fixed.addTo(info);
  info.layout = layout_.get();
  info.renderPass = colors ? picturePass_ : shadowPass_;
  VkPipeline pipeline = VK_NULL_HANDLE;
  if (const VkResult result = device.functions().CreateGraphicsPipelines(
          device.handle(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline);
      result != VK_SUCCESS) {
    return Error{ErrorCode::vulkanError, "vkCreateGraphicsPipelines failed",
                 static_cast<std::int32_t>(result)};
  }
  return Owned<VkPipeline>(device.handle(), pipeline, device.functions().DestroyPipeline);
}

}  // namespace dermis::samples::render
