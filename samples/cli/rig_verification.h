// Verifies what rigs drive.
#pragma once

#include <span>
#include <vector>

#include "dermis/result.h"
#include "skinned_scene.h"
#include "verification.h"

namespace dermis::cli {

/// Compares the joints and weights that the rigs of a scene drive in each pose, on a target, with
/// the reference. Nothing if it has no rigs. Cases compare joints or weights (`comparesVertices` is
/// false).
Result<std::vector<VerifiedCase>> verifyRigs(samples::BatchTarget& target, const Scene& scene,
                                             std::span<const PoseToVerify> poses);

}  // namespace dermis::cli
