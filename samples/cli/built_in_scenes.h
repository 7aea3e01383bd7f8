// Built-in scenes that show what the methods do, without a file: a bar that is twisted, and an arm
// that is bent.
#pragma once

#include "comparison_picture.h"
#include "skinned_scene.h"

namespace dermis::cli {

/// The sample models `bar` and `arm`. Each is twisted or bent most in the middle of its clip.
struct BuiltInScenes {
  Scene bar, arm;
};

Result<BuiltInScenes> loadBuiltInScenes(const MeshPreparation& preparation);

/// The time in seconds at which the clip bends the arm most.
double builtInArmTime(const Scene& arm);

/// The strips of both scenes: candy wrapper and elbow. They refer to the scenes.
std::vector<ComparisonStrip> builtInStrips(const BuiltInScenes& scenes);

}  // namespace dermis::cli
