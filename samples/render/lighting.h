// The light of a photographer's studio: a key light over the photographer's shoulder, a sky all
// around, and something at the back that draws the outline.
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "blocks.h"
#include "camera.h"
#include "dermis/types.h"

namespace dermis::samples::render {

struct LightingStyle {
  float keyAzimuth = -50;   ///< degrees from the camera's, to the left where negative
  float keyElevation = 50;  ///< degrees above the ground
  float keySize = 0.05f;    ///< tangent of its angular radius: how soft shadows are
  glm::vec3 keyColor{0.98f, 0.92f, 0.83f};  ///< what a white surface reflects that faces it
  glm::vec3 skyColor{0.40f, 0.45f, 0.53f};
  glm::vec3 bounceColor{0.16f, 0.15f, 0.14f};
  float rim = 0.45f;
  glm::vec3 horizonColor{0.60f, 0.64f, 0.68f};  ///< of the background, as displayed, linear
  glm::vec3 zenithColor{0.22f, 0.27f, 0.33f};
  float haze = 0;  ///< how much of the background lies over the farthest; 0 to 1
};

/// Shadow maps of a view: how large, and how many for the sky. More make its shade smoother, and
/// each draws everything once more.
struct ShadowSizes {
  std::uint32_t keyMap = 2048;
  std::uint32_t skyMap = 256;
  std::uint32_t skyLights = 24;
};

/// Fills in all but the viewport. `casters` holds everything that is drawn; `groundHeight` is where
/// it stands, and `groundRadius` how far from the middle of `casters` the ground is seen.
void light(const LightingStyle& style, const Camera& camera, const Box& casters, float groundHeight,
           float groundRadius, const ShadowSizes& sizes, ViewBlock& block);

}  // namespace dermis::samples::render
