// Converts a field to quads by surface nets (Gibson, "Constrained Elastic Surface Nets", 1998). A
// cell has a vertex for each sheet of the surface in it, as in dual marching cubes (Nielson, 2004).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sdf.h"

namespace dermis::models {

struct Grid {
  Vec3 low;
  double cell;
  std::array<int, 3> cells;  // along x, y, z
};

// The grid with cells of size `cell` that contains the box from `low` to `high` and has the same
// center.
Grid gridOver(const Vec3& low, const Vec3& high, double cell);

using Quad = std::array<std::uint32_t, 4>;

struct QuadMesh {
  std::vector<Vec3> positions;
  std::vector<Quad> quads;  // counterclockwise seen from outside
};

// Makes vertices in each cell that the surface crosses, and a quad for each grid edge that it
// crosses. The surface must be inside the grid.
QuadMesh polygonize(const Field& field, const Grid& grid);

}  // namespace dermis::models
