#include "orbit_camera.h"

#include <algorithm>
#include <cmath>

#include <glm/ext/matrix_clip_space.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

namespace dermis::viewer {
namespace {

namespace render = samples::render;

constexpr float fieldOfView = 28;     // degrees, vertical
constexpr float turnPerHeight = 220;  // degrees
constexpr float zoomPerStep = 0.88f;

glm::vec3 rightOf(const glm::vec3& back) {
  return glm::normalize(glm::cross(glm::vec3(0, 1, 0), back));
}

}  // namespace

void OrbitCamera::frame(const Box& box, float aspect) {
  render::CameraOptions options;
  options.fieldOfView = static_cast<double>(fieldOfView);
  options.margin = 0.1;
  options.azimuth = static_cast<double>(azimuth_);
  options.elevation = static_cast<double>(elevation_);
  const render::Camera fitted = render::frameBoxes({&box, 1}, box, options, aspect);
  target_ = fitted.eye - fitted.towardsEye * fitted.distance;
  distance_ = fitted.distance;
  radius_ = render::radiusOf(box);
}

void OrbitCamera::orbit(float right, float down) {
  azimuth_ = std::remainder(azimuth_ - right * turnPerHeight, 360.0f);
  elevation_ = std::clamp(elevation_ + down * turnPerHeight, -89.0f, 89.0f);
  isMoved_ = true;
}

void OrbitCamera::pan(float right, float down) {
  const float height = 2 * distance_ * std::tan(glm::radians(fieldOfView) / 2);
  const glm::vec3 back = towardsEye(), across = rightOf(back);
  target_ += (glm::cross(back, across) * down - across * right) * height;
  isMoved_ = true;
}

void OrbitCamera::zoom(float steps) {
  distance_ = std::clamp(distance_ * std::pow(zoomPerStep, steps), radius_ * 0.05f, radius_ * 60);
  isMoved_ = true;
}

glm::vec3 OrbitCamera::towardsEye() const {
  const float azimuth = glm::radians(azimuth_), elevation = glm::radians(elevation_);
  return {std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
          std::cos(azimuth) * std::cos(elevation)};
}

render::Camera OrbitCamera::camera(const Box& box, float aspect) const {
  render::Camera camera;
  camera.towardsEye = towardsEye();
  camera.right = rightOf(camera.towardsEye);
  camera.distance = distance_;
  camera.eye = target_ + camera.towardsEye * distance_;
  const float reach =
      glm::length(render::centerOf(box) - target_) + groundRadius * render::radiusOf(box);
  const float farthest = distance_ + reach;
  const float nearest = std::max(distance_ - 2 * radius_, std::min(distance_, radius_) * 0.02f);
  const glm::mat4 view = glm::lookAtRH(camera.eye, target_, glm::vec3(0, 1, 0));
  glm::mat4 projection =
      glm::perspectiveRH_ZO(glm::radians(fieldOfView), aspect, nearest, farthest * 1.1f);
  projection[1][1] *= -1;  // Vulkan's y goes down.
  camera.viewProjection = projection * view;
  return camera;
}

}  // namespace dermis::viewer
