// Verifies what rigs drive.
#pragma once

#include <span>
#include <vector>

#include "dermis/result.h"
#include "skinned_scene.h"
#include "verification.h"

namespace dermis::cli {

/// Compares the joints and weights that the rigs of a scene drive in each pose with the reference.
/// Nothing if it has no rigs. Cases compare joints or weights (`comparesVertices` is false).
Result<std::vector<VerifiedCase>> verifyRigs(const Scene& scene,
                                             std::span<const PoseToVerify> poses);

}  // namespace dermis::cli
