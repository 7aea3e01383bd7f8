// The rotation in a joint matrix, fast where it is nearly one: for the bounds of a skinned mesh.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec4.hpp>

namespace dermis::bounds {

/// What a joint's 3×3 is made of: C = R S.
struct Parts {
  glm::dmat3 scaleShear{1.0};   ///< exactly 1 where the joint is rigid but for rounding
  glm::dvec4 real{0, 0, 0, 1};  ///< the unit quaternion of R: x y z w
  double largest = 1;           ///< no singular value of C is larger
  bool rigid = true;
  /// R is a matter of rounding, a kernel's may be another: rank 1, or so near to a singular mirror
  /// that its sense is. C = 0 is not: its R is 1, by agreement.
  bool ambiguous = false;
};

/// By the rules of the reference: the polar decomposition, R being that of −C where C mirrors. The
/// matrix must be finite.
Parts partsOf(const glm::dmat3& matrix);

}  // namespace dermis::bounds
