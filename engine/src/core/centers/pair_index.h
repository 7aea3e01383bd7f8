// Index of triangles by the pairs of joints that move them. A pair that a vertex and a triangle do
// not share adds nothing to their similarity.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "pack/influences.h"

namespace dermis::centers {

using Influence = PackedInfluence;

/// Σ weight · (centroid, 1). (x, y, z) / sum is a center.
struct Moment {
  double x = 0, y = 0, z = 0, sum = 0;

  void add(const Moment& other, double factor) {
    x += factor * other.x;
    y += factor * other.y;
    z += factor * other.z;
    sum += factor * other.sum;
  }
};

/// Triangles with the same influences, which are the mean of their vertices'. Their similarity to
/// any vertex is the same, so one sum of moments represents them all. `influences` are in ascending
/// order of joints.
struct Group {
  std::span<const Influence> influences;
  Moment moment;  ///< weighted by area
};

class PairIndex {
 public:
  explicit PairIndex(std::span<const Group> groups);

  /// Adds the contribution of two influences of a vertex to its center: the moments of all groups,
  /// times their similarity for this pair. Callers pass each pair in one order only: the factor of
  /// 2 cancels when the moment is divided by its sum.
  void addSimilar(const Influence& first, const Influence& second, Moment& sum) const;

  /// Number of groups that have both joints.
  std::size_t entryCount(const Influence& first, const Influence& second) const;

 private:
  static_assert(maxPoseJoints <= 65536, "the keys have 16 bits a joint");

  struct Range {
    std::size_t first = 0, last = 0;
  };

  /// Null if no group has both joints.
  const Range* rangeOf(const Influence& first, const Influence& second) const;

  std::unordered_map<std::uint32_t, Range> ranges_;
  /// A group has an entry for each pair of its joints. The entries of one pair are consecutive,
  /// padded to a multiple of 8 (`lanes`) with entries of weight 0.
  std::vector<double> lowWeights_, highWeights_;
  std::vector<std::uint32_t> groups_;
  std::vector<Moment> moments_;  ///< by group
};

}  // namespace dermis::centers
