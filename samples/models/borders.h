// Sharp borders between colors on a mesh whose vertices know nothing of them.
#pragma once

#include <functional>
#include <vector>

#include "mesh.h"
#include "sdf.h"

namespace dermis::models {

// The region that a point of the surface belongs to, as an index into a list of colors.
using RegionAt = std::function<std::size_t(const Vec3&)>;

// Moves vertices along edges onto the borders of regions, and evens out the others about them. The
// surface is where `field` is 0.
void snapToBorders(std::vector<Vec3>& positions, const std::vector<std::uint32_t>& indices,
                   const RegionAt& regionAt, const Field& field);

// Gives each triangle the color of its region, and its vertices the region. A vertex between
// regions is doubled, as it needs two colors.
void paint(Mesh& mesh, const RegionAt& regionAt, const std::vector<Vec3>& colors);

}  // namespace dermis::models
