// The case that shows what methods do, for which there need be no file: a bar that is twisted, and
// an arm that is bent.
#pragma once

#include "comparison_picture.h"
#include "skinned_scene.h"

namespace dermis::cli {

/// The sample models `bar` and `arm`, each in the middle of its clip, where it is twisted and bent
/// most.
struct BuiltInScenes {
  Scene bar, arm;
};

Result<BuiltInScenes> loadBuiltInScenes(const MeshPreparation& preparation);

/// Where the arm's clip bends it most, in seconds.
double builtInArmTime(const Scene& arm);

/// The candy wrapper, and the elbow. They refer to the scenes.
std::vector<ComparisonStrip> builtInStrips(const BuiltInScenes& scenes);

}  // namespace dermis::cli
