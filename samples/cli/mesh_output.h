// Skinned triangles on their way into a file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "dermis/result.h"

namespace dermis::cli {

struct OutputMesh {
  std::vector<float> positions;          ///< 3 a vertex
  std::vector<float> normals;            ///< 3 a vertex
  std::vector<std::uint32_t> triangles;  ///< 3 indices each
};

/// Area-weighted normals of the triangles; 0 0 1 for a vertex in none.
std::vector<float> computeNormals(const std::vector<float>& positions,
                                  const std::vector<std::uint32_t>& triangles);

/// Adds a part behind the others. Triangles whose indices lie outside the part must have been
/// refused before.
void append(OutputMesh& whole, const OutputMesh& part);

/// Vertices with a position or normal that is NaN or infinite.
std::size_t countNonFinite(const OutputMesh& mesh);

/// Binary little-endian PLY: float x y z nx ny nz, then the faces. Written to a temporary name
/// first, so that no half file is left behind. Fails with `ioError`.
Result<void> writePly(const std::filesystem::path& path, const OutputMesh& mesh);

}  // namespace dermis::cli
