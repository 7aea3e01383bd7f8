// Computes normals for a mesh that has none. This is done once, at import, before `pack`.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dermis/export.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// Smooth normals: that of a vertex is the mean of the normals of its triangles, weighted by their
/// areas. `triangles` has 3 vertex indices per triangle, counterclockwise as seen from outside. Of
/// `mesh`, only the positions are read; it need not have influences. Returns 3 floats per vertex,
/// of unit length. A vertex without triangles, or for which the mean has no direction, gets 0 0 1.
/// Vertices at the same place have normals of their own. O(vertices + indices).
///
/// Fails with `invalidMesh` if `validate` would refuse the view of the positions, and with
/// `invalidArgument` if the number of indices is not a multiple of 3, or a vertex does not exist.
DERMIS_CORE_API Result<std::vector<float>> smoothNormals(const MeshView& mesh,
                                                         std::span<const std::uint32_t> triangles);

/// Flat normals: those of the triangles, as glTF 2.0 demands for meshes without normals. Vertices
/// have to be repeated for them: vertex i of the new mesh is vertex `triangles[i]` of this one.
/// Returns 3 floats per vertex of the new mesh; a triangle without area gets 0 0 1. Otherwise as
/// `smoothNormals`.
DERMIS_CORE_API Result<std::vector<float>> flatNormals(const MeshView& mesh,
                                                       std::span<const std::uint32_t> triangles);

}  // namespace dermis
