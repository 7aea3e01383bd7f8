// The influences of a vertex as kernels read them.
#pragma once

#include <cstdint>
#include <vector>

#include "dermis/mesh.h"

namespace dermis {

struct PackedInfluence {
  std::uint32_t joint = 0;
  double weight = 0;  ///< a float32's value
};

/// The influences of a vertex whose weight is not 0, in the units of `loadWeight`.
void gatherInfluences(const MeshView& mesh, std::uint32_t vertex,
                      std::vector<PackedInfluence>& influences);

/// Adds those of the same joint, in an order that does not depend on theirs. Ascending joints.
void mergeJoints(std::vector<PackedInfluence>& influences);

/// The influences of a vertex: those of the same joint are added, and those of weight 0 dropped.
/// The pivot is first, the rest by descending weight. The weights sum to exactly 1; empty if the
/// vertex has none.
void packInfluences(const MeshView& mesh, std::uint32_t vertex,
                    std::vector<PackedInfluence>& influences);

}  // namespace dermis
