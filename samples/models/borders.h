// Makes borders between colors sharp on a mesh that was created without them.
#pragma once

#include <functional>
#include <vector>

#include "mesh.h"
#include "sdf.h"

namespace dermis::models {

// The region that a point of the surface belongs to, as an index into a list of colors.
using RegionAt = std::function<std::size_t(const Vec3&)>;

// Moves vertices along edges onto the borders of regions, and smooths the vertices next to them.
// The surface is where `field` is 0.
void snapToBorders(std::vector<Vec3>& positions, const std::vector<std::uint32_t>& indices,
                   const RegionAt& regionAt, const Field& field);

// Assigns each triangle to a region, and the region and its color to its vertices. A vertex between
// regions is duplicated, because it needs several colors.
void paint(Mesh& mesh, const RegionAt& regionAt, const std::vector<Vec3>& colors);

}  // namespace dermis::models
