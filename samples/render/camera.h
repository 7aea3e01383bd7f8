// Where a picture is taken from.
#pragma once

#include <span>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "dermis/types.h"

namespace dermis::samples::render {

struct CameraOptions {
  bool isOrthographic = false;
  double azimuth = 30;    ///< degrees around the model; 0 in front of it (+Z), 90 at its left (+X)
  double elevation = 12;  ///< degrees above the ground
  double fieldOfView = 28;  ///< degrees, vertical; a portrait lens
  double margin = 0.08;     ///< free at each border, as a part of the picture
};

struct Camera {
  glm::mat4 viewProjection{1.0f};
  glm::vec3 eye{0.0f};                     ///< orthographic: of no meaning
  glm::vec3 towardsEye{0.0f, 0.0f, 1.0f};  ///< from what it looks at
  glm::vec3 right{1.0f, 0.0f, 0.0f};
  float distance = 1;  ///< from the eye to what it looks at
  bool isOrthographic = false;
};

/// The box around all of them.
Box unite(std::span<const Box> boxes);

/// Half the diagonal, and never 0.
float radiusOf(const Box& box);
glm::vec3 centerOf(const Box& box);

/// A camera in whose picture the boxes lie: as large as the margin allows, and in its middle.
/// `depth` is what may be seen besides, a ground for one, and must not be cut off. `aspect` is the
/// picture's width divided by its height.
Camera frameBoxes(std::span<const Box> boxes, const Box& depth, const CameraOptions& options,
                  float aspect);

}  // namespace dermis::samples::render
