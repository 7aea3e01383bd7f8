// Base-color textures: from encoded bytes to an image that shaders read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dermis/memory_budget.h"
#include "image.h"

namespace dermis::samples::render {

/// Red, green, blue and alpha, a byte each, in sRGB; row by row from the top.
struct TexturePixels {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
};

enum class Wrap : std::uint8_t { repeat, mirror, clamp };

struct TextureOptions {
  Wrap wrapU = Wrap::repeat, wrapV = Wrap::repeat;
};

/// Decodes a PNG or JPEG. Fails with `invalidData` if it is broken or something else, and with
/// `limitExceeded` if it is larger than 8192 pixels a side, or than the budget, if there is one:
/// before memory is taken for it.
Result<TexturePixels> decodeImage(std::span<const std::byte> encoded,
                                  gltf::MemoryBudget* budget = nullptr);

class Texture {
 public:
  /// Uploads it with all its levels, and waits.
  static Result<Texture> create(Device& device, const TexturePixels& pixels,
                                const TextureOptions& options);
  /// The same image, wrapped in another way.
  static Result<Texture> create(Device& device, const Texture& other,
                                const TextureOptions& options);

  VkImageView view() const { return image_->view(); }
  VkSampler sampler() const { return sampler_.get(); }

 private:
  std::shared_ptr<const Image> image_;
  Owned<VkSampler> sampler_;
};

}  // namespace dermis::samples::render
