// Prepares a glTF primitive for skinning: validates, repairs and packs it, and computes its centers
// of rotation.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis::cli {

/// What is read, and how meshes are prepared.
struct MeshPreparation {
  /// Refuse files that break a rule even if their meaning is clear, and meshes in which `validate`
  /// finds anything.
  bool strict = false;
  /// Compute centers of rotation, for methods that need them. This may take long.
  bool centersOfRotation = false;
  /// Maximum terms of the sums (`CenterOfRotationSolver::termCount`) for one file. They take about
  /// 4 s on one core, or 40 s if the user named a method that needs centers.
  std::uint64_t mostCenterTerms = 1'000'000'000;
  float dualQuaternionWeight = MeshView().dualQuaternionWeight;  ///< for every vertex
  float bulgeStrength = MeshView().bulgeStrength;                ///< likewise
  bool images = false;                                           ///< read the images of base colors
  bool rigidMeshes = false;  ///< read rigid meshes that hang on skeletons
  /// Names of files whose clips are added to those of the model.
  std::vector<std::string> clips = {};
  /// Name of a file with a rig for the skins that have its joints, or "none". Empty: the rigs that
  /// the model's skins have in their `extras`.
  std::string rig = {};
};

/// The limit if the user named a method that needs centers of rotation.
inline constexpr std::uint64_t mostCenterTermsAsked = 10'000'000'000;

/// The addresses of all arrays that the vertices of a primitive consist of. Primitives that share
/// their vertices have the same, and so can share what is prepared from them.
using VertexKey = std::vector<const void*>;
VertexKey vertexKey(const gltf::Primitive& primitive);

/// Finds the number of joints that a mesh can refer to. Further joints make no difference.
class NamedJoints {
 public:
  std::uint32_t of(const gltf::Mesh& mesh);

 private:
  std::map<const void*, std::uint32_t> largest_;  ///< by array of joints
};

/// The help text of `--strict`.
inline constexpr const char* strictHelp =
    "Refuse a file that breaks a rule of glTF, even if its meaning is clear";

/// Returns the primitive's centers of rotation, 3 floats per vertex, or none.
using CentersOfPrimitive = std::function<Result<std::vector<float>>()>;

/// Not movable, because its views point to its own data.
class PreparedMesh {
 public:
  /// The primitive must have influences, and outlive this object. Spends what it allocates. Fails
  /// with `invalidMesh` (if `strict`, for anything that `validate` finds), with `limitExceeded` if
  /// the budget is too small, or if `centers` does, which is called last.
  static Result<std::shared_ptr<const PreparedMesh>> prepare(const gltf::Primitive& primitive,
                                                             std::uint32_t jointCount,
                                                             const MeshPreparation& preparation,
                                                             std::uint64_t& memoryLeft,
                                                             const CentersOfPrimitive& centers);
  PreparedMesh(const PreparedMesh&) = delete;
  PreparedMesh& operator=(const PreparedMesh&) = delete;

  /// The mesh to skin: the repaired one if `pack` would have refused the original.
  MeshView view() const;
  const PackedMesh& packed() const { return *packed_; }
  /// Whether the mesh has the data that the method needs.
  bool allows(Method method) const {
    return !needsCentersOfRotation(method) || packed_->info().hasCentersOfRotation;
  }
  /// The report on the mesh as the file has it.
  const MeshReport& report() const { return report_; }

 private:
  PreparedMesh() = default;

  std::optional<gltf::PrimitiveView> primitive_;
  MeshView original_;
  MeshReport report_;
  std::optional<RepairedMesh> repaired_;
  std::vector<float> centersOfRotation_;  ///< 3 per vertex, or empty
  std::optional<PackedMesh> packed_;
};

/// Computes the centers of rotation of the meshes of one file, once for each mesh.
class MeshCenters {
 public:
  /// `mostTerms` limits the terms of the sums of all meshes together; each takes about 4 ns. The
  /// budget is the file's, and must outlive this object.
  MeshCenters(std::uint64_t mostTerms, std::uint64_t& memoryLeft)
      : termsLeft_(mostTerms), memoryLeft_(memoryLeft) {}

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
  std::uint64_t& memoryLeft_;
};

}  // namespace dermis::cli
