// Verifies clips that a scene plays: banks, layers, masks, additive clips, morph weights.
#pragma once

#include <string>
#include <vector>

#include "dermis/result.h"
#include "kit/batch_runner.h"
#include "kit/verification_product.h"
#include "skinned_scene.h"
#include "verification.h"

namespace dermis::cli {

/// Packs the clips of a scene and verifies poses and morph weights of what figures play on the
/// targets of the pool: nothing, each clip alone, and blends of up to four layers. These cases
/// compare points or weights (`comparesVertices` is false). Others compare the vertices that the
/// target skins in these poses with those of the source's poses. Nothing if there are no clips.
/// Clips that cannot be packed are left out, with a sentence in `warnings`.
Result<std::vector<VerifiedCase>> verifyClips(samples::TargetPool& pool, const Scene& scene,
                                              samples::Coverage coverage,
                                              std::vector<std::string>& warnings);

}  // namespace dermis::cli
