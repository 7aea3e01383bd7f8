// Places the figures of a crowd in a picture, and chooses their clips.
#pragma once

#include <cstdint>
#include <vector>

#include "dermis/mesh.h"
#include "skinned_scene.h"

namespace dermis::cli {

/// The clip and phase of one figure.
struct Role {
  std::uint32_t clip = noIndex;
  double phase = 0;  ///< seconds ahead of the first figure
};

/// The first figure plays `clip` unchanged. The others play the same clip or, if `isVaried`, a
/// pseudorandom clip of the model, each with its own phase. The result is the same every time.
std::vector<Role> castCrowd(const gltf::Model& model, std::uint32_t clip, bool isVaried,
                            std::uint32_t figures);

/// The time within the clip in seconds. The clip repeats.
double timeInClip(const gltf::Model& model, const Role& role, double time);

/// Places figures whose vertices stay within `extent` in rows, with small offsets and rotations, so
/// that they look natural and do not intersect. A single figure is not moved.
std::vector<JointMatrix> placeCrowd(const Box& extent, std::uint32_t figures);

/// The box around a transformed box.
Box moved(const Box& box, const JointMatrix& transform);

}  // namespace dermis::cli
