#include "bounds/rotation.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

namespace dermis::bounds {
namespace {

/// The largest sum of a row's absolute values of MᵀM − 1: no singular value is further from 1.
double deviationFromRotation(const glm::dmat3& m) {
  const double xx = std::abs(glm::dot(m[0], m[0]) - 1), yy = std::abs(glm::dot(m[1], m[1]) - 1),
               zz = std::abs(glm::dot(m[2], m[2]) - 1);
  const double xy = std::abs(glm::dot(m[0], m[1])), xz = std::abs(glm::dot(m[0], m[2])),
               yz = std::abs(glm::dot(m[1], m[2]));
  return std::max({xx + xy + xz, xy + yy + yz, xz + yz + zz});
}

/// R ← ½ R (3 − RᵀR), which squares the deviation. Björck and Bowie 1971, "An iterative algorithm
/// for computing the best estimate of an orthogonal matrix". The deviation must be below ½.
glm::dmat3 orthonormalized(glm::dmat3 m, double deviation) {
  for (int step = 0; step < 6 && deviation > 1e-12; ++step) {
    m = 1.5 * m - 0.5 * (m * (glm::transpose(m) * m));
    deviation *= deviation;
  }
  return m;
}

glm::dvec4 quaternionOf(const glm::dmat3& rotation) {
  const glm::dquat q = glm::normalize(glm::quat_cast(rotation));
  return {q.x, q.y, q.z, q.w};
}

glm::dmat3 rotationOf(const glm::dvec4& q) {
  return glm::mat3_cast(glm::dquat(q.w, q.x, q.y, q.z));
}

/// The rotation R that makes trace(Rᵀ C) largest: the polar rotation where det C ≥ 0 and the rank
/// is at least 2. Horn 1987, "Closed-form solution of absolute orientation using unit quaternions":
/// the eigenvector of the largest eigenvalue of a symmetric 4×4 matrix, here by cyclic Jacobi.
glm::dvec4 nearestRotation(const glm::dmat3& c) {
  const auto at = [&](int row, int column) { return c[column][row]; };
  double a[4][4] = {{at(0, 0) - at(1, 1) - at(2, 2), at(0, 1) + at(1, 0), at(0, 2) + at(2, 0),
                     at(2, 1) - at(1, 2)},
                    {at(0, 1) + at(1, 0), at(1, 1) - at(0, 0) - at(2, 2), at(1, 2) + at(2, 1),
                     at(0, 2) - at(2, 0)},
                    {at(0, 2) + at(2, 0), at(1, 2) + at(2, 1), at(2, 2) - at(0, 0) - at(1, 1),
                     at(1, 0) - at(0, 1)},
                    {at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1),
                     at(0, 0) + at(1, 1) + at(2, 2)}};
  double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  for (int sweep = 0; sweep < 12; ++sweep) {
    bool turned = false;
    for (int p = 0; p < 3; ++p) {
      for (int q = p + 1; q < 4; ++q) {
        if (std::abs(a[p][q]) <= 1e-17 * (std::abs(a[p][p]) + std::abs(a[q][q]))) continue;
        turned = true;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double tangent =
            std::copysign(1.0, theta) / (std::abs(theta) + std::sqrt(1 + theta * theta));
        const double cosine = 1 / std::sqrt(1 + tangent * tangent), sine = tangent * cosine;
        for (int k = 0; k < 4; ++k) {
          const double x = a[k][p], y = a[k][q];
          a[k][p] = cosine * x - sine * y;
          a[k][q] = sine * x + cosine * y;
        }
        for (int k = 0; k < 4; ++k) {
          const double x = a[p][k], y = a[q][k];
          a[p][k] = cosine * x - sine * y;
          a[q][k] = sine * x + cosine * y;
          const double s = v[k][p], t = v[k][q];
          v[k][p] = cosine * s - sine * t;
          v[k][q] = sine * s + cosine * t;
        }
      }
    }
    if (!turned) break;
  }
  int best = 0;
  for (int i = 1; i < 4; ++i) {
    if (a[i][i] > a[best][best]) best = i;
  }
  return glm::normalize(glm::dvec4(v[0][best], v[1][best], v[2][best], v[3][best]));
}

enum class Sense { upright, mirrored, ambiguous };

/// Which way round a matrix is. The reference and the kernels draw the line between flat and
/// mirrored at 16 and 24 roundings of float32 and call a matrix of rank 1 where σ₂ ≤ 1e-5 σ₁;
/// within twice that, one may decide this way and another that way.
Sense senseOf(const glm::dmat3& m) {
  double cofactors = 0, squares = 0, uncancelled = 0;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const glm::dvec3 cofactor = glm::cross(m[j], m[k]);
    cofactors += glm::dot(cofactor, cofactor);
    squares += glm::dot(m[i], m[i]);
    uncancelled += std::abs(m[0][i]) * (std::abs(m[1][j] * m[2][k]) + std::abs(m[1][k] * m[2][j]));
  }
  // Cofactors, squared, sum to σ₁²σ₂² + σ₁²σ₃² + σ₂²σ₃².
  if (cofactors <= 1e-9 * squares * squares) return Sense::ambiguous;
  const double determinant = glm::determinant(m), rounding = 0x1p-24 * uncancelled;
  if (determinant >= -8 * rounding) return Sense::upright;
  return determinant <= -64 * rounding ? Sense::mirrored : Sense::ambiguous;
}

}  // namespace

Parts partsOf(const glm::dmat3& matrix) {
  Parts parts;
  const double determinant = glm::determinant(matrix);
  const double deviation = deviationFromRotation(matrix);
  if (determinant > 0 && deviation <= 1e-5) {
    parts.real = quaternionOf(orthonormalized(matrix, deviation));
    parts.largest = 1 + 1e-5;
    return parts;
  }

  parts.rigid = false;
  const double squares = glm::dot(matrix[0], matrix[0]) + glm::dot(matrix[1], matrix[1]) +
                         glm::dot(matrix[2], matrix[2]);
  parts.largest = std::sqrt(squares);  // ‖C‖, at most √3 too much
  parts.scaleShear = matrix;
  if (squares == 0) return parts;

  const double size = std::sqrt(squares / 3);
  const glm::dmat3 unit = matrix / size;
  const Sense sense = senseOf(unit);
  // Entries below 2^-126 may be flushed to 0; `reference::PolarParts` has the same line.
  parts.ambiguous = sense == Sense::ambiguous || size < 0x1p-98;
  if (parts.ambiguous) return parts;
  const glm::dmat3 upright = sense == Sense::mirrored ? -unit : unit;
  const double unitDeviation = deviationFromRotation(upright);
  parts.real = unitDeviation < 0.25 ? quaternionOf(orthonormalized(upright, unitDeviation))
                                    : nearestRotation(upright);
  parts.scaleShear = glm::transpose(rotationOf(parts.real)) * matrix;
  return parts;
}

}  // namespace dermis::bounds
