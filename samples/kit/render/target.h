// The render target of a picture: four samples per pixel, resolved into an image that can be copied
// from.
#pragma once

#include <cstdint>
#include <vector>

#include "kit/buffer.h"
#include "kit/render/image.h"

namespace dermis::samples::render {

inline constexpr VkSampleCountFlagBits sampleCount = VK_SAMPLE_COUNT_4_BIT;
inline constexpr VkFormat colorFormat = VK_FORMAT_R8G8B8A8_SRGB;

/// The render pass of a picture. After it, the resolved image is in
/// VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL.
Result<Owned<VkRenderPass>> makePicturePass(const Device& device, VkFormat depthFormat);

/// The most precise depth format that the device can draw into.
VkFormat chooseDepthFormat(const Device& device);

class RenderTarget {
 public:
  /// Fails with `limitExceeded` if the device cannot draw a picture of this size, or lacks the
  /// memory.
  static Result<RenderTarget> create(Device& device, VkRenderPass pass, VkFormat depthFormat,
                                     std::uint32_t width, std::uint32_t height);

  std::uint32_t width() const { return width_; }
  std::uint32_t height() const { return height_; }
  VkFramebuffer framebuffer() const { return framebuffer_.get(); }
  /// The finished picture: R8G8B8A8_SRGB.
  const Image& resolved() const { return resolved_; }

  /// Copies the picture to memory that the CPU can read after a fence.
  void recordReadBack(const Device& device, VkCommandBuffer commandBuffer) const;
  /// Red, green, blue, alpha, one byte each; top row first.
  std::vector<std::uint8_t> pixels() const;

 private:
  static Result<RenderTarget> make(Device& device, VkRenderPass pass, VkFormat depthFormat,
                                   std::uint32_t width, std::uint32_t height);

  std::uint32_t width_ = 0, height_ = 0;
  Image color_, depth_, resolved_;
  Owned<VkFramebuffer> framebuffer_;
  MappedBuffer readBack_;
};

}  // namespace dermis::samples::render
