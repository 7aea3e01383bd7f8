// The CPU reference: the right answer, in double precision. It starts from the same mesh views and
// float32 joint matrices as the GPU and shares no code with packing or the kernels. Made to be
// right and readable, not fast.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/method.h"
#include "dermis/result.h"
#include "dermis/types.h"

namespace dermis::reference {

using Double3 = std::array<double, 3>;
using Double4 = std::array<double, 4>;

/// How near a float32 result must come to the reference at one vertex: the accuracy contract of
/// docs/accuracy.md for the method, the pose and this vertex. Formats add their own bounds
/// (`positionFormatBound` and the others in accuracy.h).
struct VertexBounds {
  double position = 0;  ///< maximum distance between positions, in the pose's units
  double normal = 0;    ///< maximum distance between unit normals; negative: only unit length is
                        ///< required
  double tangent = 0;   ///< the same for tangents
  double scale = 0;     ///< the largest length in the computation, in the pose's units: max |t_j| +
                        ///< max σ_j |p| over the influences, t_j the translation and σ_j the
                        ///< largest singular value of joint j, p the position in bind pose
  bool onlyFinite = false;  ///< rounding decides the answer (antipodal rotations, flat joints): the
                            ///< result must be finite, nothing more
  bool undefined = false;   ///< a joint is not finite: there is no answer
  bool normalMayVanish = false;   ///< morph targets cancel the normal: zero is right as well
  bool tangentMayVanish = false;  ///< the same for the tangent
  bool eitherHandedness = false;  ///< the blended matrix is flat: both handednesses are right
};

struct SkinnedMesh {
  std::vector<Double3> positions;
  std::vector<Double3> normals;   ///< empty if the mesh has none
  std::vector<Double4> tangents;  ///< x y z and the handedness; empty if the mesh has none
  std::vector<VertexBounds> bounds;
};

/// Skins a mesh by a pose (joint matrices: joint global transform × inverse bind matrix),
/// after adding the active morph targets to the bind pose. Influences are normalised over all sets
/// together; a vertex without weight stays in bind pose (morphed). Positions, normals and tangents
/// are in the pose's space. docs/methods.md has the formula of each method and its source: Kavan
/// et al. 2007, section 4, for dual quaternions, 2008 for iterative blending; Alexa 2002 and
/// Cordier and Magnenat-Thalmann 2005 for logarithms; Kavan and Žára 2005 for spherical blending;
/// Hejl 2004; Le and Hodgins 2016 for centres of rotation. Two-phase scale and shear by polar
/// decomposition, without a threshold; normals by the adjugate transpose of the blended 3×3,
/// tangents by the blended 3×3 itself, not made orthogonal, their handedness times the sign of its
/// determinant. Fails with `invalidMesh` where the mesh, with that many joints, would be refused by
/// `pack`, and with `invalidArgument` for a morph target that the mesh does not have, and for a
/// method that needs centres of rotation which it lacks.
DERMIS_VERIFY_API Result<SkinnedMesh> skin(const MeshView& mesh, std::span<const JointMatrix> pose,
                                           Method method, std::span<const MorphWeight> morphs = {});

}  // namespace dermis::reference
