// Centres of rotation for what a glTF file holds.
#pragma once

#include <cstdint>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/result.h"

namespace dermis::cli {

/// The centres of rotation of each primitive of a mesh, 3 floats a vertex; none for one without
/// influences. They are found together, so that primitives agree where they meet. Shows progress.
Result<std::vector<std::vector<float>>> centersOfMesh(const gltf::Mesh& mesh,
                                                      std::uint32_t jointCount);

}  // namespace dermis::cli
