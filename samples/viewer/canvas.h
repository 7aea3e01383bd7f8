// What the window shows, before it is shown: the picture of the scene, and the interface on it. An
// image of our own, because those of a window need not be readable, and screenshots are.
#pragma once

#include <cstdint>
#include <functional>

#include "buffer.h"
#include "render/image.h"
#include "render/picture.h"
#include "render/target.h"

namespace dermis::viewer {

class Canvas {
 public:
  /// `format` is an sRGB format of four bytes a pixel. `device` must outlive it.
  static Result<Canvas> create(samples::Device& device, VkFormat format);

  /// As large as the window. The device must be idle.
  Result<void> resize(VkExtent2D pixels);
  VkExtent2D extent() const { return extent_; }
  /// The pass that the interface is drawn in: its colors are bytes, not light.
  VkRenderPass pass() const { return pass_.get(); }

  /// A picture, scaled to a part of the canvas, and `drawInterface` on it; nothing: an empty one.
  /// Behind it the image is ready to be copied from.
  void record(VkCommandBuffer commandBuffer, const samples::render::RenderTarget* picture,
              const VkRect2D& area, const std::function<void()>& drawInterface) const;
  /// Copies it into an image of the same size and bytes, whose contents are lost, and makes that
  /// ready to be presented.
  void recordCopy(VkCommandBuffer commandBuffer, VkImage image) const;

  /// Copies it to memory; after the GPU is done, `picture` has it.
  Result<void> recordReadBack(VkCommandBuffer commandBuffer);
  samples::render::Picture picture() const;

 private:
  Result<void> makePass();
  void recordPicture(VkCommandBuffer commandBuffer, const samples::render::RenderTarget& picture,
                     const VkRect2D& area) const;

  samples::Device* device_ = nullptr;
  VkFormat format_ = VK_FORMAT_UNDEFINED;
  VkExtent2D extent_{};
  samples::render::Owned<VkRenderPass> pass_;
  samples::render::Image image_;
  samples::render::Owned<VkFramebuffer> framebuffer_;
  samples::MappedBuffer readBack_;
};

}  // namespace dermis::viewer
