// Morph targets: what the active ones add to vertices in bind pose.
#pragma once

#include <cstdint>
#include <span>

#include "cpu/mesh_data.h"
#include "dermis/mesh.h"

namespace dermis::cpu {

/// Adds to a block what the active targets displace. `lanes` are its positions, normals and
/// tangents, three components each; null if they are not wanted.
void morphBlock(const MeshData& mesh, std::uint32_t block, std::span<const MorphWeight> morphs,
                Lanes* positions, Lanes* normals, Lanes* tangents);

}  // namespace dermis::cpu
