// The bind pose with morph targets added, in double precision, for the reference.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "dermis/mesh.h"
#include "dermis/reference.h"
#include "dermis/result.h"

namespace dermis::reference {

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
