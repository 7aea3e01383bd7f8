// Fewer triangles, over the same skinned vertices, for figures that are small in a picture.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "character.h"

namespace crowd {

/// Simplifies the triangles of each part by vertex clustering: one vertex represents all others in
/// its cell of a grid (Rossignac and Borrel 1993, "Multi-resolution 3D approximations"). Parts stay
/// connected: no gap opens between a shirt and a neck. `cell` is the side of a cell, as a fraction
/// of the longest side of the box around all parts in bind pose.
std::vector<std::vector<std::uint32_t>> coarseTriangles(std::span<const Part> parts, double cell);

}  // namespace crowd
