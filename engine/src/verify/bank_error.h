// How far vertices that are skinned in the pose of a bank of clips may be from those in the
// source's pose.
#pragma once

#include <array>
#include <span>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "verify/conditioning.h"
#include "verify/joint.h"
#include "verify/methods.h"

namespace dermis::reference {

/// How far a joint of the bank may be from the source's [R S | t], R S by polar decomposition.
/// Norms are spectral.
struct JointError {
  JointError(const Joint& joint, const JointMatrix& inverseBindMatrix,
             const std::array<double, 3>& bounds);

  /// The distance between the images of a point of bind space.
  double at(const glm::dvec3& point) const;

  glm::dmat4 inverseBind{1.0};
  double atJoint, perDistance;  ///< A and B of `SampledPose::bounds`
  double linear;                ///< of the 3×3 matrices
  double shape;                 ///< the same, except for a rotation
  double scaleShear = 0;        ///< of S
  double quaternion = 0;        ///< of R's quaternion, with the nearer sign
  double turn = 0;              ///< of R
  /// The bank's joint may be degenerate, or a mirror though the source's is none.
  bool uncertain = false;
};

/// What that adds to the bounds of a vertex. Infinite if there is no bound.
struct BankError {
  double position = 0, normal = 0, tangent = 0;
};

/// Also makes the conditioning that of the worst pose of the bank. The vertex must have influences,
/// and the method must not be `isForComparison`.
BankError bankError(const VertexToSkin& vertex, std::span<const JointError> errors, Method method,
                    Conditioning& conditioning);

}  // namespace dermis::reference
