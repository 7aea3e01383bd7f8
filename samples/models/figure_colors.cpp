// Clothes, skin and hair.
#include <cmath>
#include <glm/geometric.hpp>

#include "arm_shape.h"
#include "figure.h"

namespace dermis::models {
namespace {

enum Region : std::size_t { skin, hair, shirt, trousers, shoes, soles, eyes };

bool isHair(const Vec3& point) {
  const bool isEar = point.x > 0.0770 && point.y < 1.665;
  // The hairline rises from the nape past the ear to the forehead.
  return !isEar && point.y > lerp(1.575, 1.706, smoothStep(-0.075, 0.065, point.z));
}

bool isEye(const Vec3& point) {
  const double across = (point.x - 0.0315) / 0.0135;
  const double up = (point.y - 1.6425) / 0.0075;
  return point.z > 0.03 && across * across + up * up < 1.0;
}

// The region of a point with x ≥ 0.
Region regionOfLeft(const Vec3& point, const FigureShape& shape) {
  const double along = leftArmFrame().toLocal(point).y;
  if (along > 0.02 && shape.leftArm.distance(point) < shape.trunk.distance(point)) {
    return along < 0.175 ? shirt : skin;
  }
  if (point.y < 0.017) return soles;
  if (point.y < 0.096) return shoes;
  if (point.y < 0.985) return trousers;
  // The neckline is where a ball about the neck leaves the shoulders.
  const Vec3 fromNeck = (point - Vec3(0.0, 1.505, -0.012)) / Vec3(0.104, 0.090, 0.100);
  const bool isUnderChin = point.y < 1.53 - 0.45 * std::fmax(point.z, 0.0);
  if (isUnderChin && glm::dot(fromNeck, fromNeck) > 1.0) return shirt;
  if (isEye(point)) return eyes;
  return isHair(point) ? hair : skin;
}

}  // namespace

const std::vector<Vec3>& figureColors() {
  // Linear red, green, blue, in the order of Region.
  static const std::vector<Vec3> colors = {
      {0.610, 0.340, 0.230}, {0.050, 0.028, 0.017}, {0.060, 0.215, 0.330}, {0.070, 0.066, 0.070},
      {0.185, 0.075, 0.035}, {0.560, 0.530, 0.480}, {0.085, 0.048, 0.037}};
  return colors;
}

std::vector<Part> figureParts() {
  return {{"body", {skin, eyes}},
          {"hair", {hair}},
          {"shirt", {shirt}},
          {"trousers", {trousers}},
          {"shoes", {shoes, soles}}};
}

RegionAt figureRegions(const FigureShape& shape) {
  return [&shape](const Vec3& point) {
    return static_cast<std::size_t>(regionOfLeft({std::abs(point.x), point.y, point.z}, shape));
  };
}

}  // namespace dermis::models
