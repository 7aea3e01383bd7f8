// Centres of rotation for what a glTF file holds.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/result.h"

namespace dermis::cli {

/// Finds the centres of rotation of meshes of one file, each once.
class MeshCenters {
 public:
  /// Those of a primitive, 3 floats a vertex. All primitives of a mesh count, so that they agree
  /// where they meet. Shows progress. Fails with `limitExceeded` where the file takes more work
  /// than a command should do unasked: dense meshes cost the square of their size.
  Result<std::vector<float>> of(const gltf::Model& model, const gltf::SkinnedPrimitive& source,
                                std::uint32_t jointCount);

 private:
  using Centers = std::vector<std::vector<float>>;  ///< by primitive
  Result<Centers> find(const gltf::Mesh& mesh, std::uint32_t jointCount);

  std::map<std::pair<std::uint32_t, std::uint32_t>, Centers> found_;  ///< by mesh and joints
  std::uint64_t termsLeft_ = 10'000'000'000;                          ///< some 40 s on one core
};

}  // namespace dermis::cli
