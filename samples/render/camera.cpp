#include "camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <glm/ext/matrix_clip_space.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

namespace dermis::samples::render {
namespace {

struct Axes {
  glm::vec3 right, up, back;  ///< back: towards the eye
};

Axes axesOf(const CameraOptions& options) {
  const auto azimuth = static_cast<float>(glm::radians(options.azimuth));
  // At the pole there would be no direction to the right.
  const auto elevation =
      static_cast<float>(glm::radians(std::clamp(options.elevation, -89.9, 89.9)));
  const glm::vec3 back(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                       std::cos(azimuth) * std::cos(elevation));
  const glm::vec3 right = glm::normalize(glm::cross(glm::vec3(0, 1, 0), back));
  return {right, glm::cross(back, right), back};
}

void addCorners(const Box& box, std::vector<glm::vec3>& corners) {
  for (int corner = 0; corner < 8; ++corner) {
    corners.emplace_back((corner & 1) != 0 ? box.max[0] : box.min[0],
                         (corner & 2) != 0 ? box.max[1] : box.min[1],
                         (corner & 4) != 0 ? box.max[2] : box.min[2]);
  }
}

/// Where along one axis of the picture the eye stands, and how far away, so that every point is
/// between the two borders: |x - centre| <= slope · (distance - z).
struct Fit {
  float centre = 0, distance = 0;
};

Fit fitPerspective(std::span<const glm::vec2> points, float slope) {
  // x - slope·z at its largest touches the one border, -x - slope·z the other.
  float high = std::numeric_limits<float>::lowest(), low = high;
  for (const glm::vec2& point : points) {
    high = std::max(high, point.x + slope * point.y);
    low = std::max(low, -point.x + slope * point.y);
  }
  return {(high - low) / 2, (high + low) / (2 * slope)};
}

Fit fitOrthographic(std::span<const glm::vec2> points) {
  float high = std::numeric_limits<float>::lowest(), low = high;
  for (const glm::vec2& point : points) {
    high = std::max(high, point.x);
    low = std::max(low, -point.x);
  }
  return {(high - low) / 2, (high + low) / 2};
}

}  // namespace

Box unite(std::span<const Box> boxes) {
  Box all;
  if (!boxes.empty()) all = boxes.front();
  for (const Box& box : boxes) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      all.min[axis] = std::min(all.min[axis], box.min[axis]);
      all.max[axis] = std::max(all.max[axis], box.max[axis]);
    }
  }
  return all;
}

glm::vec3 centreOf(const Box& box) {
  return (glm::vec3(box.min[0], box.min[1], box.min[2]) +
          glm::vec3(box.max[0], box.max[1], box.max[2])) *
         0.5f;
}

float radiusOf(const Box& box) {
  const glm::vec3 side(box.max[0] - box.min[0], box.max[1] - box.min[1], box.max[2] - box.min[2]);
  return std::max(glm::length(side) * 0.5f, 1e-6f);
}

Camera frameBoxes(std::span<const Box> boxes, const Box& depth, const CameraOptions& options,
                  float aspect) {
  const Axes axes = axesOf(options);
  const Box all = unite(boxes);
  const glm::vec3 target = centreOf(all);
  const float radius = radiusOf(all);
  std::vector<glm::vec3> corners;
  for (const Box& box : boxes) addCorners(box, corners);
  std::vector<glm::vec2> horizontal, vertical;
  for (const glm::vec3& corner : corners) {
    const glm::vec3 from = corner - target;
    const float z = glm::dot(from, axes.back);
    horizontal.emplace_back(glm::dot(from, axes.right), z);
    vertical.emplace_back(glm::dot(from, axes.up), z);
  }
  const float used = 1 - 2 * static_cast<float>(options.margin);
  const float slope = std::tan(static_cast<float>(glm::radians(options.fieldOfView)) / 2);

  Fit across, along;
  if (options.isOrthographic) {
    across = fitOrthographic(horizontal);
    along = fitOrthographic(vertical);
  } else {
    across = fitPerspective(horizontal, slope * aspect * used);
    along = fitPerspective(vertical, slope * used);
  }
  const glm::vec3 middle = target + axes.right * across.centre + axes.up * along.centre;
  const float halfHeight =
      std::max({across.distance / aspect, along.distance, radius * 1e-3f}) / used;
  const float distance = options.isOrthographic
                             ? 4 * radius
                             : std::max({across.distance, along.distance, radius * 1e-3f});

  Camera camera;
  camera.isOrthographic = options.isOrthographic;
  camera.towardsEye = axes.back;
  camera.right = axes.right;
  camera.distance = distance;
  camera.eye = middle + axes.back * distance;
  std::vector<glm::vec3> visible = corners;
  addCorners(depth, visible);
  float farthest = 0, nearest = std::numeric_limits<float>::max();
  for (const glm::vec3& corner : visible)
    farthest = std::max(farthest, glm::dot(camera.eye - corner, axes.back));
  for (const glm::vec3& corner : corners)
    nearest = std::min(nearest, glm::dot(camera.eye - corner, axes.back));
  const glm::mat4 view = glm::lookAtRH(camera.eye, middle, axes.up);
  glm::mat4 projection;
  if (options.isOrthographic) {
    const float reach = 2 * std::max(farthest, radius);
    projection = glm::orthoRH_ZO(-halfHeight * aspect, halfHeight * aspect, -halfHeight, halfHeight,
                                 -reach, reach);
  } else {
    const float nearPlane = std::max(nearest * 0.5f, farthest * 1e-3f);
    projection = glm::perspectiveRH_ZO(2 * std::atan(slope), aspect, nearPlane,
                                       std::max(farthest * 1.1f, nearPlane * 2));
  }
  projection[1][1] *= -1;  // Vulkan's y goes down.
  camera.viewProjection = projection * view;
  return camera;
}

}  // namespace dermis::samples::render
