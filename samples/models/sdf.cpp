#include "sdf.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace dermis::models {
namespace {

double ellipsoidDistance(const Vec3& local, const Vec3& radii) {
  const Vec3 scaled = local / radii;
  const double inUnits = std::sqrt(glm::dot(scaled, scaled));
  const Vec3 twice = scaled / radii;
  const double slope = std::sqrt(glm::dot(twice, twice));
  if (slope < 1e-9) return -std::min({radii.x, radii.y, radii.z});
  return inUnits * (inUnits - 1.0) / slope;
}

double sign(double value) {
  return value > 0.0 ? 1.0 : (value < 0.0 ? -1.0 : 0.0);
}

}  // namespace

Solid sphere(const Vec3& center, double radius) {
  return {[=](const Vec3& point) {
            const Vec3 local = point - center;
            return std::sqrt(glm::dot(local, local)) - radius;
          },
          {center, radius}};
}

Solid ellipsoid(const Vec3& center, const Vec3& radii) {
  return {[=](const Vec3& point) { return ellipsoidDistance(point - center, radii); },
          {center, std::max({radii.x, radii.y, radii.z})}};
}

Solid ellipsoid(const Vec3& center, const Vec3& radii, const Vec3& x, const Vec3& y,
                const Vec3& z) {
  return {[=](const Vec3& point) {
            const Vec3 local = point - center;
            return ellipsoidDistance({glm::dot(local, x), glm::dot(local, y), glm::dot(local, z)},
                                     radii);
          },
          {center, std::max({radii.x, radii.y, radii.z})}};
}

Solid roundCone(const Vec3& from, const Vec3& to, double fromRadius, double toRadius) {
  const Vec3 axis = to - from;
  const double l2 = glm::dot(axis, axis);
  const double rr = fromRadius - toRadius;
  const double a2 = l2 - rr * rr;
  const double il2 = 1.0 / l2;
  const auto field = [=](const Vec3& point) {
    const Vec3 pa = point - from;
    const double y = glm::dot(pa, axis);
    const double z = y - l2;
    const Vec3 across = pa * l2 - axis * y;
    const double x2 = glm::dot(across, across);
    const double y2 = y * y * l2;
    const double z2 = z * z * l2;
    const double k = sign(rr) * rr * rr * x2;
    if (sign(z) * a2 * z2 > k) return std::sqrt(x2 + z2) * il2 - toRadius;
    if (sign(y) * a2 * y2 < k) return std::sqrt(x2 + y2) * il2 - fromRadius;
    return (std::sqrt(x2 * a2 * il2) + y * rr) * il2 - fromRadius;
  };
  return {field, {(from + to) * 0.5, 0.5 * std::sqrt(l2) + std::max(fromRadius, toRadius)}};
}

Solid mirrored(const Solid& solid) {
  const Field field = solid.field;
  const Vec3& center = solid.bound.center;
  return {[field](const Vec3& point) {
            return field({-point.x, point.y, point.z});
          },
          {{-center.x, center.y, center.z}, solid.bound.radius}};
}

double smoothMinimum(double a, double b, double blend) {
  const double h = std::max(blend - std::abs(a - b), 0.0);
  if (h <= 0.0) return std::min(a, b);
  return std::min(a, b) - h * h * h / (6.0 * blend * blend);
}

double smoothMaximum(double a, double b, double blend) {
  return -smoothMinimum(-a, -b, blend);
}

void Shape::add(const Solid& solid, double blend) {
  parts_.push_back({solid, blend, false});
}

void Shape::addPair(const Solid& solid, double blend) {
  add(solid, blend);
  add(mirrored(solid), blend);
}

void Shape::carve(const Solid& solid, double blend) {
  parts_.push_back({solid, blend, true});
}

double Shape::distance(const Vec3& point) const {
  double distance = 1e3;
  for (const Part& part : parts_) {
    const Vec3 local = point - part.solid.bound.center;
    const double atLeast = std::sqrt(glm::dot(local, local)) - part.solid.bound.radius;
    if (part.isCarved) {
      if (-atLeast <= distance - part.blend) continue;
      distance = smoothMaximum(distance, -part.solid.field(point), part.blend);
    } else {
      if (atLeast >= distance + part.blend) continue;
      distance = smoothMinimum(distance, part.solid.field(point), part.blend);
    }
  }
  return distance;
}

Vec3 gradient(const Field& field, const Vec3& point, double step) {
  const Vec3 x(step, 0.0, 0.0);
  const Vec3 y(0.0, step, 0.0);
  const Vec3 z(0.0, 0.0, step);
  return Vec3(field(point + x) - field(point - x), field(point + y) - field(point - y),
              field(point + z) - field(point - z)) /
         (2.0 * step);
}

}  // namespace dermis::models
