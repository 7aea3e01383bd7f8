// A camera that the mouse moves around what it looks at.
#pragma once

#include <glm/vec3.hpp>

#include "dermis/types.h"
#include "render/camera.h"

namespace dermis::viewer {

class OrbitCamera {
 public:
  /// Looks at all of a box, from where it stands. `aspect`: width divided by height.
  void frame(const Box& box, float aspect);
  /// Whether it is as `frame` left it.
  bool isFramed() const { return isFramed_; }
  /// Back to the view from the front and a little from above.
  void resetDirection();

  /// By parts of the picture's height, to the right and down.
  void orbit(float right, float down);
  void pan(float right, float down);
  /// Steps of the wheel; positive: nearer.
  void zoom(float steps);

  /// `scene` is around all that is to be seen, the ground included.
  samples::render::Camera camera(const Box& scene, float aspect) const;

  /// Two that are equal take the same picture.
  bool operator==(const OrbitCamera&) const = default;

 private:
  glm::vec3 towardsEye() const;

  glm::vec3 target_{0.0f};
  float azimuth_ = 28, elevation_ = 10;  ///< degrees, as those of `CameraOptions`
  float distance_ = 4;
  float radius_ = 1;  ///< of what was framed
  bool isFramed_ = false;
};

}  // namespace dermis::viewer
