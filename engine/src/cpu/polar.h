// Decomposes joints that scale or shear. Few joints do, so this is scalar code; it gives the same
// bits on every machine.
#pragma once

namespace dermis::cpu {

/// The symmetric matrix S of C = R S.
struct ScaleShear {
  float diagonal[3] = {1, 1, 1};
  float mixed[3] = {0, 0, 0};  ///< xy xz yz
};

/// The rotation R nearest to the 3×3 part C of a joint matrix, as a unit quaternion x y z w, and
/// the scale/shear part S. If the determinant of C is negative by more than rounding, R is the
/// rotation nearest to −C, and S = Rᵀ C has a negative determinant. `rows` must be finite.
void polarParts(const float rows[3][4], float rotation[4], ScaleShear& scaleShear);

}  // namespace dermis::cpu
