// How near a float32 result must come to the reference, and whether it does: the accuracy contract.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/result.h"
#include "dermis/verify/reference.h"
#include "dermis/vertex_format.h"

namespace dermis {

/// The rounding of float32: half the distance from 1 to the next number, 2^-24.
inline constexpr double floatRounding = 5.9604644775390625e-8;

/// The largest distance between a position in float32 and what a format keeps of it; 0 for float32
/// itself. float16: half a unit of the last place, at most 2^-11 |c| or, below the least normal
/// number, 2^-25 for each component c. snorm16, along each axis of `box`, centre c and half its
/// size h: half a step, h / 32767 / 2, and the roundings of (p − c) / h in float32, 4 u |c| + 8 u
/// h; for what lies inside the box.
DERMIS_VERIFY_API double positionFormatBound(VertexFormat format,
                                             const reference::Double3& position, const Box& box);

/// The same for unit normals. float16: 2^-11. snorm, L = 127 or 32767 its largest integer: √3 times
/// half a step and a rounding, ½ / L + u. Octahedral: √18 δ, δ = ½ / L + 12 u. A step of δ in both
/// components moves the point on the octahedron by (δ, δ, 2δ), of length √6 δ, and no point of it
/// is nearer to the origin than 1 / √3, which divides the step where it is projected onto the
/// sphere.
DERMIS_VERIFY_API double normalFormatBound(VertexFormat format);

/// The same for tangents. Where they are octahedral, the second component has half as many steps:
/// (δ, η, δ + η) with η = 1 / (L − 1) + 12 u, times √3.
DERMIS_VERIFY_API double tangentFormatBound(VertexFormat format);

/// The number of vertices that have no bound. The caller of `compareWithReference` states it; a
/// comparison with any other number fails.
struct Exemptions {
  std::uint64_t onlyFinite = 0;  ///< `VertexBounds::onlyFinite`: only tested for being finite
  std::uint64_t skipped = 0;     ///< `VertexBounds::undefined`: not looked at

  friend bool operator==(const Exemptions&, const Exemptions&) = default;
};

/// The exemptions that the reference reports. Use it for poses from outside; a test that makes its
/// own pose should state the numbers.
DERMIS_VERIFY_API Exemptions exemptionsOf(const reference::SkinnedMesh& expected);

/// What a comparison found. An error is counted against its vertex' own bound: 1 is the bound.
struct Comparison {
  double worstPosition = 0;  ///< the largest error ÷ bound
  double worstNormal = 0;
  double worstTangent = 0;          ///< a wrong handedness counts as an error of 2
  double largestPositionError = 0;  ///< in the mesh's units
  std::uint32_t worstPositionVertex = 0;
  std::uint32_t worstNormalVertex = 0;
  std::uint32_t worstTangentVertex = 0;
  std::uint64_t compared = 0;  ///< vertices held against their bound
  Exemptions exempt;           ///< vertices that were not
  Exemptions expectedExempt;   ///< as many as the caller said
  /// Of the vertices compared, those whose direction was only asked to be of unit length.
  std::uint64_t onlyUnitNormals = 0;
  std::uint64_t onlyUnitTangents = 0;
  std::uint64_t clamped = 0;   ///< vertices that the reference has outside the box of snorm16
  std::uint64_t failures = 0;  ///< vertices outside their bound, or not finite in either
  std::uint32_t firstFailure = 0;

  /// No vertex failed, and as many were compared as should be.
  bool passed() const { return failures == 0 && exempt == expectedExempt; }
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
  SkinnedAttribute positions = {};
  SkinnedAttribute normals = {};   ///< may be absent
  SkinnedAttribute tangents = {};  ///< may be absent
  Box box = {};                    ///< of positions in snorm16
};

/// Compares skinned positions, normals and tangents with the reference's, each against the bound of
/// its vertex plus that of its format. Normals and tangents are compared where both have them.
/// `exemptions` is how many vertices must be left out of that, exactly: none, unless the caller
/// says otherwise. A vertex of the reference that is not finite, or whose bound is not, is a
/// failure unless the reference says that it has no answer.
///
/// A handedness must be the reference's exactly, and 1 or -1 where the sign of the determinant is a
/// matter of rounding; a fourth component of a position must be 1, of a normal 0. A zero direction
/// stays zero, (0, 0, 1) where it is octahedral. A position outside the box of snorm16 is compared
/// with the nearest point of the box. A float16 component is infinite, with the right sign, where
/// the reference's with its bound reaches 65520, half a step above the largest finite number.
///
/// Fails with `invalidArgument` where the counts disagree, a format does not fit its attribute, a
/// stride is less than its element, or the box of snorm16 is not finite or upside down.
DERMIS_VERIFY_API Result<Comparison> compareWithReference(const reference::SkinnedMesh& expected,
                                                          const SkinnedView& actual,
                                                          const Exemptions& exemptions = {});

}  // namespace dermis
