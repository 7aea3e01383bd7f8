#include "prepared_mesh.h"

#include <cstddef>
#include <cstring>
#include <utility>

namespace dermis::cli {

MeshView PreparedMesh::view() const {
  MeshView mesh = repaired_ ? repaired_->view() : original_;
  if (!centersOfRotation_.empty())
    mesh.centersOfRotation = floatAttribute(centersOfRotation_.data(), mesh.vertexCount, 3);
  return mesh;
}

// TODO: dermis/centers_of_rotation.h finds the centres. Until it is here each vertex is its own,
// which makes centerOfRotation the same as linear blending.
Result<void> PreparedMesh::addCentersOfRotation(std::uint32_t /*jointCount*/,
                                                std::span<const std::uint32_t> /*triangles*/) {
  const MeshView mesh = view();
  std::vector<float> centers(std::size_t{mesh.vertexCount} * 3);
  // Positions of glTF, and repaired ones, are float32.
  for (std::size_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    std::memcpy(centers.data() + vertex * 3,
                static_cast<const std::byte*>(mesh.positions.data) + vertex * mesh.positions.stride,
                3 * sizeof(float));
  }
  centersOfRotation_ = std::move(centers);
  return {};
}

Result<std::shared_ptr<const PreparedMesh>> PreparedMesh::prepare(
    const gltf::Primitive& primitive, std::string name, std::uint32_t jointCount,
    const MeshPreparation& preparation) {
  const std::shared_ptr<PreparedMesh> mesh(new PreparedMesh);
  mesh->name_ = std::move(name);
  mesh->original_ = mesh->primitive_.emplace(primitive).mesh();
  mesh->original_.name = mesh->name_;
  mesh->original_.dualQuaternionWeight = preparation.dualQuaternionWeight;
  mesh->original_.bulgeStrength = preparation.bulgeStrength;
  mesh->report_ = validate(mesh->original_, jointCount);
  if (!mesh->report_.packable()) {
    if (preparation.strict)
      return Error{ErrorCode::invalidMesh, mesh->report_.findings.front().message};
    Result<RepairedMesh> repaired = repair(mesh->original_, jointCount);
    if (!repaired) return repaired.error();
    mesh->repaired_.emplace(std::move(*repaired));
  }
  if (preparation.centersOfRotation) {
    if (Result<void> added = mesh->addCentersOfRotation(jointCount, primitive.triangles); !added)
      return added.error();
  }
  Result<PackedMesh> packed = pack(mesh->view(), jointCount);
  if (!packed) return packed.error();
  mesh->packed_.emplace(std::move(*packed));
  return std::shared_ptr<const PreparedMesh>(mesh);
}

}  // namespace dermis::cli
