// Joints that scale or shear, taken apart. Few joints do, so this is no SIMD code: its bits are the
// same on every machine.
#pragma once

namespace dermis::cpu {

/// The symmetric matrix S of C = R S.
struct ScaleShear {
  float diagonal[3] = {1, 1, 1};
  float mixed[3] = {0, 0, 0};  ///< xy xz yz
};

/// The nearest rotation to the 3×3 part C of a joint matrix, as a unit quaternion x y z w, and the
/// rest. With a negative determinant R is the rotation of −C and the sign goes into S. `rows` are
/// finite.
void polarParts(const float rows[3][4], float rotation[4], ScaleShear& scaleShear);

}  // namespace dermis::cpu
