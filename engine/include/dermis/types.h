// Plain data of the interface: float arrays, so that no GLM_FORCE_* setting of an engine changes
// the layout. glm.h converts from and to GLM.
#pragma once

#include <cstdint>

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

/// Maximum joints of a pose.
inline constexpr std::uint32_t maxPoseJoints = 65536;

/// An axis-aligned box.
struct Box {
  float min[3] = {0, 0, 0};  ///< x, y, z
  float max[3] = {0, 0, 0};  ///< x, y, z
};

}  // namespace dermis
