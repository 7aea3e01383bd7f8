// Skins a scene part by part, with the reference, on the CPU or on a device, for `dermis skin`.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "dermis/layout.h"
#include "kit/batch_runner.h"
#include "skinned_scene.h"

namespace dermis::cli {

/// One part of a scene in one pose.
struct SkinnedPart {
  std::vector<float> positions;  ///< 3 per vertex
  std::vector<float> normals;    ///< 3 per vertex, or empty
  std::vector<float> tangents;   ///< 4 per vertex, or empty
};

/// A part without influences: morphed, but not skinned. Normals and tangents are not normalized.
SkinnedPart bindPose(const ScenePart& part, std::span<const MorphWeight> morphs);

/// Skins every part of the scene in a pose. Includes tangents if they are requested and the mesh
/// has them.
using SkinParts = std::function<Result<std::vector<SkinnedPart>>(const ScenePose& pose)>;

/// The requests of a batch: one for each part with a mesh, in the order of the parts. They refer to
/// the scene and the pose.
std::vector<samples::SkinRequest> skinRequests(const Scene& scene, const ScenePose& pose);

/// Both results refer to the scene, and the second also to the target.
SkinParts referenceSkinner(const Scene& scene, Method method);
SkinParts targetSkinner(const Scene& scene, Method method, bool tangents,
                        samples::BatchTarget& target);

}  // namespace dermis::cli
