// Unit dual quaternions on GLM: the mathematics, for any use. Quaternions are Hamilton's; a dual
// quaternion is q + ε d.
//
// Source: Kavan, Collins, Žára, O'Sullivan 2007, "Skinning with Dual Quaternions", and the appendix
// on the exponential and the logarithm in Kavan et al. 2008, "Geometric Skinning with Approximate
// Dual Quaternion Blending".
#pragma once

#include <cmath>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x3.hpp>
#include <glm/vec3.hpp>

namespace dermis::test {

/// A dual quaternion real + ε dual. It is a rigid transform where |real| = 1 and real · dual = 0;
/// then q and -q are the same transform.
struct DualQuatd {
  glm::dquat real{1, 0, 0, 0};
  glm::dquat dual{0, 0, 0, 0};
};

/// A rigid transform as rotation (unit quaternion) and translation: d = ½ (0, t) q.
inline DualQuatd fromRotationTranslation(const glm::dquat& rotation,
                                         const glm::dvec3& translation) {
  const glm::dquat t(0, translation.x, translation.y, translation.z);
  return {rotation, (t * rotation) * 0.5};
}

/// A rigid transform from its 3×4 matrix (GLM: four columns of three). The 3×3 must be a rotation;
/// scale or shear in it is not noticed and distorts the result: decompose such a matrix first.
inline DualQuatd fromRigidMatrix(const glm::dmat4x3& matrix) {
  const glm::dmat3 rotation(matrix[0], matrix[1], matrix[2]);
  return fromRotationTranslation(glm::normalize(glm::quat_cast(rotation)), glm::dvec3(matrix[3]));
}

/// The translation of a transform whose real part may be of any length but 0: 2 vec(d q*) / |q|².
/// (Dividing by |q| instead is a slip of a well-known listing.)
inline glm::dvec3 translationOf(const DualQuatd& q) {
  const glm::dquat t = q.dual * glm::conjugate(q.real);
  return glm::dvec3(t.x, t.y, t.z) * (2 / glm::dot(q.real, q.real));
}

/// The 3×4 matrix of a transform whose real part may be of any length but 0.
inline glm::dmat4x3 toMatrix(const DualQuatd& q) {
  const glm::dmat3 rotation = glm::mat3_cast(glm::normalize(q.real));
  return glm::dmat4x3(rotation[0], rotation[1], rotation[2], translationOf(q));
}

inline DualQuatd operator*(const DualQuatd& a, const DualQuatd& b) {
  return {a.real * b.real, a.real * b.dual + a.dual * b.real};
}
inline DualQuatd operator*(const DualQuatd& a, double scalar) {
  return {a.real * scalar, a.dual * scalar};
}
inline DualQuatd operator+(const DualQuatd& a, const DualQuatd& b) {
  return {a.real + b.real, a.dual + b.dual};
}
inline DualQuatd operator-(const DualQuatd& a) {
  return {-a.real, -a.dual};
}

/// The quaternion conjugate of both parts: the inverse of a unit dual quaternion.
inline DualQuatd conjugate(const DualQuatd& q) {
  return {glm::conjugate(q.real), glm::conjugate(q.dual)};
}

/// Both parts divided by |real|, and the dual part made orthogonal to the real one: d ← d − (q · d)
/// q. The orthogonal part moves no point, but `log` and products need it.
inline DualQuatd normalize(const DualQuatd& q) {
  const double inverse = 1 / std::sqrt(glm::dot(q.real, q.real));
  const glm::dquat real = q.real * inverse;
  const glm::dquat dual = q.dual * inverse;
  return {real, dual - real * glm::dot(real, dual)};
}

/// p moved by q: v + 2 r × (r × v + w v) + 2 (w d_v − d_w r + r × d_v), r and w the vector and
/// scalar of the real part, which must be of unit length. The component of the dual part along the
/// real part moves no point.
inline glm::dvec3 transformPoint(const DualQuatd& q, const glm::dvec3& v) {
  const glm::dvec3 r(q.real.x, q.real.y, q.real.z);
  const glm::dvec3 d(q.dual.x, q.dual.y, q.dual.z);
  return v + 2.0 * glm::cross(r, glm::cross(r, v) + q.real.w * v) +
         2.0 * (q.real.w * d - q.dual.w * r + glm::cross(r, d));
}

/// The logarithm of a unit dual quaternion: half the angle and half the way along the screw axis,
/// as a pure dual quaternion (both scalars 0). q must be truly unit (`normalize`). The angle lies
/// between 0 and 2π; where the same transform is wanted the short way round, negate a q with a
/// negative scalar first.
inline DualQuatd log(const DualQuatd& q) {
  const glm::dvec3 r(q.real.x, q.real.y, q.real.z);
  const glm::dvec3 d(q.dual.x, q.dual.y, q.dual.z);
  const double sine = std::sqrt(glm::dot(r, r));
  const double half = std::atan2(sine, q.real.w);
  if (sine == 0) {
    // No rotation, or a full turn whose axis is lost: -q then is the same translation.
    const glm::dvec3 dual = q.real.w < 0 ? -d : d;
    return {glm::dquat(0, 0, 0, 0), glm::dquat(0, dual.x, dual.y, dual.z)};
  }
  // The real part is (half / sine) r. Its derivative along ε gives the dual part, with
  // d(half) = -d_w / sine and d(sine) = r · d / sine = -w d_w / sine from the unit condition.
  const double factor = half / sine;
  // (1 - half cot(half)) / sine²; the series near 0, where the difference would cancel
  double slope;
  if (half < 0.1) {
    const double h2 = half * half;
    slope = (1 / 3.0 + h2 * (1 / 45.0 + h2 * (2 / 945.0 + h2 / 4725))) * factor * factor;
  } else {
    slope = (1 - factor * q.real.w) / (sine * sine);
  }
  const glm::dvec3 real = factor * r;
  const glm::dvec3 dual = factor * d - (slope * q.dual.w) * r;
  return {glm::dquat(0, real.x, real.y, real.z), glm::dquat(0, dual.x, dual.y, dual.z)};
}

/// The exponential of a pure dual quaternion (both scalars 0): the inverse of `log`.
inline DualQuatd exp(const DualQuatd& q) {
  const glm::dvec3 r(q.real.x, q.real.y, q.real.z);
  const glm::dvec3 d(q.dual.x, q.dual.y, q.dual.z);
  const double square = glm::dot(r, r);
  const double half = std::sqrt(square);
  double sinc, slope;  // sin(half) / half, and its derivative divided by half
  if (half < 0.1) {    // the series, where the differences below would cancel
    sinc = 1 - square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72)));
    slope = -1 / 3.0 * (1 - square / 10 * (1 - square / 28 * (1 - square / 54)));
  } else {
    sinc = std::sin(half) / half;
    slope = (std::cos(half) - sinc) / square;
  }
  const double along = glm::dot(r, d);
  const glm::dvec3 real = sinc * r;
  const glm::dvec3 dual = sinc * d + slope * along * r;
  return {glm::dquat(std::cos(half), real.x, real.y, real.z),
          glm::dquat(-sinc * along, dual.x, dual.y, dual.z)};
}

/// Screw linear interpolation: a (a* b)^t, the constant-speed screw motion from a to b the short
/// way round. Both must be truly unit.
inline DualQuatd screwInterpolate(const DualQuatd& a, const DualQuatd& b, double t) {
  DualQuatd difference = conjugate(a) * b;
  if (difference.real.w < 0) difference = -difference;
  return a * exp(log(difference) * t);
}

}  // namespace dermis::test
