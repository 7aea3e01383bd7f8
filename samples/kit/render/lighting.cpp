#include "kit/render/lighting.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <glm/ext/matrix_clip_space.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

namespace dermis::samples::render {
namespace {

/// An orthographic view along a light, around all casters.
struct LightView {
  glm::mat4 matrix{1.0f};
  float widest = 0;  ///< longest side of the map, in world units
  float depth = 0;   ///< from its nearest to its farthest point, in world units
};

LightView lightView(const Box& casters, const glm::vec3& towardsLight) {
  const glm::vec3 up = std::abs(towardsLight.y) > 0.95f ? glm::vec3(0, 0, 1) : glm::vec3(0, 1, 0);
  const glm::vec3 center = centerOf(casters);
  const glm::mat4 view = glm::lookAtRH(center + towardsLight, center, up);
  glm::vec3 low(std::numeric_limits<float>::max()), high(std::numeric_limits<float>::lowest());
  for (int corner = 0; corner < 8; ++corner) {
    const glm::vec4 point((corner & 1) != 0 ? casters.max[0] : casters.min[0],
                          (corner & 2) != 0 ? casters.max[1] : casters.min[1],
                          (corner & 4) != 0 ? casters.max[2] : casters.min[2], 1);
    low = glm::min(low, glm::vec3(view * point));
    high = glm::max(high, glm::vec3(view * point));
  }
  // Filters read a little beyond what is drawn.
  const float margin = 0.03f * radiusOf(casters);
  low -= margin;
  high += margin;
  // A square, so that a penumbra is round.
  const float half = std::max(high.x - low.x, high.y - low.y) * 0.5f;
  const glm::vec2 middle = (glm::vec2(low) + glm::vec2(high)) * 0.5f;
  LightView light;
  light.matrix = glm::orthoRH_ZO(middle.x - half, middle.x + half, middle.y - half, middle.y + half,
                                 -high.z, -low.z) *
                 view;
  light.widest = 2 * half;
  light.depth = high.z - low.z;
  return light;
}

/// Directions distributed evenly over the upper half of a sphere: a Fibonacci spiral (Swinbank and
/// Purser 2006, "Fibonacci grids").
glm::vec3 skyDirection(std::uint32_t index, std::uint32_t count) {
  const float height = (static_cast<float>(index) + 0.5f) / static_cast<float>(count);
  const float angle = static_cast<float>(index) * 2.39996323f + 0.7f;
  const float around = std::sqrt(1 - height * height);
  return {around * std::cos(angle), height, around * std::sin(angle)};
}

glm::vec3 fromAngles(float azimuth, float elevation) {
  const float a = glm::radians(azimuth), e = glm::radians(elevation);
  return {std::sin(a) * std::cos(e), std::sin(e), std::cos(a) * std::cos(e)};
}

void lightSky(const Box& casters, const ShadowSizes& sizes, ViewBlock& block) {
  float widest = 0;
  for (std::uint32_t index = 0; index < sizes.skyLights; ++index) {
    const glm::vec3 direction = skyDirection(index, sizes.skyLights);
    const LightView view = lightView(casters, direction);
    block.skyMatrices[index] = view.matrix;
    // A uniform sky gives an upward surface 1: the cosines sum to half their number.
    block.skyDirections[index] = glm::vec4(direction, 2 / static_cast<float>(sizes.skyLights));
    widest = std::max(widest, view.widest);
  }
  block.shadow.z = widest / static_cast<float>(sizes.skyMap);
  block.sky =
      glm::vec4(static_cast<float>(sizes.skyLights), 1 / static_cast<float>(sizes.skyMap), 0, 0);
}

}  // namespace

void light(const LightingStyle& style, const Camera& camera, const Box& casters, float groundHeight,
           float groundRadius, const ShadowSizes& sizes, ViewBlock& block) {
  const float cameraAzimuth = glm::degrees(std::atan2(camera.towardsEye.x, camera.towardsEye.z));
  const glm::vec3 key = fromAngles(cameraAzimuth + style.keyAzimuth, style.keyElevation);
  const glm::vec3 rim = fromAngles(cameraAzimuth + style.keyAzimuth + 180, 35);
  const LightView keyView = lightView(casters, key);
  block.viewProjection = camera.viewProjection;
  block.keyMatrix = keyView.matrix;
  block.shadow.x = keyView.widest / static_cast<float>(sizes.keyMap);
  block.shadow.y = keyView.depth;
  block.shadow.w = 1 / static_cast<float>(sizes.keyMap);
  lightSky(casters, sizes, block);
  const float height = casters.max[1] - casters.min[1];
  block.sky.w = 0.03f * height * block.sky.y / block.shadow.z;
  // About the radius of the penumbra at the top of a figure's shadow, or a little less.
  block.sky.z = 0.6f * height * style.keySize / key.y;

  block.eye = camera.isOrthographic ? glm::vec4(camera.towardsEye, 0) : glm::vec4(camera.eye, 1);
  block.keyDirection = glm::vec4(key, style.keySize);
  block.keyColor = glm::vec4(style.keyColor, 0);
  block.skyColor = glm::vec4(style.skyColor, 0);
  block.bounceColor = glm::vec4(style.bounceColor, 0);
  block.rimDirection = glm::vec4(rim, style.rim);
  block.horizonColor = glm::vec4(style.horizonColor, 1);
  block.zenithColor = glm::vec4(style.zenithColor, 1);
  const glm::vec3 center = centerOf(casters);
  block.ground = glm::vec4(center.x, groundHeight, center.z, groundRadius);
  const float radius = radiusOf(casters);
  const bool isHazy = style.haze > 0 && !camera.isOrthographic;
  block.haze =
      glm::vec4(camera.distance - 0.5f * radius, 1 / (1.5f * radius), isHazy ? style.haze : 0, 0);
}

namespace {

Result<Image> makeMap(Device& device, std::uint32_t size, std::uint32_t layers) {
  ImageDescription description;
  description.format = shadowFormat;
  description.width = description.height = size;
  description.layers = layers;
  description.aspect = VK_IMAGE_ASPECT_DEPTH_BIT;
  description.usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_SAMPLED_BIT;
  return Image::create(device, description);
}

Result<Owned<VkFramebuffer>> makeFramebuffer(Device& device, VkRenderPass pass, VkImageView view,
                                             std::uint32_t size) {
  VkFramebufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO;
  info.renderPass = pass;
  info.attachmentCount = 1;
  info.pAttachments = &view;
  info.width = info.height = size;
  info.layers = 1;
  return DERMIS_MAKE(device, Framebuffer, info);
}

/// The previous picture reads the maps before this pass, and this picture reads them after it.
std::array<VkSubpassDependency, 2> shadowDependencies() {
  constexpr VkPipelineStageFlags depthTests =
      VK_PIPELINE_STAGE_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_LATE_FRAGMENT_TESTS_BIT;
  std::array<VkSubpassDependency, 2> dependencies{};
  dependencies[0].srcSubpass = VK_SUBPASS_EXTERNAL;
  dependencies[0].dstSubpass = 0;
  dependencies[0].srcStageMask = VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT | depthTests;
  dependencies[0].dstStageMask = depthTests;
  dependencies[0].srcAccessMask = VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
  dependencies[0].dstAccessMask =
      VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
  dependencies[1].srcSubpass = 0;
  dependencies[1].dstSubpass = VK_SUBPASS_EXTERNAL;
  dependencies[1].srcStageMask = depthTests;
  dependencies[1].dstStageMask = VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT;
  dependencies[1].srcAccessMask = VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT;
  dependencies[1].dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
  return dependencies;
}

}  // namespace

Result<Owned<VkRenderPass>> makeShadowPass(const Device& device) {
  VkAttachmentDescription map{};
  map.format = shadowFormat;
  map.samples = VK_SAMPLE_COUNT_1_BIT;
  map.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  map.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  map.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  map.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  map.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  map.finalLayout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL;
  const VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass{};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.pDepthStencilAttachment = &reference;
  const auto dependencies = shadowDependencies();
  VkRenderPassCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  info.attachmentCount = 1;
  info.pAttachments = &map;
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  info.dependencyCount = static_cast<std::uint32_t>(dependencies.size());
  info.pDependencies = dependencies.data();
  return DERMIS_MAKE(device, RenderPass, info);
}

Result<ShadowMaps> ShadowMaps::create(Device& device, VkRenderPass pass, const ShadowSizes& sizes) {
  ShadowMaps maps;
  maps.sizes_ = sizes;
  Result<Image> key = makeMap(device, sizes.keyMap, 0);
  if (!key) return key.error();
  maps.key_ = std::move(*key);
  Result<Image> sky = makeMap(device, sizes.skyMap, sizes.skyLights);
  if (!sky) return sky.error();
  maps.sky_ = std::move(*sky);
  Result<Owned<VkFramebuffer>> framebuffer =
      makeFramebuffer(device, pass, maps.key_.view(), sizes.keyMap);
  if (!framebuffer) return framebuffer.error();
  maps.keyFramebuffer_ = std::move(*framebuffer);
  for (std::uint32_t light = 0; light < sizes.skyLights; ++light) {
    Result<Owned<VkImageView>> layer = maps.sky_.layerView(device, light);
    if (!layer) return layer.error();
    maps.skyLayers_.push_back(std::move(*layer));
    framebuffer = makeFramebuffer(device, pass, maps.skyLayers_.back().get(), sizes.skyMap);
    if (!framebuffer) return framebuffer.error();
    maps.skyFramebuffers_.push_back(std::move(*framebuffer));
  }
  return maps;
}

}  // namespace dermis::samples::render
