// The depths that the lights of one view see.
#pragma once

#include <cstdint>
#include <vector>

#include "image.h"
#include "lighting.h"

namespace dermis::samples::render {

/// 16 bits, which every device can draw into and read: the views of the lights fit what is drawn.
inline constexpr VkFormat shadowFormat = VK_FORMAT_D16_UNORM;

/// The pass that draws one map. It leaves it ready to be read by fragment shaders.
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
