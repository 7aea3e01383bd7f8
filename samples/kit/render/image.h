// Images with their own memory, views of them, and base-color textures.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "kit/render/owned.h"

namespace dermis::samples::render {

struct ImageDescription {
  VkFormat format = VK_FORMAT_UNDEFINED;
  VkFormat viewFormat = VK_FORMAT_UNDEFINED;  ///< of its views, if different
  std::uint32_t width = 0, height = 0;
  std::uint32_t layers = 0;  ///< 0: one layer, not viewed as an array
  std::uint32_t levels = 1;
  VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT;
  VkImageUsageFlags usage = 0;
  VkImageAspectFlags aspect = VK_IMAGE_ASPECT_COLOR_BIT;
};

class Image {
 public:
  static Result<Image> create(Device& device, const ImageDescription& description);

  VkImage handle() const { return image_.get(); }
  /// A view of the whole image.
  VkImageView view() const { return view_.get(); }
  /// A view of one layer, to draw into.
  Result<Owned<VkImageView>> layerView(Device& device, std::uint32_t layer) const;
  const ImageDescription& description() const { return description_; }

 private:
  ImageDescription description_;
  // The image must be destroyed before its memory, and the view before the image.
  Owned<VkDeviceMemory> memory_;
  Owned<VkImage> image_;
  Owned<VkImageView> view_;
};

/// A barrier for a part of an image, which need not be an `Image`.
void recordTransition(const Device& device, VkCommandBuffer commandBuffer, VkImage image,
                      const VkImageSubresourceRange& part, VkImageLayout from, VkImageLayout to,
                      VkPipelineStageFlags sourceStages, VkAccessFlags sourceAccesses,
                      VkPipelineStageFlags destinationStages, VkAccessFlags destinationAccesses);

/// A barrier for all levels and layers of an image.
void recordTransition(const Device& device, VkCommandBuffer commandBuffer, const Image& image,
                      VkImageLayout from, VkImageLayout to, VkPipelineStageFlags sourceStages,
                      VkAccessFlags sourceAccesses, VkPipelineStageFlags destinationStages,
                      VkAccessFlags destinationAccesses);

/// Red, green, blue and alpha, one byte each, in sRGB; top row first.
struct TexturePixels {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
};

enum class Wrap : std::uint8_t { repeat, mirror, clamp };

struct TextureOptions {
  Wrap wrapU = Wrap::repeat, wrapV = Wrap::repeat;
};

/// Decodes a PNG or JPEG. Fails with `invalidData` if it is broken or has another format, and with
/// `limitExceeded` if it is larger than 8192 pixels on a side, or needs more memory than
/// `memoryLeft`. This is checked before memory is allocated.
Result<TexturePixels> decodeImage(std::span<const std::byte> encoded,
                                  std::uint64_t* memoryLeft = nullptr);

class Texture {
 public:
  /// Uploads the texture with all mip levels, and waits.
  static Result<Texture> create(Device& device, const TexturePixels& pixels,
                                const TextureOptions& options);
  /// The same image, with another wrap mode.
  static Result<Texture> create(Device& device, const Texture& other,
                                const TextureOptions& options);

  VkImageView view() const { return image_->view(); }
  VkSampler sampler() const { return sampler_.get(); }

 private:
  std::shared_ptr<const Image> image_;
  Owned<VkSampler> sampler_;
};

}  // namespace dermis::samples::render
