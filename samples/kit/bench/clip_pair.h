// What the figures of a crowd play, for everything that measures crowds.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "dermis/clips.h"

namespace dermis::samples {

/// Two of `clipCount` clips, blended. Clips, times and weights differ from figure to figure; all
/// times advance by `seconds`.
inline std::array<ClipLayer, 2> clipPair(std::uint32_t clipCount, std::uint32_t figure,
                                         double seconds) {
  const std::uint32_t others = std::max(clipCount - 1, 1u);
  const std::uint32_t second = (figure + 1 + figure / clipCount % others) % clipCount;
  const float weight = 0.2f + 0.6f * static_cast<float>(figure % 97) / 97;
  return {{{.clip = figure % clipCount, .time = 0.37 * figure + seconds, .weight = weight},
           {.clip = second, .time = 0.23 * figure + seconds, .weight = 1 - weight}}};
}

}  // namespace dermis::samples
