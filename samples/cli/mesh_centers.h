// Centers of rotation for the meshes of a glTF file.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/result.h"

namespace dermis::cli {

/// Computes the centers of rotation of the meshes of one file, once for each mesh.
class MeshCenters {
 public:
  /// `mostTerms` limits the terms of the sums of all meshes together; each takes about 4 ns. The
  /// budget is the file's, and must outlive this object.
  MeshCenters(std::uint64_t mostTerms, gltf::MemoryBudget& budget)
      : termsLeft_(mostTerms), budget_(budget) {}

  /// The centers of a primitive, 3 floats per vertex. They depend on all primitives of the mesh, so
  /// that primitives agree where they meet. `jointCount` is at most `namedJoints` of the mesh.
  /// Shows progress. Fails with `limitExceeded` if there are too many terms: their number grows
  /// with the square of a mesh's density.
  Result<std::vector<float>> of(const gltf::Model& model, const gltf::SkinnedPrimitive& source,
                                std::uint32_t jointCount);

 private:
  using Centers = std::vector<std::vector<float>>;  ///< by primitive
  Result<Centers> find(const gltf::Mesh& mesh, std::uint32_t jointCount);

  std::map<std::pair<std::uint32_t, std::uint32_t>, Result<Centers>>
      found_;  ///< by mesh and joints
  std::uint64_t termsLeft_;
  gltf::MemoryBudget& budget_;
};

}  // namespace dermis::cli
