// Uniform data of the shaders. shaders/view.glsl and shaders/draw.glsl declare the same in GLSL.
#pragma once

#include <cstdint>

#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>

namespace dermis::samples::render {

inline constexpr std::uint32_t maxSkyLights = 32;

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

}  // namespace dermis::samples::render
