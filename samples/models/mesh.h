// The geometry of a sample model.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "maths.h"

namespace dermis::models {

// Up to four influences; unused ones are joint 0 with weight 0. The weights are multiples of
// 1/65536 and sum to exactly 1, also as floats.
struct Influences {
  std::array<std::uint16_t, 4> joints{};
  std::array<float, 4> weights{};
};

struct Mesh {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;
  std::vector<Vec3> colors;          // linear red, green, blue, 0 to 1
  std::vector<std::size_t> regions;  // the region of each vertex; empty if not requested
  std::vector<Influences> influences;
  std::vector<std::uint32_t> indices;  // triangles, counterclockwise seen from outside
};

// A named set of regions of a mesh.
struct Part {
  std::string name;
  std::vector<std::size_t> regions;
};

// The vertices of the part, in the order of the mesh, and its triangles. No triangle of the mesh
// may have corners in two regions, and every vertex of the part must belong to a triangle.
Mesh partOf(const Mesh& mesh, const Part& part);

// The neighbors of each vertex along triangle edges, in ascending order.
std::vector<std::vector<std::uint32_t>> neighborsOf(std::size_t vertexCount,
                                                    const std::vector<std::uint32_t>& indices);

// Unit normals of the vertices: the mean normal of the adjacent triangles, weighted by area.
std::vector<Vec3> smoothNormals(const std::vector<Vec3>& positions,
                                const std::vector<std::uint32_t>& indices);

}  // namespace dermis::models
