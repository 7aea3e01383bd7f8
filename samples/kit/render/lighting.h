// Studio lighting: a key light over the photographer's shoulder, a sky all around, and a rim light
// behind the model that shows its outline.
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "dermis/types.h"
#include "kit/render/blocks.h"
#include "kit/render/camera.h"

namespace dermis::samples::render {

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

}  // namespace dermis::samples::render
