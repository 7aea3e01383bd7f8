// The contents of the window before they are shown: the picture of the scene, and the interface on
// top. This is a separate image, because screenshots read it, and images of a swapchain need not be
// readable.
#pragma once

#include <cstdint>
#include <functional>

#include "kit/buffer.h"
#include "kit/render/image.h"
#include "kit/render/picture.h"
#include "kit/render/target.h"

namespace dermis::viewer {

class Canvas {
 public:
  /// `format` is an sRGB format with four bytes per pixel. `device` must outlive the canvas.
  static Result<Canvas> create(samples::Device& device, VkFormat format);

  /// Takes the size of the window. The device must be idle.
  Result<void> resize(VkExtent2D pixels);
  VkExtent2D extent() const { return extent_; }
  /// The pass for drawing the interface, whose colors are sRGB bytes, not linear light.
  VkRenderPass pass() const { return pass_.get(); }

  /// Draws a picture, scaled to a part of the canvas, and then the interface by `drawInterface`.
  /// Without a picture the part is empty. Afterwards the image is ready to be copied from.
  void record(VkCommandBuffer commandBuffer, const samples::render::RenderTarget* picture,
              const VkRect2D& area, const std::function<void()>& drawInterface) const;
  /// Copies the canvas to an image of the same size and format, whose contents are lost, and makes
  /// that image ready to be presented.
  void recordCopy(VkCommandBuffer commandBuffer, VkImage image) const;

  /// Copies the canvas to memory. When the GPU is done, `picture` returns it.
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
