#include <algorithm>
#include <array>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "strict_floating_point.h"
#include "verify/joint.h"

namespace dermis::reference {
namespace {

/// Rotates columns a and b of both matrices so that those of `work` become orthogonal. Golub and
/// Van Loan, "Matrix Computations", section 8.6.3.
bool orthogonalize(glm::dmat3& work, glm::dmat3& right, int a, int b) {
  const double alpha = glm::dot(work[a], work[a]);
  const double beta = glm::dot(work[b], work[b]);
  const double gamma = glm::dot(work[a], work[b]);
  if (std::abs(gamma) <= 1e-16 * std::sqrt(alpha * beta) || gamma == 0) return false;
  const double zeta = (beta - alpha) / (2 * gamma);
  const double tangent = std::copysign(1.0, zeta) / (std::abs(zeta) + std::sqrt(1 + zeta * zeta));
  const double cosine = 1 / std::sqrt(1 + tangent * tangent);
  const double sine = cosine * tangent;
  for (glm::dmat3* matrix : {&work, &right}) {
    const glm::dvec3 first = (*matrix)[a], second = (*matrix)[b];
    (*matrix)[a] = cosine * first - sine * second;
    (*matrix)[b] = sine * first + cosine * second;
  }
  return true;
}

glm::dvec3 anyPerpendicular(const glm::dvec3& v) {
  const glm::dvec3 axis = std::abs(v.x) <= std::abs(v.y) && std::abs(v.x) <= std::abs(v.z)
                              ? glm::dvec3(1, 0, 0)
                          : std::abs(v.y) <= std::abs(v.z) ? glm::dvec3(0, 1, 0)
                                                           : glm::dvec3(0, 0, 1);
  return glm::normalize(glm::cross(v, axis));
}

/// The size of the determinant if no product in it cancelled.
double uncancelledDeterminant(const glm::dmat3& m) {
  double sum = 0;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    sum += std::abs(m[0][i]) * (std::abs(m[1][j] * m[2][k]) + std::abs(m[1][k] * m[2][j]));
  }
  return sum;
}

}  // namespace

SingularValues singularValues(const glm::dmat3& matrix) {
  glm::dmat3 work = matrix, right(1.0);
  for (int sweep = 0; sweep < 40; ++sweep) {
    bool rotated = orthogonalize(work, right, 0, 1);
    rotated |= orthogonalize(work, right, 0, 2);
    rotated |= orthogonalize(work, right, 1, 2);
    if (!rotated) break;
  }
  std::array<int, 3> order{0, 1, 2};
  const glm::dvec3 lengths(glm::length(work[0]), glm::length(work[1]), glm::length(work[2]));
  std::sort(order.begin(), order.end(), [&](int a, int b) { return lengths[a] > lengths[b]; });

  SingularValues result{glm::dmat3(1.0), glm::dvec3(0.0), glm::dmat3(1.0)};
  for (int i = 0; i < 3; ++i) {
    result.values[i] = lengths[order[static_cast<std::size_t>(i)]];
    result.right[i] = right[order[static_cast<std::size_t>(i)]];
  }
  // Left vectors that the matrix does not determine complete the orthonormal set.
  const double tiny = 1e-300;
  if (result.values[0] > tiny) {
    result.left[0] = work[order[0]] / result.values[0];
    result.left[1] = result.values[1] > 1e-14 * result.values[0] ? work[order[1]] / result.values[1]
                                                                 : anyPerpendicular(result.left[0]);
    result.left[2] = result.values[2] > 1e-14 * result.values[0]
                         ? work[order[2]] / result.values[2]
                         : glm::cross(result.left[0], result.left[1]);
  }
  return result;
}

PolarParts polarParts(const glm::dmat3& matrix) {
  const SingularValues svd = singularValues(matrix);
  PolarParts parts;
  parts.largest = svd.values[0];
  parts.distanceFromRotation = std::max(std::abs(svd.values[0] - 1), std::abs(svd.values[2] - 1));
  parts.degenerate = svd.values[1] <= 1e-5 * svd.values[0] || svd.values[0] == 0;
  // A GPU may flush entries below 2^-126 to 0.
  parts.degenerate |= svd.values[1] + svd.values[2] < 0x1p-100;

  // A determinant within 16 roundings of 0 counts as 0. A kernel's determinant has rounding errors
  // too, so its limit is between this value and twice as much.
  const double determinant = glm::determinant(matrix);
  const double rounding = 16 * 0x1p-24 * uncancelledDeterminant(matrix);
  const bool mirrored = determinant < -rounding;
  // A GPU may flush entries of the matrix and, once they are scaled to 1, products of entries.
  const double flushing = 0x1p-100 * parts.largest * parts.largest * std::max(1.0, parts.largest);
  parts.degenerate |= mirrored && determinant >= -2 * rounding - flushing;

  glm::dmat3 left = mirrored ? -svd.left : svd.left;
  // If the matrix is singular, the last axis may have either sign. Choose the one that makes a
  // rotation.
  if (glm::determinant(left) * glm::determinant(svd.right) < 0) left[2] = -left[2];
  parts.rotation = left * glm::transpose(svd.right);
  parts.scaleShear = glm::transpose(parts.rotation) * matrix;
  return parts;
}

namespace {

using glm::dmat3;
using glm::dvec4;

/// The unit quaternion of a rotation matrix, from the largest of its four squared components
/// (Shepperd 1978).
dvec4 quaternionOf(const dmat3& r) {
  // r[column][row]
  const double x = 1 + r[0][0] - r[1][1] - r[2][2];
  const double y = 1 - r[0][0] + r[1][1] - r[2][2];
  const double z = 1 - r[0][0] - r[1][1] + r[2][2];
  const double w = 1 + r[0][0] + r[1][1] + r[2][2];
  dvec4 q;
  if (w >= x && w >= y && w >= z) {
    q = dvec4(r[1][2] - r[2][1], r[2][0] - r[0][2], r[0][1] - r[1][0], w);
  } else if (x >= y && x >= z) {
    q = dvec4(x, r[0][1] + r[1][0], r[2][0] + r[0][2], r[1][2] - r[2][1]);
  } else if (y >= z) {
    q = dvec4(r[0][1] + r[1][0], y, r[1][2] + r[2][1], r[2][0] - r[0][2]);
  } else {
    q = dvec4(r[2][0] + r[0][2], r[1][2] + r[2][1], z, r[0][1] - r[1][0]);
  }
  return glm::normalize(q);
}

}  // namespace

Joint takeApart(const JointMatrix& matrix) {
  Transform exact;
  for (std::size_t row = 0; row < 3; ++row) std::ranges::copy(matrix.m[row], exact[row].begin());
  return takeApart(exact);
}

Joint takeApart(const Transform& matrix) {
  Joint joint;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const double value = matrix[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
      joint.finite &= std::isfinite(value);
      if (column < 3) {
        joint.linear[column][row] = value;
      } else {
        joint.translation[row] = value;
      }
    }
  }
  if (!joint.finite) {
    const double nan = std::nan("");
    joint.rigid = {dvec4(nan), dvec4(nan)};
    joint.scaleShear = dmat3(nan);
    joint.largest = 0;
    joint.degenerate = true;
    return joint;
  }
  const PolarParts parts = polarParts(joint.linear);
  joint.scaleShear = parts.scaleShear;
  joint.largest = parts.largest;
  joint.degenerate = parts.degenerate;
  joint.rigid = rigidOf(quaternionOf(parts.rotation), joint.translation);

  const dmat3 gram = glm::transpose(joint.linear) * joint.linear - dmat3(1.0);
  double deviation = 0;  // the largest sum of a row's absolute values
  for (int row = 0; row < 3; ++row) {
    deviation = std::max(deviation,
                         std::abs(gram[0][row]) + std::abs(gram[1][row]) + std::abs(gram[2][row]));
  }
  // The kernels compare float sums with 8e-6. An entry of CᵀC is a sum of three products, with an
  // error of at most 3 u, and a row has three entries. Joints up to 9 u above the limit may count
  // as rigid or not.
  joint.rigidForKernels = glm::determinant(joint.linear) > 0 && deviation <= 8e-6 + 9 * 0x1p-24;
  joint.distanceFromRotation = parts.distanceFromRotation;
  return joint;
}

}  // namespace dermis::reference
