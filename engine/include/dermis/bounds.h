// Computes a box around a skinned mesh from its pose, without skinning it. Engines need such a box
// for culling, and for snorm16 positions, which are relative to a box. `jointBounds` collects what
// is needed about the vertices, once, at import. `skinnedBounds` then takes a few microseconds for
// a pose. docs/bounds.md has the proof.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/method.h"
#include "dermis/result.h"
#include "dermis/types.h"

namespace dermis {

/// The extent of a set of points along 26 directions: a box with its edges and corners cut off,
/// which stays tight when it is rotated.
struct Extent {
  /// `reach[2 i]` is the maximum of d · p over all points p, with d = `directions[i]`.
  /// `reach[2 i + 1]` is the same for −d. All are -inf if there are no points.
  float reach[26];

  /// Towards the faces, edges and corners of a cube.
  static constexpr std::int8_t directions[13][3] = {
      {1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, -1, 0}, {1, 0, 1},  {1, 0, -1},
      {0, 1, 1}, {0, 1, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};

  /// Whether there are no points.
  bool empty() const { return reach[0] < -reach[1]; }
};

/// The extents of the vertices in bind pose, grouped by the joints that move them. Plain data.
/// `jointBounds` makes it once, at import. It does not depend on pose and method, and may be stored
/// with the mesh (`bytes`, `fromBytes`).
struct JointBounds {
  /// A joint that moves vertices.
  struct Joint {
    std::uint32_t joint;  ///< index into the pose
    Extent alone;         ///< in bind space, of the vertices that only this joint moves
  };

  /// Two joints that have vertices in common, and these vertices.
  struct Pair {
    std::uint32_t first, second;  ///< indices into `joints`, first < second
    std::uint32_t influences;     ///< maximum influences of the vertices
    Extent extent;                ///< of the vertices, in bind space
    /// Minimum and maximum over the vertices of a = w₁ / (w₂ (k − 1)): k is the number of
    /// influences of the vertex, w₁ and w₂ are the weights of the first and second joint.
    float firstOverSecond[2];
    float secondOverFirst[2];  ///< the same for b = w₂ / (w₁ (k − 1))
    float minSum;              ///< minimum of a + b
  };

  static constexpr float infinity = std::numeric_limits<float>::infinity();
  /// Vertices with more influences than this add no trios.
  static constexpr std::uint32_t maxTrioInfluences = 8;

  std::vector<Joint> joints;  ///< by ascending index into the pose
  std::vector<Pair> pairs;    ///< by ascending `first`, then `second`
  /// Three joints that have vertices in common: ascending indices into `joints`.
  std::vector<std::array<std::uint32_t, 3>> trios;
  /// Box of the vertices without weight, which stay in bind pose. min > max if there are none.
  Box unweighted{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
  std::uint32_t requiredJoints = 0;  ///< minimum joints of a pose: the largest index + 1

  /// The data as little-endian words with a version and a checksum, to store it.
  DERMIS_CORE_API std::vector<std::byte> bytes() const;
  /// Reads what `bytes` returned. It is checked, so that `skinnedBounds` never reads out of range.
  /// Fails with `invalidData` if it is damaged, or with `unsupportedVersion`.
  DERMIS_CORE_API static Result<JointBounds> fromBytes(std::span<const std::byte> bytes);
};

/// The range of weights that a morph target will have.
struct MorphRange {
  float min = 0;
  float max = 1;
};

/// Collects what `skinnedBounds` needs to know about a mesh, for poses of `jointCount` joints.
/// O(vertices × influences²).
///
/// The boxes hold for all combinations of morph weights within `morphRanges`, which has one element
/// for each morph target. If it is empty, all ranges are 0 to 1. For a mesh that is drawn without
/// its morph targets, pass a view without them: the box is tighter.
///
/// Fails with `invalidMesh` if `pack` refuses the mesh or a morph target does not fit it. Fails
/// with `invalidArgument` if `jointCount` is 0 or above `maxPoseJoints`, if a range is not finite
/// or its minimum is above its maximum, or if the number of ranges is wrong.
DERMIS_CORE_API Result<JointBounds> jointBounds(const MeshView& mesh, std::uint32_t jointCount,
                                                std::span<const MorphRange> morphRanges = {});

/// A box that contains every position that the kernels or the reference compute for the mesh in
/// this pose, including rounding errors. It is in the space of the pose. In ordinary poses it is a
/// few percent larger than necessary; docs/bounds.md has the formulas, the proof and numbers.
///
/// `mayScale` is that of the pose (`PoseDescription::mayScale`). If false, the box is that of the
/// joints without their scale, except for `linear`, which always scales.
///
/// There is a proof for `linear`, `dualQuaternion` and `blended`. For all other methods the box is
/// infinite.
///
/// The box is infinite (from -inf to inf), too, if a joint that moves vertices is not finite or is
/// outside the pose, or if the mesh reaches beyond 1e38. A side may be infinite if numbers leave
/// the range of float32. So check the box with `std::isfinite` before you use it for snorm16. It
/// never contains a NaN. Joints that move no vertices have no effect. For a default-constructed
/// `JointBounds` and a method with a proof the box has min > max.
///
/// O(joints + pairs + trios). Any thread. Needs 32 KiB of stack, and allocates only if more than
/// 128 joints move vertices.
DERMIS_CORE_API Box skinnedBounds(const JointBounds& bounds, std::span<const JointMatrix> pose,
                                  Method method, bool mayScale = true);

}  // namespace dermis
