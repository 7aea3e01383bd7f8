// What a mesh's centres of rotation depend on, read from its views.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "centers/pair_index.h"
#include "dermis/mesh.h"

namespace dermis::centers {

/// Lists of influences, one after the other.
class InfluenceLists {
 public:
  void add(std::span<const Influence> list) {
    influences_.insert(influences_.end(), list.begin(), list.end());
    ends_.push_back(influences_.size());
  }
  std::span<const Influence> operator[](std::size_t list) const {
    const std::size_t first = list == 0 ? 0 : ends_[list - 1];
    return std::span(influences_).subspan(first, ends_[list] - first);
  }
  std::size_t size() const { return ends_.size(); }

 private:
  std::vector<Influence> influences_;
  std::vector<std::size_t> ends_;
};

struct Vertices {
  std::vector<glm::vec3> positions;
  InfluenceLists influences;  ///< as `pack` stores them, the strongest first
};

/// The mesh must be one that `pack` takes.
Vertices gatherVertices(const MeshView& mesh);

/// The triangles that have an area and at least two joints. Every index must lie within the
/// vertices.
PairIndex indexTriangles(const Vertices& vertices, std::span<const std::uint32_t> triangles);

}  // namespace dermis::centers
