// What a mesh view holds, in double precision, for the reference: every type that an attribute may
// have. Packing reads the same by its own means.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "dermis/mesh.h"

namespace dermis::reference {

/// The number that a component stands for: `unorm` and `snorm` types divided by their largest.
double readComponent(const AttributeView& view, std::size_t element, std::uint32_t component);

/// The first three components.
glm::dvec3 readVector(const AttributeView& view, std::size_t element);

/// A vertex' position: what is stored, times the mesh's scale, plus its offset.
glm::dvec3 readPosition(const MeshView& mesh, std::size_t vertex);

struct Influence {
  std::uint32_t joint;
  double stored;      ///< the weight as stored, times 65535, duplicates added up: what the pivot is
                      ///< chosen by
  double weight = 0;  ///< normalised
};

/// All sets together, one entry a joint, in the order of joints; the weights sum to 1. Empty: no
/// weight. `influences` is overwritten.
void readInfluences(const MeshView& mesh, std::size_t vertex, std::vector<Influence>& influences);

}  // namespace dermis::reference
