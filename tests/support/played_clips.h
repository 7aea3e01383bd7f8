// A bank of clips, and what figures play of it.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "dermis/clips.h"

namespace dermis::test {

/// A chain of twenty nodes, of which all but the first move, and one beside it. Both skins have
/// eight joints, one at rest among them; those of skin 1 only turn. Clip 1 has jumps and is
/// clamped, clip 2 is additive and scales, and there is a mask. Two nodes have morph weights.
const PackedClips& playedClips();

inline constexpr std::uint32_t playCount = 10;
inline constexpr std::uint32_t playedSkins = 2;

/// Of these clips: from no layer to four.
std::span<const ClipLayer> playedLayers(std::uint32_t play);

/// `samplePose` of one of them.
std::vector<JointMatrix> playedPose(std::uint32_t play, std::uint32_t skin);

/// The node that has weights for so many targets: 3 or 4.
std::uint32_t weightedNode(std::uint32_t targets);
/// `sampleWeights` of it: those that are not 0.
std::vector<MorphWeight> playedMorphs(std::uint32_t play, std::uint32_t targets);

}  // namespace dermis::test
