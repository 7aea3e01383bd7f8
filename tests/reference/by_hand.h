// The mathematics of the methods a second time, by other means than the reference's: Newton's
// iteration for the polar decomposition, the outer product q qᵀ for the quaternion, matrices for
// the movement, series for exponentials and logarithms.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>

#include "reference_rig.h"

namespace dermis::test {

using Quaternion = std::array<double, 4>;  // w x y z

/// Higham 1986: X ← ½ (X + X⁻ᵀ) converges to the orthogonal factor of a matrix of full rank.
inline glm::dmat3 orthogonalFactor(glm::dmat3 x) {
  for (int step = 0; step < 100; ++step) {
    const double scale = std::pow(std::abs(glm::determinant(x)), -1.0 / 3);
    const glm::dmat3 scaled = step < 8 ? x * scale : x;
    x = (scaled + glm::transpose(glm::inverse(scaled))) * 0.5;
  }
  return x;
}

/// The column of q qᵀ with the largest diagonal element, which is linear in the rotation matrix.
inline Quaternion quaternionOf(const glm::dmat3& r) {
  const auto at = [&](int row, int column) { return r[column - 1][row - 1]; };
  const double outer[4][4] = {{1 + at(1, 1) + at(2, 2) + at(3, 3), at(3, 2) - at(2, 3),
                               at(1, 3) - at(3, 1), at(2, 1) - at(1, 2)},
                              {at(3, 2) - at(2, 3), 1 + at(1, 1) - at(2, 2) - at(3, 3),
                               at(1, 2) + at(2, 1), at(1, 3) + at(3, 1)},
                              {at(1, 3) - at(3, 1), at(1, 2) + at(2, 1),
                               1 - at(1, 1) + at(2, 2) - at(3, 3), at(2, 3) + at(3, 2)},
                              {at(2, 1) - at(1, 2), at(1, 3) + at(3, 1), at(2, 3) + at(3, 2),
                               1 - at(1, 1) - at(2, 2) + at(3, 3)}};
  std::size_t best = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (outer[i][i] > outer[best][best]) best = i;
  }
  Quaternion q{};
  double square = 0;
  for (std::size_t i = 0; i < 4; ++i) square += outer[i][best] * outer[i][best];
  for (std::size_t i = 0; i < 4; ++i) q[i] = outer[i][best] / std::sqrt(square);
  return q;
}

inline Quaternion times(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// The rotation matrix of a quaternion of any length but 0.
inline glm::dmat3 rotationOf(const Quaternion& q) {
  double square = 0;
  for (const double part : q) square += part * part;
  const glm::dvec3 v(q[1], q[2], q[3]);
  glm::dmat3 rotation;
  for (int column = 0; column < 3; ++column) {
    glm::dvec3 e(0.0);
    e[column] = 1;
    rotation[column] = ((q[0] * q[0] - glm::dot(v, v)) * e + 2.0 * glm::dot(v, e) * v +
                        2.0 * q[0] * glm::cross(v, e)) /
                       square;
  }
  return rotation;
}

/// The angle of the rotation that leads from one to the other, 0 to π.
inline double angleBetween(const glm::dmat3& a, const glm::dmat3& b) {
  const Quaternion q = quaternionOf(glm::transpose(a) * b);
  return 2 * std::atan2(std::hypot(q[1], q[2], q[3]), std::abs(q[0]));
}

struct Parts {
  glm::dmat3 rotation, scaleShear;
  glm::dvec3 translation;
};

inline Parts partsOf(const JointMatrix& joint) {
  const glm::dmat3 c = linearOf(joint);
  const glm::dmat3 rotation = orthogonalFactor(glm::determinant(c) < 0 ? -c : c);
  return {rotation, glm::transpose(rotation) * c, offsetOf(joint)};
}

/// A rigid transform as a matrix.
inline glm::dmat4 matrixOf(const glm::dmat3& rotation, const glm::dvec3& translation) {
  glm::dmat4 matrix(rotation);
  matrix[3] = glm::dvec4(translation, 1);
  return matrix;
}

inline double largestEntry(const glm::dmat4& m) {
  double largest = 0;
  for (int i = 0; i < 16; ++i) largest = std::max(largest, std::abs(m[i / 4][i % 4]));
  return largest;
}

/// Taylor's series of the matrix over 2^k, squared k times.
inline glm::dmat4 exponentialOf(const glm::dmat4& matrix) {
  constexpr int squarings = 6;
  const glm::dmat4 part = matrix * std::ldexp(1.0, -squarings);
  glm::dmat4 sum(1.0), term(1.0);
  for (int i = 1; i < 20; ++i) {
    term = term * part * (1.0 / i);
    sum += term;
  }
  for (int i = 0; i < squarings; ++i) sum = sum * sum;
  return sum;
}

/// Square roots by Denman and Beavers 1976 until the matrix is near to 1, then the series of
/// log(1 + x). The principal logarithm: of rotations below half a turn.
inline glm::dmat4 logarithmOf(glm::dmat4 matrix) {
  int roots = 0;
  while (largestEntry(matrix - glm::dmat4(1.0)) > 0.02) {
    glm::dmat4 y = matrix, z(1.0);
    for (int step = 0; step < 30; ++step) {
      const glm::dmat4 next = (y + glm::inverse(z)) * 0.5;
      z = (z + glm::inverse(y)) * 0.5;
      y = next;
    }
    matrix = y;
    ++roots;
  }
  const glm::dmat4 x = matrix - glm::dmat4(1.0);
  glm::dmat4 sum(0.0), power(1.0);
  for (int i = 1; i < 20; ++i) {
    power = power * x;
    sum += power * ((i % 2 == 1 ? 1.0 : -1.0) / i);
  }
  return sum * std::ldexp(1.0, roots);
}

inline glm::dmat3 randomSymmetric(RigRandom& random, double low, double high) {
  const glm::dmat3 frame = rotationAbout(random.direction(), random.between(0, pi));
  return frame *
         diagonalMatrix(random.between(low, high), random.between(low, high),
                        random.between(low, high)) *
         glm::transpose(frame);
}

inline glm::dmat3 randomRotation(RigRandom& random) {
  return rotationAbout(random.direction(), random.between(-pi, pi));
}

}  // namespace dermis::test
