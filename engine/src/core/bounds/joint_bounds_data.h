// The contents of `JointBounds`.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/result.h"

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

struct JointBoundsData {
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

  /// Vertices with more influences than this add no trios.
  static constexpr std::uint32_t maxTrioInfluences = 8;

  static constexpr float farthest = std::numeric_limits<float>::infinity();

  std::vector<Joint> joints;  ///< by ascending index into the pose
  std::vector<Pair> pairs;    ///< by ascending `first`, then `second`
  /// Three joints that have vertices in common: ascending indices into `joints`.
  std::vector<std::array<std::uint32_t, 3>> trios;
  /// Box of the vertices without weight, which stay in bind pose. min > max if there are none.
  Box unweighted{{farthest, farthest, farthest}, {-farthest, -farthest, -farthest}};
  std::uint32_t requiredJoints = 0;  ///< minimum joints of a pose: the largest index + 1

  static JointBounds joined(JointBoundsData data);
  DERMIS_CORE_API static const JointBoundsData& of(const JointBounds& bounds);

  DERMIS_CORE_API std::vector<std::byte> bytes() const;
  static Result<JointBoundsData> fromBytes(std::span<const std::byte> bytes);
};

}  // namespace dermis
