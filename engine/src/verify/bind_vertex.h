// A vertex in bind pose, in double precision: every type that an attribute may have, influences,
// and morph targets added. Packing reads the same by its own means.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "dermis/mesh.h"
#include "dermis/result.h"
#include "verify/conditioning.h"

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
  double weight = 0;  ///< normalized
};

/// All sets together, one entry a joint, in the order of joints; the weights sum to 1. Empty: no
/// weight. `influences` is overwritten.
void readInfluences(const MeshView& mesh, std::size_t vertex, std::vector<Influence>& influences);

struct ActiveMorph {
  const MorphTargetView* target;
  double weight;  ///< not 0
};

/// The targets that have a weight, in the order of the mesh. Fails with `invalidArgument` for a
/// target that the mesh lacks or that stands twice, and for a weight that is not finite.
Result<std::vector<ActiveMorph>> activeMorphs(const MeshView& mesh,
                                              std::span<const MorphWeight> weights);

/// A vertex before it is skinned; zeros for what the mesh lacks. Directions are of any length.
struct BindVertex {
  glm::dvec3 position, normal, tangent;
  double handedness = 1;  ///< 1 or -1
};

/// What is stored for a vertex, plus Σ w_i d_i of the active targets. Fills the conditioning's
/// roundings.
BindVertex bindVertex(const MeshView& mesh, std::size_t vertex, std::span<const ActiveMorph> morphs,
                      Conditioning& conditioning);

}  // namespace dermis::reference
