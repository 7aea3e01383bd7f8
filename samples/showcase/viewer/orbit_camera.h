// A camera that the mouse moves around its target.
#pragma once

#include <glm/vec3.hpp>

#include "dermis/mesh.h"
#include "kit/render/camera.h"

namespace dermis::viewer {

inline constexpr float groundRadius = 5;  ///< in radii of the box around a model

class OrbitCamera {
 public:
  /// Shows all of a box, from the current direction. `aspect`: width divided by height.
  void frame(const Box& box, float aspect);
  /// Whether the camera has been moved since it was made. If not, it frames what is shown.
  bool isMoved() const { return isMoved_; }

  /// Turns the camera. Arguments are fractions of the picture's height, to the right and down.
  void orbit(float right, float down);
  void pan(float right, float down);
  /// Zooms by steps of the wheel; positive: nearer.
  void zoom(float steps);

  /// A camera that sees a box and the ground around it.
  samples::render::Camera camera(const Box& box, float aspect) const;

  /// Equal cameras take the same picture.
  bool operator==(const OrbitCamera&) const = default;

 private:
  glm::vec3 towardsEye() const;

  glm::vec3 target_{0.0f};
  float azimuth_ = 28, elevation_ = 10;  ///< degrees, as in `CameraOptions`
  float distance_ = 4;
  float radius_ = 1;  ///< of the framed box
  bool isMoved_ = false;
};

}  // namespace dermis::viewer
