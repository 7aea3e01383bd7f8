// A vertex in bind pose, in double precision: every type that an attribute may have, influences,
// and morphing. This code is independent of packing, which reads the same data.
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

/// The value of a component: `unorm` and `snorm` types are divided by their largest value.
double readComponent(const AttributeView& view, std::size_t element, std::uint32_t component);

/// The first three components.
glm::dvec3 readVector(const AttributeView& view, std::size_t element);

/// A vertex's position: the stored value times the mesh's scale, plus its offset.
glm::dvec3 readPosition(const MeshView& mesh, std::size_t vertex);

struct Influence {
  std::uint32_t joint;
  double stored;      ///< the weight as stored, times 65535, with duplicates added; the pivot is
                      ///< chosen by it
  double weight = 0;  ///< normalized
};

/// Reads the influences of all sets, one entry per joint, in ascending order of joints. The weights
/// sum to 1. Empty if no influence has a weight. `influences` is overwritten.
void readInfluences(const MeshView& mesh, std::size_t vertex, std::vector<Influence>& influences);

struct ActiveMorph {
  const MorphTargetView* target;
  double weight;  ///< not 0
};

/// The targets with a weight other than 0, in the order of the mesh. Fails with `invalidArgument`
/// for a target that the mesh lacks or that is listed twice, and for a weight that is not finite.
Result<std::vector<ActiveMorph>> activeMorphs(const MeshView& mesh,
                                              std::span<const MorphWeight> weights);

/// A vertex before it is skinned. Attributes that the mesh lacks are zero. Directions may have any
/// length.
struct BindVertex {
  glm::dvec3 position, normal, tangent;
  double handedness = 1;  ///< 1 or -1
};

/// The stored vertex plus Σ w_i d_i of the active targets. Fills in the conditioning's roundings.
BindVertex bindVertex(const MeshView& mesh, std::size_t vertex, std::span<const ActiveMorph> morphs,
                      Conditioning& conditioning);

}  // namespace dermis::reference
