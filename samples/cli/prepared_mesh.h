// A glTF primitive made ready for skinning with palettes of so many joints.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "dermis/gltf.h"
#include "dermis/pack.h"
#include "dermis/validate.h"

namespace dermis::cli {

/// Not movable: its views point into it.
class PreparedMesh {
 public:
  /// `name` is what `validate` puts behind "mesh". The primitive has influences, and outlives this
  /// object. Fails with `invalidMesh`, where `strict` also for what could be repaired.
  static Result<std::shared_ptr<const PreparedMesh>> prepare(const gltf::Primitive& primitive,
                                                             std::string name,
                                                             std::uint32_t jointCount, bool strict);
  PreparedMesh(const PreparedMesh&) = delete;
  PreparedMesh& operator=(const PreparedMesh&) = delete;

  /// The mesh to skin: the repaired one where `pack` would have refused it.
  MeshView view() const { return repaired_ ? repaired_->view() : original_; }
  const PackedMesh& packed() const { return *packed_; }
  /// Of the mesh as the file has it.
  const MeshReport& report() const { return report_; }

 private:
  PreparedMesh() = default;
  std::string name_;
  std::optional<gltf::PrimitiveView> primitive_;
  MeshView original_;
  MeshReport report_;
  std::optional<RepairedMesh> repaired_;
  std::optional<PackedMesh> packed_;
};

}  // namespace dermis::cli
