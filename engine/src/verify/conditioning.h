// What the accuracy of a float32 result depends on at a vertex, and the bounds that follow from it.
// The methods fill it in while they skin; callers of the library see the bounds only.
#pragma once

#include <span>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/method.h"
#include "dermis/result.h"
#include "dermis/types.h"
#include "dermis/verify/reference.h"

namespace dermis::reference {

/// p, n and t are the position, normal and tangent in bind pose after morphing; u = 2^-24.
struct Conditioning {
  double scale = 0;     ///< max |t_j| + max σ_j |p| over the influences; σ_j the largest singular
                        ///< value of joint j
  double stretch = 1;   ///< max σ_j; 1 for a vertex without weight
  double distance = 0;  ///< |p|, from the origin of the bind pose; if there is a center of
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
  /// A length that counts besides the scale: twice max σ_j times the center of rotation's distance
  /// from the origin (`centerOfRotation`, `bulgeControlled`), how far differences of rotations that
  /// all but agree throw the center (`sphericalBlend`: |r| + max |t_a − t_b| / σ, σ the least
  /// singular value that is made use of), and what is left of the errors of earlier steps
  /// (`dualQuaternionIterative`: scale · (`turning` − 1)).
  double leverage = 0;
  /// |b|, the length of the blended quaternion before it is normalized: at least the greatest
  /// weight, and so at least 1/4 for up to four influences. 1 for `linear` and `logMatrix`.
  double blendLength = 1;
  double turning = 1;  ///< `dualQuaternionIterative`: 1 / (1 − ρ), ρ the factor by which steps
                       ///< shrink
  double normalLength = 1;   ///< `blended`: of the sum of both unit normals, which is normalized
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

/// The largest distance a float32 position may have from the reference's: 6 u · scale for `linear`,
/// 24 u · A² · (scale + `leverage`) for the others, u = `floatRounding`, A = max(1, 1 / (4 |b|)),
/// |b| = `blendLength`. A joint that is rigid but for rounding (det > 0, ‖CᵀC − 1‖∞ ≤ 8e-6) is
/// not decomposed by the kernels: `rigidShortcut` · `distance` more. Inputs that are no float32,
/// and morph targets: u · `positionRounding` · `stretch` more. As a GPU may flush denormals to 0:
/// 2^-120 (1 + `distance`) more.
///
/// Holds for every device that computes as Vulkan demands, division, `sqrt` and `inversesqrt` as
/// inexact as it allows; docs/accuracy.md says what of it is derived and what is fitted.
double positionBound(Method method, const Conditioning& conditioning);

/// The largest distance between a float32 unit normal and the reference's. Turned by a blended
/// rotation: 1.5e-6 · `turning` · A + `rigidShortcut`. Through the blended 3×3 M of `linear`: 6 u
/// / a + 2 u, a = `normalAlignment`. In two phases a normal goes through M, (6 u + 2
/// `rigidShortcut`) / a, and then is turned, so that both errors add up; those of `blended` are
/// divided by `normalLength`. What the bind pose is off by, u · `normalRounding`, is divided by a
/// as well, and so is what flushed denormals change in M, 2^-120 / `stretch`. Negative where a
/// normal is only asked to be finite and of unit length: a · `normalLength` < 1e-3, or a bind pose
/// off by more than 0.05 a, so that displacements all but cancel.
double normalBound(Method method, const Conditioning& conditioning);

/// The same for tangents, with `tangentAlignment`, `tangentRounding`, `tangentLength` and
/// `rigidShortcut` once instead of twice.
double tangentBound(Method method, const Conditioning& conditioning);

/// All bounds of a vertex.
VertexBounds boundsOf(Method method, const Conditioning& conditioning);

/// A skinned mesh and what its bounds follow from, one entry a vertex.
struct AnalyzedMesh : SkinnedMesh {
  std::vector<Conditioning> conditioning;
};

/// `skin`, with the conditioning.
Result<AnalyzedMesh> analyze(const MeshView& mesh, std::span<const JointMatrix> pose, Method method,
                             std::span<const MorphWeight> morphs = {});

}  // namespace dermis::reference
