// Normals for a mesh that has none.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace dermis::cli {

/// Area-weighted normals of the triangles (3 indices each, all within `positions`, 3 floats a
/// vertex); 0 0 1 for a vertex in none.
std::vector<float> computeNormals(std::span<const float> positions,
                                  std::span<const std::uint32_t> triangles);

}  // namespace dermis::cli
