#include "prepared_mesh.h"

#include <utility>

namespace dermis::cli {

Result<std::shared_ptr<const PreparedMesh>> PreparedMesh::prepare(const gltf::Primitive& primitive,
                                                                  std::string name,
                                                                  std::uint32_t jointCount,
                                                                  bool strict) {
  const std::shared_ptr<PreparedMesh> mesh(new PreparedMesh);
  mesh->name_ = std::move(name);
  mesh->original_ = mesh->primitive_.emplace(primitive).mesh();
  mesh->original_.name = mesh->name_;
  mesh->report_ = validate(mesh->original_, jointCount);
  if (!mesh->report_.packable()) {
    if (strict) return Error{ErrorCode::invalidMesh, mesh->report_.findings.front().message};
    Result<RepairedMesh> repaired = repair(mesh->original_, jointCount);
    if (!repaired) return repaired.error();
    mesh->repaired_.emplace(std::move(*repaired));
  }
  Result<PackedMesh> packed = pack(mesh->view(), jointCount);
  if (!packed) return packed.error();
  mesh->packed_.emplace(std::move(*packed));
  return std::shared_ptr<const PreparedMesh>(mesh);
}

}  // namespace dermis::cli
