// How near a float32 result must come to the reference, and whether it does: the accuracy contract.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "dermis/mesh.h"
#include "dermis/method.h"
#include "dermis/reference.h"
#include "dermis/result.h"
#include "dermis/vertex_format.h"

namespace dermis {

/// The rounding of float32: half the distance from 1 to the next number, 2^-24.
inline constexpr double floatRounding = 5.9604644775390625e-8;

/// The largest distance a float32 position may have from the reference's: 6 u · scale for `linear`,
/// 24 u · scale for `dualQuaternion`, u = `floatRounding`. A joint that is rigid but for rounding
/// (det > 0, ‖CᵀC − 1‖∞ ≤ 8e-6) is not decomposed by the kernels: `rigidShortcut` · |p| more, at
/// most 4e-6 |p|.
double positionBound(Method method, const reference::Conditioning& conditioning);

/// The largest distance between a float32 unit normal and the reference's. Turned by a blended dual
/// quaternion: 1.5e-6 (and `rigidShortcut`, as above). Through a blended 3×3 M: 6 u / a, a =
/// `normalAlignment`. In two phases a normal goes through M and then is turned, so that both errors
/// add up. Negative where a normal is only asked to be finite and of unit length (a < 1e-3).
double normalBound(Method method, const reference::Conditioning& conditioning);

/// What a comparison found. An error is counted against its vertex' own bound: 1 is the bound.
struct Comparison {
  double worstPosition = 0;  ///< the largest error ÷ bound
  double worstNormal = 0;
  double largestPositionError = 0;  ///< in the mesh's units
  std::uint32_t worstPositionVertex = 0;
  std::uint32_t worstNormalVertex = 0;
  std::uint64_t compared = 0;  ///< vertices held against their bound
  std::uint64_t onlyFinite =
      0;                      ///< vertices whose answer is a matter of rounding: asked to be finite
  std::uint64_t skipped = 0;  ///< vertices not looked at: a joint of theirs is not finite
  std::uint64_t failures = 0;  ///< vertices outside their bound, or not finite
  std::uint32_t firstFailure = 0;

  bool passed() const { return failures == 0; }
};

/// One attribute of skinned vertices where it stands in an output buffer. No alignment is needed.
struct SkinnedAttribute {
  const void* data = nullptr;  ///< vertex 0's; null where there is none
  std::uint32_t count = 0;     ///< vertices
  std::uint32_t stride = 0;    ///< bytes
  VertexFormat format = VertexFormat::none;
};

/// What a kernel made of a mesh.
struct SkinnedView {
  SkinnedAttribute positions;
  SkinnedAttribute normals;   ///< may be absent
  SkinnedAttribute tangents;  ///< may be absent
  Box box;                    ///< of positions in snorm16
};

/// Compares skinned positions, normals and tangents with the reference's, each against the bound of
/// its method and format. A vertex with a joint that is not finite is not looked at. Fails with
/// `invalidArgument` where the counts disagree, or a format does not fit its attribute.
Result<Comparison> compare(const reference::SkinnedMesh& expected, const SkinnedView& actual,
                           Method method);

Result<Comparison> compare(const reference::SkinnedMesh& expected, const AttributeView& positions,
                           const AttributeView& normals, Method method);

}  // namespace dermis
