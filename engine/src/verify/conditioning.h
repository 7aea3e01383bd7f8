// What the accuracy of a float32 result depends on at a vertex, and the bounds that follow from it.
// The methods fill it in while they skin; callers of the library see only the bounds.
#pragma once

#include <span>
#include <vector>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/result.h"
#include "dermis/verify.h"

namespace dermis::reference {

/// Effect of denormals that a GPU flushes to 0: 1024 numbers per vertex below 2^-126, the least
/// normal number.
inline constexpr double flushed = 0x1p-116;

/// p, n and t are the position, normal and tangent in bind pose after morphing; u = 2^-24.
struct Conditioning {
  double scale = 0;     ///< max |t_j| + max σ_j |p| over the influences; σ_j the largest singular
                        ///< value of joint j
  double stretch = 1;   ///< max σ_j; 1 for a vertex without weight
  double distance = 0;  ///< |p|, from the origin of the bind pose; for methods that need a center
                        ///< of rotation c: |p| + 2 |c|
  double rigidShortcut = 0;  ///< max |σ − 1| of the joints that kernels treat as rigid
  /// Maximum error of the bind pose in float32, in units of u: for p in the mesh's units, for
  /// directions times |n| and |t|. One rounding for a stored value that is not a float32; two for
  /// each target that displaces the vertex (w d, and the sum), three if its d is not a float32;
  /// each of them at most u (|p| + Σ |w_i d_i|). 0 for float32 without morphs; infinite if
  /// displacements cancel a direction.
  double positionRounding = 0;
  double normalRounding = 0;
  double tangentRounding = 0;
  /// |adjᵀ(M) n| / (max σ_j σ_max |n|), M the blended 3×3 and σ_max its largest singular value: if
  /// joints cancel in a blend, the remainder has the rounding error of the joints.
  double normalAlignment = 1;
  double tangentAlignment = 1;  ///< |M t| / (max σ_j |t|), likewise
  /// A length that is added to the scale: twice max σ_j times the center of rotation's distance
  /// from the origin (`centerOfRotation`, `bulgeControlled`); how far differences of nearly equal
  /// rotations move the center (`sphericalBlend`: |r| + max |t_a − t_b| / σ, σ the smallest
  /// singular value that is used); and what remains of the errors of earlier steps
  /// (`dualQuaternionIterative`: scale · (`turning` − 1)).
  double leverage = 0;
  /// |b|, the length of the blended quaternion before it is normalized: at least the greatest
  /// weight, and so at least 1/4 for up to four influences. 1 for `linear` and `logMatrix`.
  double blendLength = 1;
  double turning = 1;  ///< `dualQuaternionIterative`: 1 / (1 − ρ), ρ the factor by which steps
                       ///< shrink
  double normalLength = 1;   ///< `blended`: length of the sum of both unit normals, which is
                             ///< normalized
  double tangentLength = 1;  ///< likewise
  bool normalRotatedOnly =
      true;  ///< directions are only rotated: all joints of the vertex count as rigid in the
             ///< kernels, and the method is neither `linear` nor `blended`
  bool handednessAmbiguous = false;  ///< |det M| ≤ (1e-5 max σ_j + 2^-116) σ_max²: rounding or
                                     ///< flushed denormals decide its sign
  /// The result is discontinuous here, and rounding decides between its values: |dot| with the
  /// pivot below 1e-5; `logMatrix`: a joint rotated by 180° within 2e-5; `dualQuaternionIterative`:
  /// a joint nearly opposite to the blend; `sphericalBlend`: a singular value within 1e-5 of the
  /// limit 1e-3, up to which it is not used.
  bool signAmbiguous = false;
  bool degenerate = false;  ///< a joint is degenerate (`Joint::degenerate`) or not finite: a result
                            ///< only has to be finite
  bool undefined = false;   ///< a joint is not finite: no result is defined
  /// The normal or tangent, before it is normalized, or a summand of it is longer than 2^100; or
  /// its length is not 0, but below 2^-100.
  bool directionOutOfRange = false;
};

/// Maximum distance of a float32 position from the reference's: 6 u · scale for `linear`, 24 u · A²
/// · (scale + `leverage`) for the others, where u = `floatRounding`, A = max(1, 1 / (4 |b|)), |b| =
/// `blendLength`. The kernels do not decompose a joint that is rigid except for rounding (det > 0,
/// ‖CᵀC − 1‖∞ ≤ 8e-6); except for `linear`, this adds `rigidShortcut` · `distance`. Inputs that are
/// not float32, and morph targets, add u · `positionRounding` · `stretch`. A GPU may flush
/// denormals to 0, which adds 2^-116 (1 + `distance` + `stretch`).
///
/// Holds for every device that computes as Vulkan requires, with division, `sqrt` and `inversesqrt`
/// as inaccurate as it permits. docs/accuracy.md says which parts are derived and which are fitted.
double positionBound(Method method, const Conditioning& conditioning);

/// Maximum distance between a float32 unit normal and the reference's. Negative if a normal only
/// has to be finite and of unit length. With turn = 1.5e-6 · `turning` · A, bind = u ·
/// `normalRounding`, a = `normalAlignment`, l = `normalLength` (1 except for `blended`), and f =
/// 2^-116 / `stretch` for the change of M by flushed denormals:
/// - blended rotations of rigid joints: turn + `rigidShortcut` + bind; negative if bind > 0.05;
/// - the blended 3×3 M of `linear`: (6 u + bind + f) / a + 2 u;
/// - two phases, M and then a rotation: ((6 u + 2 `rigidShortcut` + bind + f) / a + turn) / l.
/// The last two are negative if a · l < 1e-3, or if bind + f > 0.05 · a · l because displacements
/// nearly cancel.
double normalBound(Method method, const Conditioning& conditioning);

/// The same for tangents, with `tangentAlignment`, `tangentRounding` and `tangentLength`, and with
/// `rigidShortcut` once instead of twice.
double tangentBound(Method method, const Conditioning& conditioning);

/// All bounds of a vertex. It is out of range if a direction is, or if `scale`, `distance`,
/// `stretch`, `stretch` · `distance` or `positionRounding` exceeds 2^100.
VertexBounds boundsOf(Method method, const Conditioning& conditioning);

/// A skinned mesh and the conditioning that its bounds follow from, one entry per vertex.
struct AnalyzedMesh : SkinnedMesh {
  std::vector<Conditioning> conditioning;
};

/// Like `skin`, with the conditioning.
Result<AnalyzedMesh> analyze(const MeshView& mesh, std::span<const JointMatrix> pose, Method method,
                             std::span<const MorphWeight> morphs = {});

}  // namespace dermis::reference
