// Computes normals for a mesh that has none.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace dermis::cli {

/// Area-weighted normals of the triangles (3 indices each, all within `positions`, 3 floats per
/// vertex). A vertex without triangles gets 0 0 1.
std::vector<float> computeNormals(std::span<const float> positions,
                                  std::span<const std::uint32_t> triangles);

}  // namespace dermis::cli
