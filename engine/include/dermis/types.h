// Plain data of the interface: float arrays, so that no GLM_FORCE_* setting of an engine changes
// the layout. glm.h converts from and to GLM.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "dermis/result.h"

namespace dermis {

/// A joint matrix: joint global transform × inverse bind matrix. An affine transform as a row-major
/// 3×4 matrix: `m[row][column]`, column 3 is the translation. It transforms a point p to m * (p,
/// 1): from bind space, the space of the mesh, to the space of the pose, the space of the joint
/// global transforms. Skinned vertices are in that space. 48 bytes; the GPU reads an array of
/// these.
struct JointMatrix {
  float m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
};
static_assert(sizeof(JointMatrix) == 48);

/// Converts a column-major 4×4 matrix, as GLM stores it. A row-major matrix for row vectors, as of
/// DirectXMath, has the same bytes. The last row (column), which should be 0 0 0 1, is not read.
inline JointMatrix toJointMatrix(std::span<const float, 16> columnMajor) {
  JointMatrix result;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column)
      result.m[row][column] = columnMajor[column * 4 + row];
  }
  return result;
}

/// The same for an array of matrices, 16 floats each. `result` may be what `writePose` returned: it
/// is not read. Fails with `invalidArgument` if there are not 16 floats for each joint matrix.
inline Result<void> toJointMatrices(std::span<const float> columnMajor,
                                    std::span<JointMatrix> result) {
  if (columnMajor.size() != result.size() * 16) {
    return Error{ErrorCode::invalidArgument, std::to_string(columnMajor.size()) +
                                                 " floats are not 4x4 matrices for " +
                                                 std::to_string(result.size()) + " joints"};
  }
  for (std::size_t joint = 0; joint < result.size(); ++joint)
    result[joint] = toJointMatrix(columnMajor.subspan(joint * 16).first<16>());
  return {};
}

/// Maximum joints of a pose.
inline constexpr std::uint32_t maxPoseJoints = 65536;

/// An axis-aligned box.
struct Box {
  float min[3] = {0, 0, 0};  ///< x, y, z
  float max[3] = {0, 0, 0};  ///< x, y, z
};

}  // namespace dermis
