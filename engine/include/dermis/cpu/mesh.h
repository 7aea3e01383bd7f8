// A mesh in the form that the CPU path reads.
#pragma once

#include <cstdint>
#include <memory>

#include "dermis/export.h"
#include "dermis/pack.h"
#include "dermis/result.h"

namespace dermis::cpu {

struct MeshData;

/// Made once, while loading, from a packed mesh. It is immutable: any number of threads may skin it
/// at the same time. A moved-from mesh may only be assigned to or destroyed.
///
/// It owns its memory. Per vertex this is 44 bytes with normals, 32 more with tangents, 12
/// more with centers of rotation, and 8 for each influence. Vertices are stored in groups of eight,
/// each with the maximum influence count of its group. With morph targets it keeps a copy of the
/// packed mesh, too.
class DERMIS_CPU_API Mesh {
 public:
  /// Converts a packed mesh, which may be released afterwards. O(vertices × influences). Fails with
  /// `limitExceeded` if a vertex has more than 1,000 influences.
  static Result<Mesh> create(const PackedMesh& packed);
  ~Mesh();
  Mesh(Mesh&&) noexcept;
  Mesh& operator=(Mesh&&) noexcept;

  /// What `PackedMesh::info` returned.
  const MeshInfo& info() const;

 private:
  friend const MeshData& dataOf(const Mesh& mesh);
  explicit Mesh(std::unique_ptr<const MeshData> data);
  std::unique_ptr<const MeshData> data_;
};

}  // namespace dermis::cpu
