// Parts of a scene that no joint moves.
#pragma once

#include <span>
#include <vector>

#include "skinned_scene.h"

namespace dermis::cli {

/// One part in one pose.
struct SkinnedPart {
  std::vector<float> positions;  ///< 3 per vertex
  std::vector<float> normals;    ///< 3 per vertex, or empty
  std::vector<float> tangents;   ///< 4 per vertex, or empty
};

/// A part without influences: morphed, but not skinned. Normals and tangents are not normalized.
SkinnedPart bindPose(const ScenePart& part, std::span<const MorphWeight> morphs);

}  // namespace dermis::cli
