// Decomposes joints that scale or shear. Few joints do, so this is scalar code; it gives the same
// bits on every machine.
#pragma once

namespace dermis::cpu {

/// The symmetric matrix S of C = R S.
struct ScaleShear {
  float diagonal[3] = {1, 1, 1};
  float mixed[3] = {0, 0, 0};  ///< xy xz yz
};

/// The rotation nearest to the 3×3 part C of a joint matrix, as a unit quaternion x y z w, and the
/// scale/shear part. With a negative determinant R is the rotation of −C and S has the sign. `rows`
/// must be finite.
void polarParts(const float rows[3][4], float rotation[4], ScaleShear& scaleShear);

}  // namespace dermis::cpu
