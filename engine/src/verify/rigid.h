// Rigid transforms as dual quaternions, for the reference. It does not use GLM's quaternions: an
// engine may change their layout by a macro.
#pragma once

#include <limits>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

namespace dermis::reference {

/// As an error bound: the error may be anything.
inline constexpr double unbounded = std::numeric_limits<double>::infinity();

/// real + ε dual, each x y z w. Also represents a logarithm, which has no scalar parts.
struct Rigid {
  glm::dvec4 real{0, 0, 0, 1};
  glm::dvec4 dual{0, 0, 0, 0};
};

Rigid operator*(const Rigid& a, const Rigid& b);
Rigid operator*(const Rigid& a, double factor);
Rigid operator+(const Rigid& a, const Rigid& b);
Rigid operator-(const Rigid& a);

/// d = ½ (t, 0) q, for a unit quaternion q.
Rigid rigidOf(const glm::dvec4& rotation, const glm::dvec3& translation);
/// The inverse of a unit dual quaternion.
Rigid conjugate(const Rigid& a);
/// Makes the real part unit length, and the dual part orthogonal to it.
Rigid normalize(const Rigid& a);

/// 2 vec(d q*) / |q|².
glm::dvec3 translationOf(const Rigid& a);
/// Rotates by a unit quaternion.
glm::dvec3 rotate(const glm::dvec4& rotation, const glm::dvec3& v);
/// Transforms by a dual quaternion whose real part has unit length.
glm::dvec3 transformPoint(const Rigid& a, const glm::dvec3& point);
glm::dmat3 matrixOf(const glm::dvec4& rotation);

/// `real`: half the angle times the direction of the screw axis. `dual`: half the distance along
/// the axis times its direction, plus half the angle times its moment. The dual quaternion must
/// have unit length. Kavan et al. 2008, appendix.
Rigid log(const Rigid& a);
/// The inverse of `log`.
Rigid exp(const Rigid& screw);

}  // namespace dermis::reference
