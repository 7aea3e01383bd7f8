// The CPU reference: it defines the right answer, in double precision. It starts from the same mesh
// views and float32 joint matrices as the GPU, and shares no code with packing or the kernels. It
// is written to be correct and readable, not fast.
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

using Double3 = std::array<double, 3>;  ///< x, y, z
using Double4 = std::array<double, 4>;  ///< x, y, z, w

/// How near a float32 result must be to the reference at one vertex: the accuracy contract of
/// docs/accuracy.md, for the method, the pose and this vertex. Formats add their own bounds
/// (`positionFormatBound` and others in accuracy.h).
struct VertexBounds {
  double position = 0;  ///< maximum distance between positions, in the units of the pose
  /// Maximum distance between unit normals. If negative, the normal must only have unit length.
  double normal = 0;
  double tangent = 0;  ///< the same for tangents
  /// The largest length in the computation, in the units of the pose: max |t_j| + max σ_j |p| over
  /// the influences. t_j is the translation and σ_j the largest singular value of joint j, p is the
  /// position in bind pose.
  double scale = 0;
  /// Rounding or flushed denormals decide the answer: rotations are antipodal, or a joint's 3×3
  /// matrix has rank 1, is nearly a singular mirror, or is below the range of the contract. The
  /// result must be finite, nothing more.
  bool onlyFinite = false;
  bool undefined = false;         ///< a joint is not finite: there is no answer
  bool outOfRange = false;        ///< numbers exceed the range of the contract: any result is right
  bool normalMayVanish = false;   ///< morph targets cancel the normal: zero is right, too
  bool tangentMayVanish = false;  ///< the same for the tangent
  bool eitherHandedness = false;  ///< the blended matrix is singular: both handednesses are right
};

/// What `skin` returns: one element for each vertex.
struct SkinnedMesh {
  std::vector<Double3> positions;
  std::vector<Double3> normals;   ///< empty if the mesh has none
  std::vector<Double4> tangents;  ///< w is the handedness; empty if the mesh has none
  std::vector<VertexBounds> bounds;
};

/// Skins a mesh. Positions, normals and tangents are in the space of the pose.
///
/// - First the active morph targets are added to the bind pose.
/// - Influences are normalized over all sets together. A vertex without weight stays in bind pose,
///   with its morph targets.
/// - docs/methods.md has the formulas and sources: Kavan et al. 2007, section 4, for dual
///   quaternions; Kavan et al. 2008 for iterative blending; Alexa 2002 and Cordier and
///   Magnenat-Thalmann 2005 for logarithms; Kavan and Žára 2005 for spherical blending; Hejl 2004
///   for quaternions and translations; Le and Hodgins 2016 for centers of rotation.
/// - All methods except `linear` apply scale and shear in two phases, by polar decomposition. The
///   reference decomposes every joint; the kernels take nearly rigid joints for rigid.
/// - Normals are transformed by the cofactor matrix of the blended 3×3 matrix, tangents by the
///   blended 3×3 matrix. Both are normalized. Tangents are not made orthogonal to normals. The
///   handedness is multiplied by the sign of the determinant.
///
/// Fails with `invalidMesh` if `pack` refuses the mesh for `pose.size()` joints, and with
/// `invalidArgument` if the method is not valid, or if the mesh lacks a morph target or the centers
/// of rotation that the method needs.
DERMIS_VERIFY_API Result<SkinnedMesh> skin(const MeshView& mesh, std::span<const JointMatrix> pose,
                                           Method method, std::span<const MorphWeight> morphs = {});

}  // namespace dermis::reference
