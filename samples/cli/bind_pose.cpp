#include "bind_pose.h"

#include <cstddef>

namespace dermis::cli {
namespace {

/// Adds to the first three of every `components` values.
void addDisplacements(std::vector<float>& values, std::size_t components,
                      const std::vector<float>& displacements, float weight) {
  for (std::size_t i = 0; i / 3 * components < values.size() && i < displacements.size(); ++i)
    values[i / 3 * components + i % 3] += weight * displacements[i];
}

}  // namespace

SkinnedPart bindPose(const ScenePart& part, std::span<const MorphWeight> morphs) {
  SkinnedPart skinned{part.primitive->positions, part.primitive->normals, part.primitive->tangents};
  for (const MorphWeight& morph : morphs) {
    const gltf::MorphTarget& target = part.primitive->morphTargets[morph.target];
    addDisplacements(skinned.positions, 3, target.positions, morph.weight);
    addDisplacements(skinned.normals, 3, target.normals, morph.weight);
    addDisplacements(skinned.tangents, 4, target.tangents, morph.weight);
  }
  return skinned;
}

}  // namespace dermis::cli
