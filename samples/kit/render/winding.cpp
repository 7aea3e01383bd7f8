#include "kit/render/winding.h"

#include <algorithm>

namespace dermis::samples {
namespace {

float determinant(const JointMatrix& matrix) {
  const auto& m = matrix.m;
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
         m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

}  // namespace

bool isMirrored(std::span<const JointMatrix> pose) {
  const auto mirrored =
      std::ranges::count_if(pose, [](const JointMatrix& joint) { return determinant(joint) < 0; });
  return static_cast<std::size_t>(mirrored) * 2 > pose.size();
}

}  // namespace dermis::samples
