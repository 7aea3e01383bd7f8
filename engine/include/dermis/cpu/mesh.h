// A mesh as the CPU path reads it.
#pragma once

#include <cstdint>
#include <memory>

#include "dermis/export.h"
#include "dermis/pack.h"
#include "dermis/result.h"

namespace dermis::cpu {

struct MeshData;

/// Made once, at import, from a packed mesh. It is immutable: any number of threads may skin it. It
/// owns its memory: about 80 bytes a vertex with normals, 32 more with tangents, and 8 for each
/// influence of the vertex of eight neighbours that has most; with morph targets a copy of the
/// packed mesh too. One that was moved from may only be assigned to or destroyed.
class DERMIS_CPU_API Mesh {
 public:
  /// O(vertices × influences). Fails with `limitExceeded` if a vertex has more than 1,000
  /// influences.
  static Result<Mesh> create(const PackedMesh& packed);
  ~Mesh();
  Mesh(Mesh&&) noexcept;
  Mesh& operator=(Mesh&&) noexcept;

  const MeshInfo& info() const;

 private:
  friend const MeshData& dataOf(const Mesh& mesh);
  explicit Mesh(std::unique_ptr<const MeshData> data);
  std::unique_ptr<const MeshData> data_;
};

}  // namespace dermis::cpu
