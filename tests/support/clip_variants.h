// Clips with what the clips of the test data lack, made from these.
#pragma once

#include <array>
#include <cstdint>

#include "dermis/gltf.h"

namespace dermis::test {

enum class ClipVariant : std::uint8_t {
  step,           ///< all channels hold their keys
  cubicSpline,    ///< tangents of a Catmull-Rom spline, some much longer
  irregularKeys,  ///< some keys dropped, the others at other times
  jumps,          ///< two keys at one time, that is on no grid
  lateKeys,       ///< all keys later, and the clip as much longer
  oneKey,         ///< one key in each channel, in the middle of the clip
  spin,           ///< rotations that turn by more than 180 degrees from the first key to the last
  smallScales,    ///< scales that are negative, and nearly 0, between their keys too
};
inline constexpr std::array<ClipVariant, 8> clipVariants{
    ClipVariant::step,  ClipVariant::cubicSpline, ClipVariant::irregularKeys,
    ClipVariant::jumps, ClipVariant::lateKeys,    ClipVariant::oneKey,
    ClipVariant::spin,  ClipVariant::smallScales};

const char* clipVariantName(ClipVariant variant);

/// The model with all its clips changed. The same seed gives the same clips, with every compiler.
/// Channels have the interpolation LINEAR first, without their tangents.
gltf::Model withVariant(gltf::Model model, ClipVariant variant, std::uint32_t seed);

}  // namespace dermis::test
