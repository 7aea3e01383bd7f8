// Places the figures of a crowd in a picture, and chooses their clips.
#pragma once

#include <cstdint>
#include <vector>

#include "dermis/types.h"
#include "skinned_scene.h"

namespace dermis::cli {

/// The clip and phase of one figure.
struct Role {
  std::uint32_t clip = gltf::none;
  double phase = 0;  ///< seconds that it is ahead
};

/// The first plays the clip as it is; the others the same clip, or where `isVaried` one clip of the
/// model after the other, each ahead by some time of its own. The same crowd every time.
std::vector<Role> castCrowd(const gltf::Model& model, std::uint32_t clip, bool isVaried,
                            std::uint32_t figures);

/// Seconds into the clip, which repeats.
double timeInClip(const gltf::Model& model, const Role& role, double time);

/// Where figures stand that keep within `extent`: in rows, a little out of line and turned a
/// little, so that they neither look like soldiers nor run into each other. A single one stands
/// where it is.
std::vector<JointMatrix> placeCrowd(const Box& extent, std::uint32_t figures);

/// The box around a transformed box.
Box moved(const Box& box, const JointMatrix& transform);

}  // namespace dermis::cli
