// The camera of a picture.
#pragma once

#include <span>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "dermis/mesh.h"

namespace dermis::samples::render {

struct CameraOptions {
  bool isOrthographic = false;
  double azimuth = 30;    ///< degrees around the model; 0 in front of it (+Z), 90 at its left (+X)
  double elevation = 12;  ///< degrees above the ground
  double fieldOfView = 28;  ///< degrees, vertical; a portrait lens
  double margin = 0.08;     ///< free space at each border, as a fraction of the picture
};

struct Camera {
  glm::mat4 viewProjection{1.0f};
  glm::vec3 eye{0.0f};                     ///< meaningless if orthographic
  glm::vec3 towardsEye{0.0f, 0.0f, 1.0f};  ///< direction from the target
  glm::vec3 right{1.0f, 0.0f, 0.0f};
  float distance = 1;  ///< from the eye to the target
  bool isOrthographic = false;
};

/// The box around all of them.
Box unite(std::span<const Box> boxes);

/// Half the diagonal, always above 0.
float radiusOf(const Box& box);
glm::vec3 centerOf(const Box& box);

/// A camera that shows the boxes centered and as large as the margin allows. `depth` is everything
/// else that may be visible, such as a ground, and must not be clipped. `aspect` is the picture's
/// width divided by its height.
Camera frameBoxes(std::span<const Box> boxes, const Box& depth, const CameraOptions& options,
                  float aspect);

}  // namespace dermis::samples::render
