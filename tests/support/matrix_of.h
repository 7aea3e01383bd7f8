// Joint matrices and transforms as matrices of GLM.
#pragma once

#include <cstddef>

#include <glm/mat4x4.hpp>

namespace dermis::test {

/// `rows`: 3 rows of 4 numbers, as in `Transform` and `JointMatrix::m`.
template <typename Rows>
glm::dmat4 matrixOf(const Rows& rows) {
  glm::dmat4 m(1);
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 4; ++column)
      m[static_cast<int>(column)][static_cast<int>(row)] = static_cast<double>(rows[row][column]);
  return m;
}

}  // namespace dermis::test
