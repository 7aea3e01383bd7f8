#include "prepared_mesh.h"

#include <utility>

namespace dermis::cli {

MeshView PreparedMesh::view() const {
  MeshView mesh = repaired_ ? repaired_->view() : original_;
  if (!centersOfRotation_.empty())
    mesh.centersOfRotation = floatAttribute(centersOfRotation_.data(), mesh.vertexCount, 3);
  return mesh;
}

Result<std::shared_ptr<const PreparedMesh>> PreparedMesh::prepare(
    const gltf::Primitive& primitive, std::string name, std::uint32_t jointCount,
    const MeshPreparation& preparation, const CentersOfPrimitive& centers) {
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
  Result<std::vector<float>> centersOfRotation = centers();
  if (!centersOfRotation) return centersOfRotation.error();
  mesh->centersOfRotation_ = std::move(*centersOfRotation);
  Result<PackedMesh> packed = pack(mesh->view(), jointCount);
  if (!packed) return packed.error();
  mesh->packed_.emplace(std::move(*packed));
  return std::shared_ptr<const PreparedMesh>(mesh);
}

}  // namespace dermis::cli
