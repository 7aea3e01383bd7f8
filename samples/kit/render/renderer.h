// Draws skinned meshes directly from the buffers that Dermis wrote, in the same command buffer. For
// pictures and films of the samples; an engine has its own renderer.
//
//   Renderer renderer = *Renderer::create(device);
//   RenderFrame frame = *renderer.createFrame({1280, 720});
//   context.record(commandBuffer, …);                          // or SceneRecorder::record
//   context.recordBarrier(commandBuffer, Use::dermis, Use::vertexInput);
//   renderer.record(commandBuffer, frame, views);
//   frame.target().recordReadBack(…), or a blit from frame.target().resolved() into a window
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "kit/render/camera.h"
#include "kit/render/draw.h"
#include "kit/render/image.h"
#include "kit/render/lighting.h"
#include "kit/render/pipelines.h"
#include "kit/render/target.h"

namespace dermis::samples::render {

/// One scene, drawn into a part of the picture.
struct View {
  VkRect2D area{};  ///< pixels
  Camera camera;
  LightingStyle style;
  std::span<const Draw> draws;
  Box casters;  ///< box around everything that is drawn
  /// The height of the ground, and its radius around the center; nothing: no ground.
  std::optional<float> groundHeight;
  float groundRadius = 0;
};

struct FrameDescription {
  std::uint32_t width = 1280, height = 720;
  std::uint32_t views = 1;  ///< maximum number of views in one picture
  ShadowSizes shadows;
};

/// The images of a picture, and other resources that only one picture can use at a time: one object
/// for each frame in flight. It must outlive the GPU's use of it, and be destroyed before the
/// renderer.
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
  /// `device` must have been created with `DeviceOptions::graphics`, and must outlive the renderer.
  static Result<Renderer> create(Device& device, const FilterTaps& taps = {});

  /// Returns a value for `Surface::texture`.
  Result<std::uint32_t> addTexture(const TexturePixels& pixels, const TextureOptions& options);
  /// Adds a texture with the pixels of an existing one and another wrap mode. The pixels are not
  /// stored again.
  Result<std::uint32_t> addTexture(std::uint32_t pixelsOf, const TextureOptions& options);

  Result<RenderFrame> createFrame(const FrameDescription& description);

  /// Records the shadow maps and the picture, outside a render pass. The contents of the views,
  /// except buffers and geometry, need not outlive the call. Creates pipelines when they are first
  /// needed. Fails with `invalidArgument` for more views than the frame was made for, or a format
  /// that cannot be drawn. `afterPass` is called outside a render pass after each shadow map and
  /// the picture have been recorded, `passCount` times in all.
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
