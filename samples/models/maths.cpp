#include "maths.h"

#include <cmath>
#include <glm/geometric.hpp>

namespace dermis::models {
namespace {

// Taylor series on ±π/4: the first term left out is below 1e-17.
double sineSmall(double x) {
  const double s = x * x;
  double sum = 1.0;
  for (int n = 16; n >= 2; n -= 2) sum = 1.0 - s / static_cast<double>(n * (n + 1)) * sum;
  return x * sum;
}

double cosineSmall(double x) {
  const double s = x * x;
  double sum = 1.0;
  for (int n = 17; n >= 1; n -= 2) sum = 1.0 - s / static_cast<double>(n * (n + 1)) * sum;
  return sum;
}

}  // namespace

double sine(double radians) {
  const double quarters = std::floor(radians / (0.5 * pi) + 0.5);
  const double rest = radians - quarters * (0.5 * pi);
  const double turns = quarters - 4.0 * std::floor(quarters / 4.0);
  if (turns < 0.5) return sineSmall(rest);
  if (turns < 1.5) return cosineSmall(rest);
  if (turns < 2.5) return -sineSmall(rest);
  return -cosineSmall(rest);
}

double cosine(double radians) {
  return sine(radians + 0.5 * pi);
}

double smoothStep(double low, double high, double value) {
  const double t = std::fmin(std::fmax((value - low) / (high - low), 0.0), 1.0);
  return t * t * (3.0 - 2.0 * t);
}

double lerp(double from, double to, double fraction) {
  return from + (to - from) * fraction;
}

Vec3 unit(const Vec3& vector) {
  return vector / std::sqrt(glm::dot(vector, vector));
}

Vec3 perpendicular(const Vec3& vector, const Vec3& direction) {
  return vector - direction * glm::dot(vector, direction);
}

Quat turn(const Vec3& axis, double radians) {
  const double s = sine(0.5 * radians);
  return Quat(cosine(0.5 * radians), axis.x * s, axis.y * s, axis.z * s);
}

Quat turnBetween(const Vec3& from, const Vec3& to) {
  const Vec3 axis = glm::cross(from, to);
  const double w = 1.0 + glm::dot(from, to);
  const double length = std::sqrt(w * w + glm::dot(axis, axis));
  return Quat(w / length, axis.x / length, axis.y / length, axis.z / length);
}

}  // namespace dermis::models
