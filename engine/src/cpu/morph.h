// Adds the displacements of active morph targets to vertices in bind pose.
#pragma once

#include <cstdint>
#include <span>

#include "cpu/mesh_data.h"
#include "dermis/mesh.h"

namespace dermis::cpu {

/// Adds the displacements of the active targets to a block. `positions`, `normals` and `tangents`
/// have three components each; null if not wanted.
void morphBlock(const MeshData& mesh, std::uint32_t block, std::span<const MorphWeight> morphs,
                Lanes* positions, Lanes* normals, Lanes* tangents);

}  // namespace dermis::cpu
