// A box around a skinned mesh, from the pose alone: for culling, and for positions in snorm16,
// which need a box before there are positions. What has to be known of the vertices is gathered
// once, at import; a pose then costs a few microseconds. docs/bounds.md has the proof.
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

/// How far a set of points reaches: `reach[2 i]` is the largest d · p for direction d = i of the 13
/// below, `reach[2 i + 1]` that for −d. -inf for no points at all. A box with its edges and corners
/// cut: it stays tight when it is turned.
struct Extent {
  float reach[26];

  /// Faces, edges and corners of a cube.
  static constexpr std::int8_t directions[13][3] = {
      {1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, -1, 0}, {1, 0, 1},  {1, 0, -1},
      {0, 1, 1}, {0, 1, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};

  bool empty() const { return reach[0] < -reach[1]; }
};

/// Where the vertices lie in bind pose, by the joints that move them. Plain data, made once at
/// import by `jointBounds`. It depends on no pose and on no method, and may be stored with the
/// mesh: `bytes`, `fromBytes`.
struct JointBounds {
  /// A joint that moves vertices.
  struct Joint {
    std::uint32_t joint;  ///< index into the pose
    Extent alone;         ///< of the vertices that this joint moves on its own, in bind space
  };

  /// Two joints that have vertices in common, and the vertices that both of them move.
  struct Pair {
    std::uint32_t first, second;  ///< indices into `joints`, first < second
    std::uint32_t influences;     ///< the most influences that one of the vertices has
    Extent extent;                ///< of the vertices, in bind space
    /// How the joints share the vertices: the least and greatest a = w₁ / (w₂ (k − 1)) and
    /// b = w₂ / (w₁ (k − 1)), and the least a + b, of a vertex with k influences, w₁ the weight of
    /// the first joint and w₂ that of the second.
    float firstOverSecond[2];
    float secondOverFirst[2];
    float leastSum;
  };

  static constexpr float infinity = std::numeric_limits<float>::infinity();
  /// Above this number of influences a vertex adds no trios.
  static constexpr std::uint32_t mostInfluencesOfTrio = 8;

  std::vector<Joint> joints;  ///< by rising pose index
  std::vector<Pair> pairs;    ///< by rising first, then second
  /// Three joints that have vertices in common: indices into `joints`, rising.
  std::vector<std::array<std::uint32_t, 3>> trios;
  /// Of the vertices without weight, which stay in bind pose; min > max for none.
  Box unweighted{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
  std::uint32_t requiredJoints = 0;  ///< minimum joints of a pose: the largest index + 1

  /// To be stored: little-endian words with a version and a checksum.
  DERMIS_CORE_API std::vector<std::byte> bytes() const;
  /// Reads them back, checked so that `skinnedBounds` is safe with the result. Fails with
  /// `invalidData` (damaged), or `unsupportedVersion`.
  DERMIS_CORE_API static Result<JointBounds> fromBytes(std::span<const std::byte> bytes);
};

/// The weights that a morph target is given, whatever the pose.
struct MorphRange {
  float min = 0;
  float max = 1;
};

/// Gathers what `skinnedBounds` has to know of a mesh for poses of `jointCount` joints.
/// O(vertices × influences²). Morph targets may move every vertex by every combination of weights
/// within `morphRanges`, one a target; empty: 0 to 1 for each. A mesh that is drawn without its
/// morph targets gets a tighter box from a view without them. Fails with `invalidMesh` where `pack`
/// would refuse the mesh, or a morph target does not fit it, and with `invalidArgument` for a
/// `jointCount` of 0 or above `maxPoseJoints`, or for ranges that are not finite, not in order
/// or not one a target.
DERMIS_CORE_API Result<JointBounds> jointBounds(const MeshView& mesh, std::uint32_t jointCount,
                                                std::span<const MorphRange> morphRanges = {});

/// A box that holds every position that a kernel or the reference makes of the mesh in this pose,
/// rounding included, in the pose's space. `pose` is what the mesh is skinned with: joint
/// global transform × inverse bind matrix.
///
/// For `linear`, `dualQuaternion` and `blended`; of the other methods nothing is proven, and the
/// box is infinite. A few percent larger than it need be in ordinary poses; docs/bounds.md has the
/// formulas, the proof and numbers. Joints that move no vertex have no effect, whatever their
/// matrices. The box is infinite (from -inf to inf) where a joint that moves vertices is not finite
/// or outside the pose, or the mesh reaches beyond 1e38, and its sides may be infinite where
/// numbers leave the range of float32: ask `std::isfinite` before it becomes a format's box. It
/// never has a NaN. A default-made `JointBounds` gives min > max.
///
/// O(joints + pairs + trios); allocates only above 128 joints that move vertices, and needs
/// 32 KiB of stack. Any thread.
DERMIS_CORE_API Box skinnedBounds(const JointBounds& bounds, std::span<const JointMatrix> pose,
                                  Method method);

}  // namespace dermis
