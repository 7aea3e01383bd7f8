// Shadow maps of the lights of one view.
#pragma once

#include <cstdint>
#include <vector>

#include "kit/render/image.h"
#include "kit/render/lighting.h"

namespace dermis::samples::render {

/// 16 bits, which every device can draw into and read. That is enough, because the lights' views
/// are fitted to the scene.
inline constexpr VkFormat shadowFormat = VK_FORMAT_D16_UNORM;

/// The render pass for one map. After it, fragment shaders can read the map.
Result<Owned<VkRenderPass>> makeShadowPass(const Device& device);

class ShadowMaps {
 public:
  static Result<ShadowMaps> create(Device& device, VkRenderPass pass, const ShadowSizes& sizes);

  const ShadowSizes& sizes() const { return sizes_; }
  VkImageView keyView() const { return key_.view(); }
  VkImageView skyView() const { return sky_.view(); }
  VkFramebuffer keyFramebuffer() const { return keyFramebuffer_.get(); }
  VkFramebuffer skyFramebuffer(std::uint32_t light) const { return skyFramebuffers_[light].get(); }

 private:
  ShadowSizes sizes_;
  Image key_, sky_;
  std::vector<Owned<VkImageView>> skyLayers_;
  Owned<VkFramebuffer> keyFramebuffer_;
  std::vector<Owned<VkFramebuffer>> skyFramebuffers_;
};

}  // namespace dermis::samples::render
