// Unit dual quaternions on GLM: the mathematics, for any use. Quaternions are Hamilton's; a dual
// quaternion is q + ε d.
//
// Source: Kavan, Collins, Žára, O'Sullivan 2007, "Skinning with Dual Quaternions", and the appendix
// on the exponential and the logarithm in Kavan et al. 2008, "Geometric Skinning with Approximate
// Dual Quaternion Blending".
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x3.hpp>
#include <glm/vec3.hpp>

namespace dermis::test {

/// A dual quaternion real + ε dual. It is a rigid transform where |real| = 1 and real · dual = 0;
/// then q and -q are the same transform.
template <typename T>
struct DualQuat {
  glm::qua<T> real{T(1), T(0), T(0), T(0)};
  glm::qua<T> dual{T(0), T(0), T(0), T(0)};
};

using DualQuatf = DualQuat<float>;
using DualQuatd = DualQuat<double>;

/// A rigid transform as rotation (unit quaternion) and translation: d = ½ (0, t) q.
template <typename T>
DualQuat<T> fromRotationTranslation(const glm::qua<T>& rotation,
                                    const glm::vec<3, T>& translation) {
  const glm::qua<T> t(T(0), translation.x, translation.y, translation.z);
  return {rotation, (t * rotation) * T(0.5)};
}

/// A rigid transform from its 3×4 matrix (GLM: four columns of three). The 3×3 must be a rotation;
/// scale or shear in it is not noticed and distorts the result: decompose such a matrix first.
template <typename T>
DualQuat<T> fromRigidMatrix(const glm::mat<4, 3, T>& matrix) {
  const glm::mat<3, 3, T> rotation(matrix[0], matrix[1], matrix[2]);
  return fromRotationTranslation(glm::normalize(glm::quat_cast(rotation)),
                                 glm::vec<3, T>(matrix[3]));
}

/// The translation of a transform whose real part may be of any length but 0: 2 vec(d q*) / |q|².
/// (Dividing by |q| instead is a slip of a well-known listing.)
template <typename T>
glm::vec<3, T> translationOf(const DualQuat<T>& q) {
  const glm::qua<T> t = q.dual * glm::conjugate(q.real);
  return glm::vec<3, T>(t.x, t.y, t.z) * (T(2) / glm::dot(q.real, q.real));
}

/// The 3×4 matrix of a transform whose real part may be of any length but 0.
template <typename T>
glm::mat<4, 3, T> toMatrix(const DualQuat<T>& q) {
  const glm::mat<3, 3, T> rotation = glm::mat3_cast(glm::normalize(q.real));
  return glm::mat<4, 3, T>(rotation[0], rotation[1], rotation[2], translationOf(q));
}

template <typename T>
DualQuat<T> operator*(const DualQuat<T>& a, const DualQuat<T>& b) {
  return {a.real * b.real, a.real * b.dual + a.dual * b.real};
}
template <typename T>
DualQuat<T> operator*(const DualQuat<T>& a, T scalar) {
  return {a.real * scalar, a.dual * scalar};
}
template <typename T>
DualQuat<T> operator+(const DualQuat<T>& a, const DualQuat<T>& b) {
  return {a.real + b.real, a.dual + b.dual};
}
template <typename T>
DualQuat<T> operator-(const DualQuat<T>& a) {
  return {-a.real, -a.dual};
}

/// The quaternion conjugate of both parts: the inverse of a unit dual quaternion.
template <typename T>
DualQuat<T> conjugate(const DualQuat<T>& q) {
  return {glm::conjugate(q.real), glm::conjugate(q.dual)};
}

/// Both parts divided by |real|, and the dual part made orthogonal to the real one: d ← d − (q · d)
/// q. The orthogonal part moves no point, but `log` and products need it.
template <typename T>
DualQuat<T> normalize(const DualQuat<T>& q) {
  const T inverse = T(1) / std::sqrt(glm::dot(q.real, q.real));
  const glm::qua<T> real = q.real * inverse;
  const glm::qua<T> dual = q.dual * inverse;
  return {real, dual - real * glm::dot(real, dual)};
}

/// p moved by q: v + 2 r × (r × v + w v) + 2 (w d_v − d_w r + r × d_v), r and w the vector and
/// scalar of the real part, which must be of unit length. The component of the dual part along the
/// real part moves no point.
template <typename T>
glm::vec<3, T> transformPoint(const DualQuat<T>& q, const glm::vec<3, T>& v) {
  const glm::vec<3, T> r(q.real.x, q.real.y, q.real.z);
  const glm::vec<3, T> d(q.dual.x, q.dual.y, q.dual.z);
  return v + T(2) * glm::cross(r, glm::cross(r, v) + q.real.w * v) +
         T(2) * (q.real.w * d - q.dual.w * r + glm::cross(r, d));
}

/// v rotated by q, whose real part must be of unit length: for directions.
template <typename T>
glm::vec<3, T> transformVector(const DualQuat<T>& q, const glm::vec<3, T>& v) {
  const glm::vec<3, T> r(q.real.x, q.real.y, q.real.z);
  return v + T(2) * glm::cross(r, glm::cross(r, v) + q.real.w * v);
}

/// The influence of greatest weight; the first of them on a tie, so that with joints in rising
/// order it is the lowest joint. 0 for an empty span.
template <typename T>
std::size_t pivotOf(std::span<const T> weights) {
  std::size_t pivot = 0;
  for (std::size_t i = 1; i < weights.size(); ++i) {
    if (weights[i] > weights[pivot]) pivot = i;
  }
  return pivot;
}

/// Dual-quaternion linear blending (DLB) before normalizing: Σ s_j w_j q_j, s_j = −1 where q_j lies
/// in the other hemisphere than the pivot (a dot product of 0 counts as the same). Weights of 0 are
/// skipped. With weights that sum to 1 the length of its real part is at least the largest weight.
template <typename T>
DualQuat<T> blendUnnormalized(std::span<const DualQuat<T>> transforms, std::span<const T> weights) {
  DualQuat<T> sum{glm::qua<T>(T(0), T(0), T(0), T(0)), glm::qua<T>(T(0), T(0), T(0), T(0))};
  if (transforms.empty()) return {};
  const glm::qua<T> pivot = transforms[pivotOf(weights)].real;
  for (std::size_t i = 0; i < transforms.size(); ++i) {
    if (weights[i] == T(0)) continue;
    const T sign = glm::dot(transforms[i].real, pivot) < T(0) ? T(-1) : T(1);
    sum = sum + transforms[i] * (sign * weights[i]);
  }
  return sum;
}

/// Dual-quaternion linear blending: both parts divided by the length of the real one.
template <typename T>
DualQuat<T> blend(std::span<const DualQuat<T>> transforms, std::span<const T> weights) {
  const DualQuat<T> sum = blendUnnormalized(transforms, weights);
  return sum * (T(1) / std::sqrt(glm::dot(sum.real, sum.real)));
}

/// The logarithm of a unit dual quaternion: half the angle and half the way along the screw axis,
/// as a pure dual quaternion (both scalars 0). q must be truly unit (`normalize`). The angle lies
/// between 0 and 2π; where the same transform is wanted the short way round, negate a q with a
/// negative scalar first.
template <typename T>
DualQuat<T> log(const DualQuat<T>& q) {
  const glm::vec<3, T> r(q.real.x, q.real.y, q.real.z);
  const glm::vec<3, T> d(q.dual.x, q.dual.y, q.dual.z);
  const T sine = std::sqrt(glm::dot(r, r));
  const T half = std::atan2(sine, q.real.w);
  if (sine == T(0)) {
    // No rotation, or a full turn whose axis is lost: -q then is the same translation.
    const glm::vec<3, T> dual = q.real.w < T(0) ? -d : d;
    return {glm::qua<T>(T(0), T(0), T(0), T(0)), glm::qua<T>(T(0), dual.x, dual.y, dual.z)};
  }
  // The real part is (half / sine) r. Its derivative along ε gives the dual part, with
  // d(half) = -d_w / sine and d(sine) = r · d / sine = -w d_w / sine from the unit condition.
  const T factor = half / sine;
  T slope;  // (1 - half cot(half)) / sine²; the series near 0, where the difference would cancel
  if (half < T(0.1)) {
    const T h2 = half * half;
    slope =
        (T(1) / T(3) + h2 * (T(1) / T(45) + h2 * (T(2) / T(945) + h2 / T(4725)))) * factor * factor;
  } else {
    slope = (T(1) - factor * q.real.w) / (sine * sine);
  }
  const glm::vec<3, T> real = factor * r;
  const glm::vec<3, T> dual = factor * d - (slope * q.dual.w) * r;
  return {glm::qua<T>(T(0), real.x, real.y, real.z), glm::qua<T>(T(0), dual.x, dual.y, dual.z)};
}

/// The exponential of a pure dual quaternion (both scalars 0): the inverse of `log`.
template <typename T>
DualQuat<T> exp(const DualQuat<T>& q) {
  const glm::vec<3, T> r(q.real.x, q.real.y, q.real.z);
  const glm::vec<3, T> d(q.dual.x, q.dual.y, q.dual.z);
  const T square = glm::dot(r, r);
  const T half = std::sqrt(square);
  T sinc, slope;        // sin(half) / half, and its derivative divided by half
  if (half < T(0.1)) {  // the series, where the differences below would cancel
    sinc = T(1) - square / T(6) *
                      (T(1) - square / T(20) * (T(1) - square / T(42) * (T(1) - square / T(72))));
    slope =
        -T(1) / T(3) * (T(1) - square / T(10) * (T(1) - square / T(28) * (T(1) - square / T(54))));
  } else {
    sinc = std::sin(half) / half;
    slope = (std::cos(half) - sinc) / square;
  }
  const T along = glm::dot(r, d);
  const glm::vec<3, T> real = sinc * r;
  const glm::vec<3, T> dual = sinc * d + slope * along * r;
  return {glm::qua<T>(std::cos(half), real.x, real.y, real.z),
          glm::qua<T>(-sinc * along, dual.x, dual.y, dual.z)};
}

/// Screw linear interpolation: a (a* b)^t, the constant-speed screw motion from a to b the short
/// way round. Both must be truly unit.
template <typename T>
DualQuat<T> screwInterpolate(const DualQuat<T>& a, const DualQuat<T>& b, T t) {
  DualQuat<T> difference = conjugate(a) * b;
  if (difference.real.w < T(0)) difference = -difference;
  return a * exp(log(difference) * t);
}

}  // namespace dermis::test
