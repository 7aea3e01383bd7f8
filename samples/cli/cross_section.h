// Measures how much of the cross-section of a limb is left after skinning.
#pragma once

#include <span>

#include "dermis/gltf.h"

namespace dermis::cli {

/// The range of the sections, across the x axis of bind space.
struct SectionRange {
  double from = 0, to = 0;
};

/// The smallest area that a section of a closed mesh has when it is skinned, as a share of what it
/// has in bind pose. A section is where a plane cuts the mesh in bind pose, moved along with the
/// skin; its area is that of its projection onto the plane in which it is largest. `positions` are
/// the skinned ones. 1 where no plane meets the mesh.
double leastSection(const gltf::Primitive& primitive, std::span<const float> positions,
                    const SectionRange& range);

}  // namespace dermis::cli
