// Plain data that crosses the interface: float arrays, so that no GLM_FORCE_* setting of an engine
// changes their layout. glm.h converts.
#pragma once

#include <cstdint>

namespace dermis {

/// An affine transform as a row-major 3×4 matrix: `m[row][column]`, column 3 the translation.
/// Columns are vectors: a point p becomes m * (p, 1). 48 bytes; an array of these is what the GPU
/// reads.
struct JointMatrix {
  float m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
};
static_assert(sizeof(JointMatrix) == 48);

/// The maximum number of joints of a pose. A packed mesh stores joint indices in 32 bits;
/// centres of rotation are found by pairs of joints with 16 bits each.
inline constexpr std::uint32_t maxPoseJoints = 65536;

/// An axis-aligned box.
struct Box {
  float min[3] = {0, 0, 0};
  float max[3] = {0, 0, 0};
};

}  // namespace dermis
