// Morph targets as kernels read them: the displaced vertices only.
#pragma once

#include <cstdint>
#include <vector>

#include "dermis/mesh.h"

namespace dermis {

/// Appends the records of all morph targets, then their blocks and displacements; returns the word
/// at which the records begin. Attributes that the mesh lacks are left out.
std::uint32_t appendMorphs(const MeshView& mesh, std::vector<std::uint32_t>& words);

}  // namespace dermis
