#include "kit/render/renderer.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <utility>

#include "kit/render/lighting.h"

namespace dermis::samples::render {
namespace {

constexpr VkShaderStageFlags bothStages = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;

Result<Owned<VkDescriptorPool>> makePool(const Device& device, std::uint32_t sets,
                                         std::span<const VkDescriptorPoolSize> sizes) {
  VkDescriptorPoolCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  info.maxSets = sets;
  info.poolSizeCount = static_cast<std::uint32_t>(sizes.size());
  info.pPoolSizes = sizes.data();
  return DERMIS_MAKE(device, DescriptorPool, info);
}

Result<VkDescriptorSet> allocateSet(const Device& device, VkDescriptorPool pool,
                                    VkDescriptorSetLayout layout) {
  VkDescriptorSetAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  info.descriptorPool = pool;
  info.descriptorSetCount = 1;
  info.pSetLayouts = &layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  if (const VkResult result =
          device.functions().AllocateDescriptorSets(device.handle(), &info, &set);
      result != VK_SUCCESS) {
    return Error{ErrorCode::vulkanError, "vkAllocateDescriptorSets failed",
                 static_cast<std::int32_t>(result)};
  }
  return set;
}

VkWriteDescriptorSet imageWrite(VkDescriptorSet set, std::uint32_t binding,
                                const VkDescriptorImageInfo& info) {
  VkWriteDescriptorSet write{};
  write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
  write.dstSet = set;
  write.dstBinding = binding;
  write.descriptorCount = 1;
  write.descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
  write.pImageInfo = &info;
  return write;
}

PipelineKey keyOf(const Draw& draw, Step step) {
  PipelineKey key;
  key.step = step;
  key.positions = draw.positions.format;
  key.positionStride = draw.positions.stride;
  key.transparency = draw.surface.transparency;
  if (step == Step::shadow) {
    // Transparent surfaces cast the shadow of their parts that are at least half opaque.
    if (key.transparency == Transparency::blend) key.transparency = Transparency::mask;
    return key;
  }
  key.normals = draw.normals.format;
  if (key.normals != VertexFormat::none) key.normalStride = draw.normals.stride;
  if (draw.values.buffer != VK_NULL_HANDLE) key.valueStride = draw.values.stride;
  key.isDoubleSided = draw.surface.isDoubleSided;
  key.isMirrored = draw.isMirrored;
  return key;
}

DrawBlock blockOf(const Draw& draw, int shadowIndex) {
  DrawBlock block;
  std::memcpy(block.rows, draw.transform.m, sizeof(block.rows));
  const Surface& surface = draw.surface;
  block.baseColor = {surface.baseColor[0], surface.baseColor[1], surface.baseColor[2],
                     surface.baseColor[3]};
  const float cutoff = surface.transparency == Transparency::blend ? 0.5f : surface.alphaCutoff;
  block.surface = {surface.metallic, surface.roughness, cutoff,
                   draw.values.buffer != VK_NULL_HANDLE ? 1.0f : 0.0f};
  block.shadowIndex = shadowIndex;
  return block;
}

void setArea(const VulkanFunctions& functions, VkCommandBuffer commandBuffer,
             const VkRect2D& area) {
  const VkViewport viewport{static_cast<float>(area.offset.x),
                            static_cast<float>(area.offset.y),
                            static_cast<float>(area.extent.width),
                            static_cast<float>(area.extent.height),
                            0,
                            1};
  functions.CmdSetViewport(commandBuffer, 0, 1, &viewport);
  functions.CmdSetScissor(commandBuffer, 0, 1, &area);
}

void bindVertices(const VulkanFunctions& functions, VkCommandBuffer commandBuffer,
                  const Draw& draw) {
  // A binding that a draw lacks is not used by its pipeline either.
  const auto orPositions = [&](const VertexStream& stream) {
    return stream.buffer != VK_NULL_HANDLE ? stream : draw.positions;
  };
  const VertexStream normals = orPositions(draw.normals);
  const VertexStream values = orPositions(draw.values);
  const std::array buffers{draw.positions.buffer, normals.buffer, draw.geometry->vertices(),
                           values.buffer};
  const std::array<VkDeviceSize, 4> offsets{draw.positions.offset, normals.offset, 0,
                                            values.offset};
  functions.CmdBindVertexBuffers(commandBuffer, 0, static_cast<std::uint32_t>(buffers.size()),
                                 buffers.data(), offsets.data());
}

/// Opaque draws first, then blended ones in the given order.
std::vector<const Draw*> inOrder(std::span<const Draw> draws) {
  std::vector<const Draw*> ordered;
  for (const Draw& draw : draws) {
    if (draw.geometry != nullptr && draw.geometry->indexCount() != 0) ordered.push_back(&draw);
  }
  // Not std::ranges: Clang 14 and libstdc++ disagree about the return type.
  std::stable_partition(ordered.begin(), ordered.end(), [](const Draw* draw) {
    return draw->surface.transparency != Transparency::blend;
  });
  return ordered;
}

}  // namespace

Result<Renderer> Renderer::create(Device& device, const FilterTaps& taps) {
  Renderer renderer;
  renderer.device_ = &device;
  renderer.depthFormat_ = chooseDepthFormat(device);
  Result<Owned<VkRenderPass>> shadowPass = makeShadowPass(device);
  if (!shadowPass) return shadowPass.error();
  renderer.shadowPass_ = std::move(*shadowPass);
  Result<Owned<VkRenderPass>> picturePass = makePicturePass(device, renderer.depthFormat_);
  if (!picturePass) return picturePass.error();
  renderer.picturePass_ = std::move(*picturePass);
  Result<Pipelines> pipelines =
      Pipelines::create(device, renderer.shadowPass_.get(), renderer.picturePass_.get(), taps);
  if (!pipelines) return pipelines.error();
  renderer.pipelines_ = std::move(*pipelines);
  if (Result<void> made = renderer.makeSamplers(); !made) return made.error();
  const TexturePixels white{1, 1, {255, 255, 255, 255}};
  const Result<std::uint32_t> first = renderer.addTexture(white, {});
  if (!first) return first.error();
  return renderer;
}

Result<void> Renderer::makeSamplers() {
  VkFormatProperties properties{};
  device_->functions().GetPhysicalDeviceFormatProperties(device_->physicalDevice(), shadowFormat,
                                                         &properties);
  const bool linear =
      (properties.optimalTilingFeatures & VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT) != 0;
  VkSamplerCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  info.addressModeU = info.addressModeV = info.addressModeW =
      VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER;
  // Outside the map, nothing blocks the light.
  info.borderColor = VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE;
  Result<Owned<VkSampler>> depth = DERMIS_MAKE(*device_, Sampler, info);
  if (!depth) return depth.error();
  depthSampler_ = std::move(*depth);
  info.compareEnable = VK_TRUE;
  info.compareOp = VK_COMPARE_OP_LESS_OR_EQUAL;
  info.magFilter = info.minFilter = linear ? VK_FILTER_LINEAR : VK_FILTER_NEAREST;
  Result<Owned<VkSampler>> compare = DERMIS_MAKE(*device_, Sampler, info);
  if (!compare) return compare.error();
  compareSampler_ = std::move(*compare);
  return {};
}

Result<std::uint32_t> Renderer::addTexture(const TexturePixels& pixels,
                                           const TextureOptions& options) {
  Result<Texture> texture = Texture::create(*device_, pixels, options);
  if (!texture) return texture.error();
  return addTexture(std::move(*texture));
}

Result<std::uint32_t> Renderer::addTexture(std::uint32_t pixelsOf, const TextureOptions& options) {
  Result<Texture> texture = Texture::create(*device_, textures_[pixelsOf].texture, options);
  if (!texture) return texture.error();
  return addTexture(std::move(*texture));
}

Result<std::uint32_t> Renderer::addTexture(Texture texture) {
  const std::array sizes{VkDescriptorPoolSize{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 1}};
  Result<Owned<VkDescriptorPool>> pool = makePool(*device_, 1, sizes);
  if (!pool) return pool.error();
  Result<VkDescriptorSet> set = allocateSet(*device_, pool->get(), pipelines_->textureLayout());
  if (!set) return set.error();
  const VkDescriptorImageInfo info{texture.sampler(), texture.view(),
                                   VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
  const VkWriteDescriptorSet write = imageWrite(*set, 0, info);
  device_->functions().UpdateDescriptorSets(device_->handle(), 1, &write, 0, nullptr);
  textures_.push_back({std::move(texture), std::move(*pool), *set});
  return static_cast<std::uint32_t>(textures_.size() - 1);
}

Result<RenderFrame> Renderer::createFrame(const FrameDescription& description) {
  RenderFrame frame;
  Result<RenderTarget> target = RenderTarget::create(*device_, picturePass_.get(), depthFormat_,
                                                     description.width, description.height);
  if (!target) return target.error();
  frame.target_ = std::move(*target);
  const std::array sizes{
      VkDescriptorPoolSize{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, description.views},
      VkDescriptorPoolSize{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 3 * description.views}};
  Result<Owned<VkDescriptorPool>> pool = makePool(*device_, description.views, sizes);
  if (!pool) return pool.error();
  frame.pool_ = std::move(*pool);
  for (std::uint32_t index = 0; index < description.views; ++index) {
    RenderFrame::ViewResources& view = frame.views_.emplace_back();
    Result<MappedBuffer> block =
        MappedBuffer::create(*device_, sizeof(ViewBlock), VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT);
    if (!block) return block.error();
    view.block = std::move(*block);
    Result<ShadowMaps> maps = ShadowMaps::create(*device_, shadowPass_.get(), description.shadows);
    if (!maps) return maps.error();
    view.maps = std::move(*maps);
    Result<VkDescriptorSet> set =
        allocateSet(*device_, frame.pool_.get(), pipelines_->viewLayout());
    if (!set) return set.error();
    view.set = *set;
    writeViewSet(view);
  }
  return frame;
}

void Renderer::writeViewSet(RenderFrame::ViewResources& view) const {
  const VkDescriptorBufferInfo block{view.block.handle(), 0, VK_WHOLE_SIZE};
  VkWriteDescriptorSet blockWrite{};
  blockWrite.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
  blockWrite.dstSet = view.set;
  blockWrite.descriptorCount = 1;
  blockWrite.descriptorType = VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER;
  blockWrite.pBufferInfo = &block;
  constexpr VkImageLayout layout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL;
  const VkDescriptorImageInfo key{compareSampler_.get(), view.maps.keyView(), layout};
  const VkDescriptorImageInfo depth{depthSampler_.get(), view.maps.keyView(), layout};
  const VkDescriptorImageInfo sky{compareSampler_.get(), view.maps.skyView(), layout};
  const std::array writes{blockWrite, imageWrite(view.set, 1, key), imageWrite(view.set, 2, depth),
                          imageWrite(view.set, 3, sky)};
  device_->functions().UpdateDescriptorSets(
      device_->handle(), static_cast<std::uint32_t>(writes.size()), writes.data(), 0, nullptr);
}

std::uint32_t Renderer::passCount(const RenderFrame& frame, std::size_t views) {
  std::uint32_t count = 1;
  for (std::size_t index = 0; index < views && index < frame.views_.size(); ++index)
    count += 1 + frame.views_[index].maps.sizes().skyLights;
  return count;
}

Result<void> Renderer::record(VkCommandBuffer commandBuffer, RenderFrame& frame,
                              std::span<const View> views, const std::function<void()>& afterPass) {
  if (views.size() > frame.views_.size()) {
    return Error{ErrorCode::invalidArgument,
                 "the frame was made for " + std::to_string(frame.views_.size()) +
                     " views, but gets " + std::to_string(views.size())};
  }
  for (std::size_t index = 0; index < views.size(); ++index) {
    const View& view = views[index];
    RenderFrame::ViewResources& resources = frame.views_[index];
    ViewBlock block;
    light(view.style, view.camera, view.casters, view.groundHeight.value_or(0), view.groundRadius,
          resources.maps.sizes(), block);
    block.viewport = {
        static_cast<float>(view.area.offset.x), static_cast<float>(view.area.offset.y),
        static_cast<float>(view.area.extent.width), static_cast<float>(view.area.extent.height)};
    std::memcpy(resources.block.bytes().data(), &block, sizeof(block));
    if (Result<void> done = recordShadows(commandBuffer, resources, view, afterPass); !done)
      return done;
  }

  const VulkanFunctions& functions = device_->functions();
  std::array<VkClearValue, 2> clear{};
  clear[1].depthStencil = {1, 0};
  VkRenderPassBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
  begin.renderPass = picturePass_.get();
  begin.framebuffer = frame.target_.framebuffer();
  begin.renderArea.extent = {frame.target_.width(), frame.target_.height()};
  begin.clearValueCount = static_cast<std::uint32_t>(clear.size());
  begin.pClearValues = clear.data();
  functions.CmdBeginRenderPass(commandBuffer, &begin, VK_SUBPASS_CONTENTS_INLINE);
  Result<void> done;
  for (std::size_t index = 0; index < views.size() && done; ++index)
    done = recordView(commandBuffer, frame.views_[index], views[index]);
  functions.CmdEndRenderPass(commandBuffer);
  if (afterPass) afterPass();
  return done;
}

Result<void> Renderer::recordShadows(VkCommandBuffer commandBuffer,
                                     const RenderFrame::ViewResources& frame, const View& view,
                                     const std::function<void()>& afterPass) {
  const VulkanFunctions& functions = device_->functions();
  const std::vector<const Draw*> draws = inOrder(view.draws);
  const ShadowSizes& sizes = frame.maps.sizes();
  Result<void> done;
  for (int index = -1; index < static_cast<int>(sizes.skyLights) && done; ++index) {
    const std::uint32_t size = index < 0 ? sizes.keyMap : sizes.skyMap;
    VkClearValue clear{};
    clear.depthStencil = {1, 0};
    VkRenderPassBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
    begin.renderPass = shadowPass_.get();
    begin.framebuffer = index < 0 ? frame.maps.keyFramebuffer()
                                  : frame.maps.skyFramebuffer(static_cast<std::uint32_t>(index));
    begin.renderArea.extent = {size, size};
    begin.clearValueCount = 1;
    begin.pClearValues = &clear;
    functions.CmdBeginRenderPass(commandBuffer, &begin, VK_SUBPASS_CONTENTS_INLINE);
    setArea(functions, commandBuffer, begin.renderArea);
    done = recordDraws(commandBuffer, frame.set, draws, Step::shadow, index);
    functions.CmdEndRenderPass(commandBuffer);
    if (afterPass) afterPass();
  }
  return done;
}

Result<void> Renderer::recordView(VkCommandBuffer commandBuffer,
                                  const RenderFrame::ViewResources& frame, const View& view) {
  const VulkanFunctions& functions = device_->functions();
  setArea(functions, commandBuffer, view.area);
  functions.CmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS,
                                  pipelines_->layout(), 0, 1, &frame.set, 0, nullptr);
  PipelineKey key;
  key.step = Step::background;
  const Result<VkPipeline> background = pipelines_->get(*device_, key);
  if (!background) return background.error();
  functions.CmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS, *background);
  functions.CmdDraw(commandBuffer, 3, 1, 0, 0);

  const std::vector<const Draw*> draws = inOrder(view.draws);
  const auto isBlended = [](const Draw* draw) {
    return draw->surface.transparency == Transparency::blend;
  };
  const auto blended = std::ranges::find_if(draws, isBlended);
  if (Result<void> done =
          recordDraws(commandBuffer, frame.set, {draws.begin(), blended}, Step::mesh, -1);
      !done)
    return done;
  // The ground is drawn after what may hide it, and not at all from below.
  if (view.groundHeight && (view.camera.isOrthographic ? view.camera.towardsEye.y > 0
                                                       : view.camera.eye.y > *view.groundHeight)) {
    key.step = Step::ground;
    const Result<VkPipeline> ground = pipelines_->get(*device_, key);
    if (!ground) return ground.error();
    functions.CmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS, *ground);
    functions.CmdDraw(commandBuffer, 4, 1, 0, 0);
  }
  return recordDraws(commandBuffer, frame.set, {blended, draws.end()}, Step::mesh, -1);
}

Result<void> Renderer::recordDraws(VkCommandBuffer commandBuffer, VkDescriptorSet set,
                                   std::span<const Draw* const> draws, Step step, int shadowIndex) {
  const VulkanFunctions& functions = device_->functions();
  functions.CmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS,
                                  pipelines_->layout(), 0, 1, &set, 0, nullptr);
  std::optional<PipelineKey> lastKey;
  std::optional<std::uint32_t> lastTexture;
  const Geometry* lastGeometry = nullptr;
  for (const Draw* draw : draws) {
    // In a crowd, equal parts are adjacent: only bind what differs.
    const PipelineKey key = keyOf(*draw, step);
    if (!lastKey || key < *lastKey || *lastKey < key) {
      const Result<VkPipeline> pipeline = pipelines_->get(*device_, key);
      if (!pipeline) return pipeline.error();
      functions.CmdBindPipeline(commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS, *pipeline);
      lastKey = key;
    }
    if (lastTexture != draw->surface.texture) {
      lastTexture = draw->surface.texture;
      functions.CmdBindDescriptorSets(commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS,
                                      pipelines_->layout(), 1, 1, &textures_[*lastTexture].set, 0,
                                      nullptr);
    }
    if (lastGeometry != draw->geometry) {
      lastGeometry = draw->geometry;
      functions.CmdBindIndexBuffer(commandBuffer, lastGeometry->indices(), 0, VK_INDEX_TYPE_UINT32);
    }
    bindVertices(functions, commandBuffer, *draw);
    const DrawBlock block = blockOf(*draw, shadowIndex);
    functions.CmdPushConstants(commandBuffer, pipelines_->layout(), bothStages, 0, sizeof(block),
                               &block);
    functions.CmdDrawIndexed(commandBuffer, draw->geometry->indexCount(), 1, 0, 0, 0);
  }
  return {};
}

}  // namespace dermis::samples::render
