// Fewer triangles for what is small in a picture, over the same skinned vertices.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "character.h"

namespace crowd {

/// Each part's triangles between the vertices that stand for all others in a cell of a grid
/// (Rossignac and Borrel 1993, "Multi-resolution 3D approximations"). What parts have in common
/// stays so: there is no gap between a shirt and a neck. `cell`: the side of one, as a share of the
/// longest side of the box around all parts in their bind pose.
std::vector<std::vector<std::uint32_t>> coarseTriangles(std::span<const Part> parts, double cell);

}  // namespace crowd
