#include "flight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <glm/ext/matrix_clip_space.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

using namespace dermis;

namespace crowd_film {
namespace {

constexpr double fieldOfView = 42;  ///< degrees, vertical

/// A key of the camera flight in cylindrical coordinates: degrees about the middle, and the
/// distance from it (0 the middle, 1 the aisle, 2 the outermost ring). Heights are in meters, for a
/// figure of 1.75 m.
struct Key {
  double angle, radius, height;
  double lookAngle, lookRadius, lookHeight;
};

/// Evenly spaced in time. Angles make one full turn.
constexpr std::array keys{
    Key{20, 2.00, 4.2, 20, 0.85, 0.4},     // over the last rows, all of the crowd ahead
    Key{48, 1.62, 3.1, 60, 0.75, 0.2},     // low over heads
    Key{80, 1.12, 2.1, 120, 1.05, 0.85},   // down into the aisle
    Key{112, 1.00, 1.5, 156, 1.12, 1.05},  // walking figures pass by
    Key{144, 1.00, 1.5, 186, 0.95, 1.05}, Key{180, 1.10, 2.3, 220, 1.10, 0.6},
    Key{224, 1.70, 6.5, 260, 0.95, 0.0},  // up, looking back over the rings
    Key{280, 2.12, 13.0, 288, 0.45, 0.0}, Key{336, 2.18, 9.0, 340, 0.65, 0.0},
};

/// Catmull and Rom 1974: a smooth curve through all points.
double spline(const std::array<double, 4>& p, double t) {
  return p[1] +
         0.5 * t *
             (p[2] - p[0] +
              t * (2 * p[0] - 5 * p[1] + 4 * p[2] - p[3] + t * (3 * (p[1] - p[2]) + p[3] - p[0])));
}

/// Interpolates a member of the keys at a time, which is not negative. `turn` is its increase over
/// a whole flight.
double along(double Key::*member, double time, double turn = 0) {
  const double place = time / Flight::seconds * static_cast<double>(keys.size());
  const double first = std::floor(place);
  std::array<double, 4> points{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    // One flight later, so that no index is negative.
    const std::size_t index = static_cast<std::size_t>(first) + i + keys.size() - 1;
    const double lap = static_cast<double>(index / keys.size()) - 1;
    points[i] = keys[index % keys.size()].*member + turn * lap;
  }
  return spline(points, place - first);
}

glm::dvec3 onCylinder(double degrees, double radius, double height) {
  const double angle = glm::radians(degrees);
  return {radius * std::cos(angle), height, radius * std::sin(angle)};
}

/// A smooth maximum: rounded where both are nearly equal.
double smoothMax(double a, double b, double width) {
  const double near = std::max(width - std::abs(a - b), 0.0) / width;
  return std::max(a, b) + near * near * width * 0.25;
}

}  // namespace

/// Minimum height of the camera at this radius: above all heads, but at eye level in the aisle.
double Flight::clearance(double radius) const {
  const double aside = std::abs(radius - plan_.aisleRadius) / plan_.unit;
  const double t = std::clamp((aside - 0.35) / (1.3 - 0.35), 0.0, 1.0);
  return (1.45 + 1.0 * t * t * (3 - 2 * t)) * plan_.unit;
}

Eye Flight::at(double time) const {
  const auto radiusOf = [&](double place) {
    return place < 1 ? place * plan_.aisleRadius
                     : plan_.aisleRadius + (place - 1) * (plan_.crowdRadius - plan_.aisleRadius);
  };
  // The camera flies lower over a smaller crowd.
  const double scale = std::clamp(plan_.crowdRadius / (24 * plan_.unit), 0.45, 3.0);
  const double radius = radiusOf(along(&Key::radius, time));
  const double wanted = along(&Key::height, time);
  const double height = (wanted > 2.5 ? 2.5 + (wanted - 2.5) * scale : wanted) * plan_.unit;
  Eye eye;
  eye.place = onCylinder(along(&Key::angle, time, 360), radius,
                         smoothMax(height, clearance(radius), 0.5 * plan_.unit));
  const glm::dvec3 target =
      onCylinder(along(&Key::lookAngle, time, 360), radiusOf(along(&Key::lookRadius, time)),
                 along(&Key::lookHeight, time) * plan_.unit);
  eye.forward = glm::normalize(target - eye.place);
  eye.right = glm::normalize(glm::cross(eye.forward, {0, 1, 0}));
  eye.up = glm::cross(eye.right, eye.forward);
  return eye;
}

samples::render::Camera Flight::camera(const Eye& eye) const {
  samples::render::Camera camera;
  camera.eye = glm::vec3(eye.place);
  camera.towardsEye = glm::vec3(-eye.forward);
  camera.right = glm::vec3(eye.right);
  const auto nearest = static_cast<float>(0.15 * plan_.unit);
  const auto farthest = static_cast<float>(8 * plan_.crowdRadius + 50 * plan_.unit);
  glm::mat4 projection = glm::perspectiveRH_ZO(static_cast<float>(glm::radians(fieldOfView)),
                                               static_cast<float>(plan_.aspect), nearest, farthest);
  projection[1][1] *= -1;  // Vulkan's y goes down.
  camera.viewProjection =
      projection * glm::lookAtRH(camera.eye, camera.eye - camera.towardsEye, glm::vec3(eye.up));
  return camera;
}

bool Flight::sees(const Eye& eye, const glm::dvec3& center, double radius) const {
  const glm::dvec3 from = center - eye.place;
  const double ahead = glm::dot(from, eye.forward);
  if (ahead < -radius) return false;
  const auto isWithin = [&](const glm::dvec3& axis, double slope) {
    return std::abs(glm::dot(from, axis)) <= ahead * slope + radius * std::sqrt(1 + slope * slope);
  };
  const double slope = std::tan(glm::radians(fieldOfView / 2));
  return isWithin(eye.right, slope * plan_.aspect) && isWithin(eye.up, slope);
}

double Flight::pixelSize(double distance) const {
  return 2 * std::tan(glm::radians(fieldOfView / 2)) * distance / plan_.height;
}

}  // namespace crowd_film
