// Checks of parts of a mesh, for functions that do not read the rest.
#pragma once

#include <cstdint>
#include <span>

#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// Fails unless `pack` takes the mesh for poses of `jointCount` joints.
Result<void> checkPackable(const MeshView& mesh, std::uint32_t jointCount);

/// Fails with `invalidMesh` unless there are vertices and the view of their positions is valid.
Result<void> checkPositions(const MeshView& mesh);

/// Fails with `invalidArgument` unless there are 3 indices per triangle, all of them vertices, and
/// with `limitExceeded` if there are more than 2^32 - 1 triangles.
Result<void> checkTriangles(const MeshView& mesh, std::span<const std::uint32_t> triangles);

}  // namespace dermis
