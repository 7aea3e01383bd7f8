// From a field to quads: surface nets (Gibson, "Constrained Elastic Surface Nets", 1998) with a
// vertex for each sheet of the surface in a cell, as in dual marching cubes (Nielson, 2004).
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

// The grid of cells of size `cell` that holds the box from `low` to `high`, with the same middle.
Grid gridOver(const Vec3& low, const Vec3& high, double cell);

using Quad = std::array<std::uint32_t, 4>;

struct QuadMesh {
  std::vector<Vec3> positions;
  std::vector<Quad> quads;  // counter-clockwise seen from outside
};

// A vertex in each cell that the surface crosses, a quad for each grid edge that it crosses. The
// surface must stay inside the grid.
QuadMesh polygonize(const Field& field, const Grid& grid);

}  // namespace dermis::models
