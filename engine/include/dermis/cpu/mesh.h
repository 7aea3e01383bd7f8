// A mesh as the CPU path reads it.
#pragma once

#include <cstdint>
#include <memory>

#include "dermis/pack.h"
#include "dermis/result.h"

namespace dermis::cpu {

struct MeshData;

/// Made once, at import, from a packed mesh. It is immutable: any number of threads may skin it. It
/// owns its memory, about as much as the packed mesh takes, and with morph targets a copy of that
/// too.
class Mesh {
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
