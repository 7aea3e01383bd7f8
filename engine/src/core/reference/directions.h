// What becomes of normals and tangents, in double precision.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "dermis/reference.h"
#include "morph.h"

namespace dermis::reference {

/// The 3×3 that directions go through, and what their sense depends on.
struct BlendedMatrix {
  /// `largestOfJoints` is their largest singular value.
  BlendedMatrix(const glm::dmat3& matrix, double largestOfJoints);

  /// Whether the sign of the determinant is a matter of rounding.
  bool isFlat() const;

  glm::dmat3 m;
  double determinant;
  double largest;  ///< its largest singular value
  double stretch;  ///< that of the joints: what the blended entries were rounded by
};

/// A vertex through a blended matrix, but for its position: the normal by the inverse transpose,
/// finite also where the matrix is singular, the tangent by the matrix, both of unit length or
/// zero, the handedness by the sign of the determinant. Fills the conditioning's alignments.
BindVertex transformDirections(const BlendedMatrix& matrix, const BindVertex& vertex,
                               Conditioning& conditioning);

glm::dvec3 unitOrZero(const glm::dvec3& v);

}  // namespace dermis::reference
