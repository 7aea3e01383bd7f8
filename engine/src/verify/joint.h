// Decomposes a joint matrix in double precision: singular values, the polar decomposition, the
// rigid part.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "dermis/clips.h"
#include "dermis/mesh.h"
#include "verify/rigid.h"

namespace dermis::reference {

struct SingularValues {
  glm::dmat3 left;    ///< orthonormal columns
  glm::dvec3 values;  ///< in descending order, not negative
  glm::dmat3 right;   ///< orthonormal columns; matrix = left · diag(values) · rightᵀ
};

/// One-sided Jacobi: small singular values are as accurate as large ones. The matrix must be
/// finite.
SingularValues singularValues(const glm::dmat3& matrix);

struct PolarParts {
  glm::dmat3 rotation;    ///< det +1
  glm::dmat3 scaleShear;  ///< symmetric; matrix = rotation · scaleShear
  double largest = 0;     ///< the largest singular value
  double distanceFromRotation =
      0;  ///< largest |singular value - 1|: how far it moves a point at distance 1
  /// Rank ≤ 1; or so close to a singular mirror that rounding, or flushing denormals to 0 on a GPU,
  /// decides the sign; or σ₂ + σ₃ < 2^-100, so that flushing would turn it.
  bool degenerate = false;
};

/// If the determinant is negative, the rotation is that of −matrix, and scaleShear has a negative
/// determinant. A matrix whose determinant is 0 except for rounding in float32 counts as flat, not
/// mirrored: two axes determine the rotation, and the third is chosen so that its determinant is 1.
PolarParts polarParts(const glm::dmat3& matrix);

struct Joint {
  glm::dmat3 linear;
  glm::dvec3 translation;
  Rigid rigid;  ///< the rotation of the polar decomposition, and the translation
  glm::dmat3 scaleShear;
  double largest = 1;  ///< largest singular value
  bool finite = true;
  bool degenerate = false;
  bool rigidForKernels = false;
  double distanceFromRotation = 0;
};

/// Decomposes a joint. A matrix that is not finite gives NaNs.
Joint takeApart(const Transform& matrix);
Joint takeApart(const JointMatrix& matrix);

}  // namespace dermis::reference
