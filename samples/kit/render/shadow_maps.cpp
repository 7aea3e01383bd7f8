#include "kit/render/shadow_maps.h"

#include <array>
#include <utility>

namespace dermis::samples::render {
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
