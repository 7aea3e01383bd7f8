// Smooths the mesh of a polygonized surface; vertices stay on the surface.
#pragma once

#include "mesh.h"
#include "polygonize.h"

namespace dermis::models {

// Moves each vertex towards the mean of its neighbors and then back onto the surface, `steps`
// times.
void relax(QuadMesh& mesh, const Field& field, int steps);

// Moves each vertex onto the surface.
void project(std::vector<Vec3>& positions, const Field& field);

// Splits each quad into two triangles, so that the worse triangle has the best possible shape.
std::vector<std::uint32_t> triangulate(const QuadMesh& mesh);

}  // namespace dermis::models
