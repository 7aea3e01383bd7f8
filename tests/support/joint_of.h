// A joint matrix from a linear part and a translation.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "dermis/mesh.h"

namespace dermis::test {

inline glm::dmat3 diagonalMatrix(double x, double y, double z) {
  return {{x, 0, 0}, {0, y, 0}, {0, 0, z}};
}

inline JointMatrix jointOf(const glm::dmat3& linear, const glm::dvec3& translation = {0, 0, 0}) {
  JointMatrix joint;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      joint.m[row][column] = static_cast<float>(linear[column][row]);
    }
    joint.m[row][3] = static_cast<float>(translation[row]);
  }
  return joint;
}

}  // namespace dermis::test
