// The blending rules, in double precision. Each takes the joints of a palette, the influences of
// one vertex in the order of their joints, at least one, and the vertex in bind pose; normals and
// tangents come out of unit length or zero. What depends on the method is written into the
// conditioning.
#pragma once

#include <span>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "dermis/method.h"
#include "verify/bind_vertex.h"
#include "verify/conditioning.h"
#include "verify/joint.h"
#include "verify/rigid.h"

namespace dermis::reference {

/// What some methods want to know of a vertex besides.
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

/// The strongest influence, the lowest joint on a tie.
const Influence& pivotOf(std::span<const Influence> influences);

/// The rigid parts blended as dual quaternions (Kavan et al. 2007, algorithm 1) with the pivot of
/// greatest weight, the real part of unit length; and the scale/shear parts blended linearly.
struct RigidBlend {
  Rigid rigid;
  glm::dmat3 scaleShear{0.0};
};
RigidBlend blendRigid(const VertexToSkin& vertex, Conditioning& conditioning);

/// In two phases: scaled in bind space, then moved by a rotation about the origin and a
/// translation.
BindVertex moveRigidly(const VertexToSkin& vertex, const glm::dmat3& scaleShear,
                       const glm::dvec4& rotation, const glm::dvec3& translation,
                       Conditioning& conditioning);

/// DIB, Kavan et al. 2008.
Rigid iterate(const VertexToSkin& vertex, Rigid start, Conditioning& conditioning);
/// exp(Σ w log C), C the rigid parts.
Rigid blendLogarithms(const VertexToSkin& vertex, Conditioning& conditioning);
/// Kavan and Žára 2005: the point that the rigid parts come nearest to agreeing on.
glm::dvec3 sphericalCenter(const VertexToSkin& vertex, Conditioning& conditioning);

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
