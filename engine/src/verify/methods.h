// The blending methods, in double precision. Each takes the joints of a palette, the influences of
// one vertex (at least one, in ascending order of joints), and the vertex in bind pose. Normals and
// tangents of the result have unit length or are zero. Each method fills in its part of the
// conditioning.
#pragma once

#include <span>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "dermis/layout.h"
#include "verify/bind_vertex.h"
#include "verify/conditioning.h"
#include "verify/joint.h"
#include "verify/rigid.h"

namespace dermis::reference {

/// Additional inputs per vertex that some methods read.
struct MethodInputs {
  glm::dvec3 center{0.0};
  double dualQuaternionWeight = 0;
  double bulgeStrength = 0;
};

struct VertexToSkin {
  std::span<const Joint> joints;
  std::span<const Influence> influences;
  BindVertex bind;
  MethodInputs inputs;
};

BindVertex skinVertex(const VertexToSkin& vertex, Method method, Conditioning& conditioning);

/// The strongest influence. On a tie, the one with the lowest joint.
const Influence& pivotOf(std::span<const Influence> influences);

/// The rigid parts blended as dual quaternions (Kavan et al. 2007, algorithm 1), and the
/// scale/shear parts blended linearly. The pivot is the influence with the greatest weight. The
/// real part of the result has unit length.
struct RigidBlend {
  Rigid rigid;
  glm::dmat3 scaleShear{0.0};
};
RigidBlend blendRigid(const VertexToSkin& vertex, Conditioning& conditioning);

/// Skins in two phases: scales in bind space, then rotates about the origin and translates.
BindVertex moveRigidly(const VertexToSkin& vertex, const glm::dmat3& scaleShear,
                       const glm::dvec4& rotation, const glm::dvec3& translation,
                       Conditioning& conditioning);

/// Dual quaternion iterative blending (Kavan et al. 2008), beginning with `start`.
Rigid iterate(const VertexToSkin& vertex, Rigid start, Conditioning& conditioning);
/// exp(Σ w log C), C the rigid parts.
Rigid blendLogarithms(const VertexToSkin& vertex, Conditioning& conditioning);
/// Kavan and Žára 2005: the point that all rigid parts move most nearly to the same place.
glm::dvec3 sphericalCenter(const VertexToSkin& vertex, Conditioning& conditioning);

/// The 3×3 that transforms directions, and what its sign depends on.
struct BlendedMatrix {
  /// `largestOfJoints` is their largest singular value.
  BlendedMatrix(const glm::dmat3& matrix, double largestOfJoints);

  /// Whether rounding or flushed denormals decide the sign of the determinant: whether they may be
  /// as large as the smallest singular value, which is at least |det| / σ_max². So may `error`, the
  /// norm of what the matrix is off by.
  bool isFlat(double error = 0) const;

  glm::dmat3 m;
  double determinant;
  double largest;  ///< its largest singular value
  double stretch;  ///< largest singular value of the joints; the blended entries were rounded
                   ///< relative to it
};

/// Transforms everything but the position by a blended matrix: the normal by the inverse transpose
/// (finite even if the matrix is singular), the tangent by the matrix, both with unit length or
/// zero, and the handedness by the sign of the determinant. Fills in the conditioning's alignments.
BindVertex transformDirections(const BlendedMatrix& matrix, const BindVertex& vertex,
                               Conditioning& conditioning);

/// The cofactor matrix.
glm::dmat3 adjugateTranspose(const glm::dmat3& m);
glm::dvec3 unitOrZero(const glm::dvec3& v);

}  // namespace dermis::reference
