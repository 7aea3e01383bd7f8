// Where a picture is drawn: four samples a pixel, resolved into an image that can be copied from.
#pragma once

#include <cstdint>
#include <vector>

#include "buffer.h"
#include "image.h"

namespace dermis::samples::render {

inline constexpr VkSampleCountFlagBits sampleCount = VK_SAMPLE_COUNT_4_BIT;
inline constexpr VkFormat colorFormat = VK_FORMAT_R8G8B8A8_SRGB;

/// The pass that draws a picture. Behind it the resolved image is in
/// VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL.
Result<Owned<VkRenderPass>> makePicturePass(const Device& device, VkFormat depthFormat);

/// The most precise format for depth that the device can draw into.
VkFormat chooseDepthFormat(const Device& device);

class RenderTarget {
 public:
  /// Fails with `limitExceeded` if the device cannot draw so large a picture, or lacks the memory.
  static Result<RenderTarget> create(Device& device, VkRenderPass pass, VkFormat depthFormat,
                                     std::uint32_t width, std::uint32_t height);

  std::uint32_t width() const { return width_; }
  std::uint32_t height() const { return height_; }
  VkFramebuffer framebuffer() const { return framebuffer_.get(); }
  /// What was drawn: R8G8B8A8_SRGB.
  const Image& resolved() const { return resolved_; }

  /// Copies what was drawn to memory that the CPU reads after a fence.
  void recordReadBack(const Device& device, VkCommandBuffer commandBuffer) const;
  /// Red, green, blue, alpha, a byte each, row by row from the top.
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
