// Measures how much of a limb's cross-section remains after skinning.
#pragma once

#include <span>

#include "dermis/gltf.h"

namespace dermis::cli {

/// The sections are perpendicular to the x axis of bind space, from `from` to `to`.
struct SectionRange {
  double from = 0, to = 0;
};

/// The smallest ratio of a section's area after skinning to its area in bind pose. The mesh must be
/// closed. A section is the intersection of a plane and the mesh in bind pose, moved with the skin.
/// Its area is that of its projection onto the plane in which it is largest. `positions` are the
/// skinned positions. 1 if no plane meets the mesh.
double leastSection(const gltf::Primitive& primitive, std::span<const float> positions,
                    const SectionRange& range);

}  // namespace dermis::cli
