// Draws skinned meshes: straight from the buffers that Dermis wrote, in the command buffer that it
// recorded into. For pictures and films of the samples; an engine has its own renderer.
//
//   Renderer renderer = *Renderer::create(device);
//   RenderFrame frame = *renderer.createFrame(device, {1280, 720});
//   context.record(commandBuffer, …);                          // or SkinningSystem::record
//   … the barrier vulkan::outputScope(Consumer::vertexInput) …
//   renderer.record(commandBuffer, frame, views);
//   frame.target().recordReadBack(…), or a blit from frame.target().resolved() into a window
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "camera.h"
#include "draw.h"
#include "lighting.h"
#include "pipelines.h"
#include "shadow_maps.h"
#include "target.h"
#include "texture.h"

namespace dermis::samples::render {

/// One scene in a part of the picture.
struct View {
  VkRect2D area{};  ///< pixels
  Camera camera;
  LightingStyle style;
  std::span<const Draw> draws;
  /// What throws the shadows, where coarser triangles do for that; empty: `draws`.
  std::span<const Draw> shadowDraws;
  Box casters;  ///< Around all that is drawn.
  /// Where it stands, and how far from the middle the ground reaches; nothing: there is none.
  std::optional<float> groundHeight;
  float groundRadius = 0;
};

struct FrameDescription {
  std::uint32_t width = 1280, height = 720;
  std::uint32_t views = 1;  ///< at most so many in one picture
  ShadowSizes shadows;
};

/// What a picture is drawn into, and what only one picture at a time can use: one for each frame in
/// flight. Must outlive the GPU's use of it, and go before the renderer.
class RenderFrame {
 public:
  const RenderTarget& target() const { return target_; }

 private:
  friend class Renderer;
  struct ViewResources {
    MappedBuffer block;
    ShadowMaps maps;
    VkDescriptorSet set = VK_NULL_HANDLE;
  };
  RenderTarget target_;
  Owned<VkDescriptorPool> pool_;
  std::vector<ViewResources> views_;
};

/// Not thread-safe.
class Renderer {
 public:
  /// `device` was made with `DeviceOptions::graphics`, and must outlive it.
  static Result<Renderer> create(Device& device, const FilterTaps& taps = {});

  /// For `Surface::texture`.
  Result<std::uint32_t> addTexture(const TexturePixels& pixels, const TextureOptions& options);
  /// The pixels of a texture that was added, wrapped in another way. They are not stored again.
  Result<std::uint32_t> addTexture(std::uint32_t pixelsOf, const TextureOptions& options);

  Result<RenderFrame> createFrame(const FrameDescription& description);

  /// Records shadow maps and picture, outside a render pass. What is in the views need not live
  /// longer than the call, but for buffers and geometry. Builds pipelines when they are first
  /// wanted. Fails with `invalidArgument` for more views than the frame was made for, or a format
  /// that cannot be drawn from. `afterPass` is called when each shadow map and the picture is
  /// recorded, outside a render pass, `passCount` times.
  Result<void> record(VkCommandBuffer commandBuffer, RenderFrame& frame,
                      std::span<const View> views, const std::function<void()>& afterPass = {});
  static std::uint32_t passCount(const RenderFrame& frame, std::size_t views);

 private:
  struct TextureEntry {
    Texture texture;
    Owned<VkDescriptorPool> pool;
    VkDescriptorSet set = VK_NULL_HANDLE;
  };

  Result<void> makeSamplers();
  Result<std::uint32_t> addTexture(Texture texture);
  void writeViewSet(RenderFrame::ViewResources& view) const;
  Result<void> recordShadows(VkCommandBuffer commandBuffer, const RenderFrame::ViewResources& frame,
                             const View& view, const std::function<void()>& afterPass);
  Result<void> recordView(VkCommandBuffer commandBuffer, const RenderFrame::ViewResources& frame,
                          const View& view);
  Result<void> recordDraws(VkCommandBuffer commandBuffer, VkDescriptorSet set,
                           std::span<const Draw* const> draws, Step step, int shadowIndex);

  Device* device_ = nullptr;
  VkFormat depthFormat_ = VK_FORMAT_UNDEFINED;
  Owned<VkRenderPass> shadowPass_, picturePass_;
  Owned<VkSampler> compareSampler_, depthSampler_;
  std::optional<Pipelines> pipelines_;
  std::vector<TextureEntry> textures_;
};

}  // namespace dermis::samples::render
