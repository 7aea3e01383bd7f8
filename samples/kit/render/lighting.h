// The lights of a view, their shadow maps, and the uniform data that shaders get.
#pragma once

#include <cstdint>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "dermis/mesh.h"
#include "kit/render/camera.h"
#include "kit/render/image.h"

namespace dermis::samples::render {

inline constexpr std::uint32_t maxSkyLights = 32;

/// Uniform data of the shaders. shaders/view.glsl and shaders/draw.glsl declare the same in GLSL.
/// Layout std140. All members are matrices or vectors of four components, which need no padding.
struct ViewBlock {
  glm::mat4 viewProjection{1.0f};
  glm::mat4 keyMatrix{1.0f};
  glm::mat4 skyMatrices[maxSkyLights];
  glm::vec4 skyDirections[maxSkyLights];
  glm::vec4 eye{0.0f};
  glm::vec4 keyDirection{0.0f};
  glm::vec4 keyColor{0.0f};
  glm::vec4 skyColor{0.0f};
  glm::vec4 bounceColor{0.0f};
  glm::vec4 rimDirection{0.0f};
  glm::vec4 shadow{0.0f};
  glm::vec4 sky{0.0f};
  glm::vec4 horizonColor{0.0f};
  glm::vec4 zenithColor{0.0f};
  glm::vec4 ground{0.0f};
  glm::vec4 viewport{0.0f};
  glm::vec4 haze{0.0f};
};
static_assert(sizeof(ViewBlock) == 64 * (2 + maxSkyLights) + 16 * (maxSkyLights + 13));

struct DrawBlock {
  glm::vec4 rows[3];
  glm::vec4 baseColor{1.0f};
  glm::vec4 surface{0.0f};
  std::int32_t shadowIndex = 0;
};
static_assert(sizeof(DrawBlock) == 84, "Vulkan guarantees only 128 bytes of push constants");

/// Studio lighting: a key light over the photographer's shoulder, a sky all around, and a rim light
/// behind the model that shows its outline.
struct LightingStyle {
  float keyAzimuth = -50;   ///< degrees from the camera's azimuth; negative: to the left
  float keyElevation = 50;  ///< degrees above the ground
  float keySize = 0.05f;    ///< tangent of its angular radius; larger values give softer shadows
  glm::vec3 keyColor{0.98f, 0.92f, 0.83f};  ///< reflected by a white surface that faces the light
  glm::vec3 skyColor{0.40f, 0.45f, 0.53f};
  glm::vec3 bounceColor{0.16f, 0.15f, 0.14f};
  float rim = 0.45f;
  glm::vec3 horizonColor{0.60f, 0.64f, 0.68f};  ///< of the background, as displayed, in linear
                                                ///< values
  glm::vec3 zenithColor{0.22f, 0.27f, 0.33f};
  float haze = 0;  ///< share of the background mixed into the farthest point; 0 to 1
};

/// Shadow maps of a view: their sizes, and their number for the sky. More sky lights give smoother
/// shade, but each draws everything once more.
struct ShadowSizes {
  std::uint32_t keyMap = 2048;
  std::uint32_t skyMap = 256;
  std::uint32_t skyLights = 24;
};

/// Fills in everything but the viewport. `casters` contains everything that is drawn;
/// `groundHeight` is where it stands, and `groundRadius` is how far from the center of `casters`
/// the ground is visible.
void light(const LightingStyle& style, const Camera& camera, const Box& casters, float groundHeight,
           float groundRadius, const ShadowSizes& sizes, ViewBlock& block);

/// 16 bits, which every device can draw into and read. That is enough, because the lights' views
/// are fitted to the scene.
inline constexpr VkFormat shadowFormat = VK_FORMAT_D16_UNORM;

/// The render pass for one map. After it, fragment shaders can read the map.
Result<Owned<VkRenderPass>> makeShadowPass(const Device& device);

/// Shadow maps of the lights of one view.
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
