// Conversion between the plain arrays of the interface and GLM.
#pragma once

#include <span>

#include <glm/mat4x3.hpp>
#include <glm/mat4x4.hpp>

#include "dermis/types.h"

namespace dermis {

/// From a GLM matrix. Its last row, which should be 0 0 0 1, is not read.
inline JointMatrix toJointMatrix(const glm::mat4& matrix) {
  return toJointMatrix(std::span<const float, 16>(&matrix[0][0], 16));
}

/// To a GLM matrix of four columns with three components each.
inline glm::mat4x3 toGlm(const JointMatrix& matrix) {
  glm::mat4x3 result(1.0f);
  for (glm::length_t row = 0; row < 3; ++row) {
    for (glm::length_t column = 0; column < 4; ++column)
      result[column][row] = matrix.m[row][column];
  }
  return result;
}

}  // namespace dermis
