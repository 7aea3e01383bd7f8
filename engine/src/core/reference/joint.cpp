#include "joint.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "decompose.h"

namespace dermis::reference {
namespace {

using glm::dmat3;
using glm::dvec4;

/// The unit quaternion of a rotation matrix, by the largest of its four squared components
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
  Joint joint;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const double value = static_cast<double>(matrix.m[row][column]);
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
  // The kernels compare float sums with 8e-6. An entry of CᵀC is a sum of three products, off by at
  // most 3 u, and a row has three of them: joints up to 9 u beyond may go either way.
  joint.rigidForKernels = glm::determinant(joint.linear) > 0 && deviation <= 8e-6 + 9 * 0x1p-24;
  joint.distanceFromRotation = parts.distanceFromRotation;
  return joint;
}

}  // namespace dermis::reference
