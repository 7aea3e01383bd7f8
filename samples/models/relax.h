// Evens out a polygonized surface without leaving it.
#pragma once

#include "mesh.h"
#include "polygonize.h"

namespace dermis::models {

// Moves each vertex towards the middle of its neighbors along the surface and back onto it,
// `steps` times.
void relax(QuadMesh& mesh, const Field& field, int steps);

// Moves each vertex onto the surface.
void project(std::vector<Vec3>& positions, const Field& field);

// Two triangles for each quad, split so that the worse one of them is as even as can be.
std::vector<std::uint32_t> triangulate(const QuadMesh& mesh);

}  // namespace dermis::models
