// The CPU reference: the right answer, in double precision. It starts from the same mesh views and
// float32 joint matrices as the GPU and shares no code with packing or the kernels. Made to be
// right and readable, not fast.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/method.h"
#include "dermis/result.h"
#include "dermis/types.h"

namespace dermis::reference {

using Double3 = std::array<double, 3>;
using Double4 = std::array<double, 4>;

/// What the accuracy of a float32 result depends on, per vertex (accuracy.h turns it into bounds).
/// p, n and t are the position, normal and tangent in bind pose after morphing; u = 2^-24.
struct Conditioning {
  double scale = 0;     ///< max |t_j| + max σ_j |p| over the influences; σ_j the largest singular
                        ///< value of joint j
  double stretch = 1;   ///< max σ_j; 1 for a vertex without weight
  double distance = 0;  ///< |p|, from the origin of the bind pose; where there is a centre of
                        ///< rotation c, |p| + 2 |c|
  double rigidShortcut = 0;  ///< max |σ − 1| of the joints that kernels take for rigid as they are
  /// What the bind pose in float32 may be off by, in units of u: of the mesh's for p, of |n| and
  /// |t| for directions. A rounding for a stored value that is no float32, two for each target that
  /// displaces the vertex (w d, and the sum), three where its d is no float32; each of them at most
  /// u (|p| + Σ |w_i d_i|). 0 for float32 without morphs; infinite where displacements cancel a
  /// direction.
  double positionRounding = 0;
  double normalRounding = 0;
  double tangentRounding = 0;
  /// |adjᵀ(M) n| / (max σ_j σ_max |n|), M the blended 3×3 and σ_max its largest singular value:
  /// where joints cancel in a blend, what is left was rounded at the size of the joints.
  double normalAlignment = 1;
  double tangentAlignment = 1;  ///< |M t| / (max σ_j |t|), likewise
  /// A length that counts besides the scale: twice max σ_j times the centre of rotation's distance
  /// from the origin (`centerOfRotation`, `bulgeControlled`), how far differences of rotations that
  /// all but agree throw the centre (`sphericalBlend`: |r| + max |t_a − t_b| / σ, σ the least
  /// singular value that is made use of), and what is left of the errors of earlier steps
  /// (`dualQuaternionIterative`: scale · (`turning` − 1)).
  double leverage = 0;
  /// |b|, the length of the blended quaternion before it is normalised: at least the greatest
  /// weight, and so at least 1/4 for up to four influences. 1 for `linear` and `logMatrix`.
  double blendLength = 1;
  double turning = 1;  ///< `dualQuaternionIterative`: 1 / (1 − ρ), ρ the factor by which steps
                       ///< shrink
  double normalLength = 1;   ///< `blended`: of the sum of both unit normals, which is normalised
  double tangentLength = 1;  ///< likewise
  bool normalRotatedOnly =
      true;  ///< blended rotations of rigid joints: directions pass through no 3×3
  bool handednessAmbiguous =
      false;  ///< |det M| ≤ 1e-5 max σ_j σ_max²: its sign is a matter of rounding
  /// The answer jumps here, and rounding decides to which side: |dot| with the pivot below 1e-5,
  /// `logMatrix`: a joint turned by 180° within 2e-5, `dualQuaternionIterative`: one nearly
  /// opposite to the blend, `sphericalBlend`: a singular value within 1e-5 of the least.
  bool signAmbiguous = false;
  bool degenerate = false;  ///< a joint of rank ≤ 1, or of σ₂ + σ₃ < 2^-100, or not finite: a
                            ///< result is only asked to be finite
  bool undefined = false;  ///< a joint is not finite: there is no answer
};

struct SkinnedMesh {
  std::vector<Double3> positions;
  std::vector<Double3> normals;   ///< Empty where the mesh has none.
  std::vector<Double4> tangents;  ///< x y z and the handedness; likewise.
  std::vector<Conditioning> conditioning;
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
Result<SkinnedMesh> skin(const MeshView& mesh, std::span<const JointMatrix> pose, Method method,
                         std::span<const MorphWeight> morphs = {});

}  // namespace dermis::reference
