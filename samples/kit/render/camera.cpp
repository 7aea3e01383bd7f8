#include "kit/render/camera.h"

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
  // At a pole, the direction to the right would be undefined.
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

/// The smallest distance of the eye for which there is a `center` with |x - center| <=
/// slope · (distance - z) for every point (x, z).
float fittingDistance(std::span<const glm::vec2> points, float slope) {
  // One border is determined by the largest x + slope·z, the other by the largest -x + slope·z.
  float high = std::numeric_limits<float>::lowest(), low = high;
  for (const glm::vec2& point : points) {
    high = std::max(high, point.x + slope * point.y);
    low = std::max(low, -point.x + slope * point.y);
  }
  return (high + low) / (2 * slope);
}

/// The position of the eye for which both borders are equally far from the points. Moving the eye
/// to one side increases the distance on the other, so the position is found by bisection.
float middle(std::span<const glm::vec2> points, float distance, bool isOrthographic) {
  float low = std::numeric_limits<float>::max(), high = -low;
  for (const glm::vec2& point : points) {
    low = std::min(low, point.x);
    high = std::max(high, point.x);
  }
  for (int step = 0; step < 40; ++step) {
    const float center = (low + high) / 2;
    float left = 0, right = 0;
    for (const glm::vec2& point : points) {
      const float place = (point.x - center) / (isOrthographic ? 1 : distance - point.y);
      left = std::max(left, -place);
      right = std::max(right, place);
    }
    (right > left ? low : high) = center;
  }
  return (low + high) / 2;
}

float halfWidth(std::span<const glm::vec2> points, float center) {
  float width = 0;
  for (const glm::vec2& point : points) width = std::max(width, std::abs(point.x - center));
  return width;
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

glm::vec3 centerOf(const Box& box) {
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
  const glm::vec3 target = centerOf(all);
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

  float distance = 4 * radius;
  if (!options.isOrthographic) {
    distance = std::max({fittingDistance(horizontal, slope * aspect * used),
                         fittingDistance(vertical, slope * used), radius * 1e-3f});
  }
  const float across = middle(horizontal, distance, options.isOrthographic);
  const float along = middle(vertical, distance, options.isOrthographic);
  const glm::vec3 lookedAt = target + axes.right * across + axes.up * along;
  const float halfHeight = std::max({halfWidth(horizontal, across) / aspect,
                                     halfWidth(vertical, along), radius * 1e-3f}) /
                           used;

  Camera camera;
  camera.isOrthographic = options.isOrthographic;
  camera.towardsEye = axes.back;
  camera.right = axes.right;
  camera.distance = distance;
  camera.eye = lookedAt + axes.back * distance;
  std::vector<glm::vec3> visible = corners;
  addCorners(depth, visible);
  float farthest = 0, nearest = std::numeric_limits<float>::max();
  for (const glm::vec3& corner : visible)
    farthest = std::max(farthest, glm::dot(camera.eye - corner, axes.back));
  for (const glm::vec3& corner : corners)
    nearest = std::min(nearest, glm::dot(camera.eye - corner, axes.back));
  const glm::mat4 view = glm::lookAtRH(camera.eye, lookedAt, axes.up);
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
