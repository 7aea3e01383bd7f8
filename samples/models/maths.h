// Mathematics whose every bit is the same on every machine.
//
// The sample models are pinned by a hash of their bytes, so nothing here calls the transcendental
// functions of the C library, whose last bits differ between versions: only + − × ÷ and the square
// root, which IEEE 754 rounds exactly (with -ffp-contract=off, which dermis_configure_target sets).
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

// 0 below `low`, 1 above `high`, a cubic with level ends between.
double smoothStep(double low, double high, double value);

double lerp(double from, double to, double fraction);

// `vector` at length 1; it must not be zero.
Vec3 unit(const Vec3& vector);

// The part of `vector` at right angles to the unit vector `direction`.
Vec3 perpendicular(const Vec3& vector, const Vec3& direction);

// A turn about the unit vector `axis`, counter-clockwise where the axis points at the viewer.
Quat turn(const Vec3& axis, double radians);

// The shortest turn that takes one unit vector to another. They must not be opposite.
Quat turnBetween(const Vec3& from, const Vec3& to);

}  // namespace dermis::models
