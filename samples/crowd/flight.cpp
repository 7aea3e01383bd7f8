#include "flight.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <glm/ext/matrix_clip_space.hpp>
#include <glm/ext/matrix_transform.hpp>
#include <glm/vec3.hpp>

using namespace dermis;

namespace crowd {
namespace {

using Vector = std::array<double, 3>;

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

Vector plus(const Vector& a, const Vector& b, double share) {
  return {a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]};
}

double dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Vector normalized(const Vector& a) {
  return plus({}, a, 1 / std::sqrt(dot(a, a)));
}

/// Catmull and Rom 1974: a smooth curve through all points.
double spline(const std::array<double, 4>& p, double t) {
  return p[1] +
         0.5 * t *
             (p[2] - p[0] +
              t * (2 * p[0] - 5 * p[1] + 4 * p[2] - p[3] + t * (3 * (p[1] - p[2]) + p[3] - p[0])));
}

/// Interpolates a member of the keys at a time. `turn` is its increase over a whole flight.
double along(double Key::*member, double time, double turn = 0) {
  const double place = time / Flight::seconds * static_cast<double>(keys.size());
  const double first = std::floor(place);
  std::array<double, 4> points{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto index = static_cast<std::ptrdiff_t>(first) + static_cast<std::ptrdiff_t>(i) - 1;
    const auto count = static_cast<std::ptrdiff_t>(keys.size());
    const std::ptrdiff_t lap = index < 0 ? (index + 1) / count - 1 : index / count;
    points[i] = keys[static_cast<std::size_t>(index - lap * count)].*member +
                turn * static_cast<double>(lap);
  }
  return spline(points, place - first);
}

Vector onCylinder(double degrees, double radius, double height) {
  const double angle = degrees * std::numbers::pi / 180;
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
  const Vector target =
      onCylinder(along(&Key::lookAngle, time, 360), radiusOf(along(&Key::lookRadius, time)),
                 along(&Key::lookHeight, time) * plan_.unit);
  eye.forward = normalized(plus(target, eye.place, -1));
  eye.right = normalized(cross(eye.forward, {0, 1, 0}));
  eye.up = cross(eye.right, eye.forward);
  eye.slope = std::tan(21 * std::numbers::pi / 180);
  return eye;
}

samples::render::Camera Flight::camera(const Eye& eye) const {
  const auto vector = [](const Vector& from) { return glm::vec3(from[0], from[1], from[2]); };
  samples::render::Camera camera;
  camera.eye = vector(eye.place);
  camera.towardsEye = -vector(eye.forward);
  camera.right = vector(eye.right);
  const auto nearest = static_cast<float>(0.15 * plan_.unit);
  const auto farthest = static_cast<float>(8 * plan_.crowdRadius + 50 * plan_.unit);
  glm::mat4 projection = glm::perspectiveRH_ZO(2 * std::atan(static_cast<float>(eye.slope)),
                                               static_cast<float>(plan_.aspect), nearest, farthest);
  projection[1][1] *= -1;  // Vulkan's y goes down.
  camera.viewProjection =
      projection * glm::lookAtRH(camera.eye, camera.eye - camera.towardsEye, vector(eye.up));
  return camera;
}

bool Flight::sees(const Eye& eye, const Vector& center, double radius) const {
  const Vector from = plus(center, eye.place, -1);
  const double ahead = dot(from, eye.forward);
  if (ahead < -radius) return false;
  const auto isWithin = [&](const Vector& axis, double slope) {
    return std::abs(dot(from, axis)) <= ahead * slope + radius * std::sqrt(1 + slope * slope);
  };
  return isWithin(eye.right, eye.slope * plan_.aspect) && isWithin(eye.up, eye.slope);
}

double Flight::pixelSize(const Eye& eye, double distance) const {
  return 2 * eye.slope * distance / plan_.height;
}

}  // namespace crowd
