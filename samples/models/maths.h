// Mathematics with the same bits on every machine.
//
// Tests compare the sample models with a hash of their bytes. The transcendental functions of C
// libraries differ in their last bits, so nothing here calls them. The functions here use only
// + − × ÷ and the square root, which IEEE 754 rounds correctly (with -ffp-contract=off, which
// dermis_configure_target sets).
#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

namespace dermis::models {

using Vec3 = glm::dvec3;
using Quat = glm::dquat;

inline constexpr double pi = 3.14159265358979323846;
inline constexpr double degree = pi / 180.0;

double sine(double radians);
double cosine(double radians);

// 0 below `low`, 1 above `high`, and a cubic with slope 0 at both ends in between.
double smoothStep(double low, double high, double value);

double lerp(double from, double to, double fraction);

// `vector` with length 1. It must not be zero.
Vec3 unit(const Vec3& vector);

// The component of `vector` orthogonal to the unit vector `direction`.
Vec3 perpendicular(const Vec3& vector, const Vec3& direction);

// A rotation about the unit vector `axis`, counterclockwise if the axis points at the viewer.
Quat turn(const Vec3& axis, double radians);

// The shortest rotation from one unit vector to another. They must not be opposite.
Quat turnBetween(const Vec3& from, const Vec3& to);

}  // namespace dermis::models
