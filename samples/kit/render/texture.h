// Base-color textures: decodes images and uploads them for shaders.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dermis/memory_budget.h"
#include "kit/render/image.h"

namespace dermis::samples::render {

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
/// `limitExceeded` if it is larger than 8192 pixels on a side, or than the budget if there is one.
/// This is checked before memory is allocated.
Result<TexturePixels> decodeImage(std::span<const std::byte> encoded,
                                  gltf::MemoryBudget* budget = nullptr);

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
