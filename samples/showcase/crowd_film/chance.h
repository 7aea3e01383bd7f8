// Reproducible pseudorandom numbers.
#pragma once

#include <cstdint>

namespace crowd_film {

/// A number in [0, 1) that depends only on the figure and the purpose (Wellons 2018, "Prospecting
/// for hash functions").
inline double chance(std::uint32_t figure, std::uint32_t purpose) {
  std::uint32_t bits = figure * 0x9e3779b9u + purpose * 0x85ebca6bu + 1;
  bits = (bits ^ (bits >> 16)) * 0x7feb352du;
  bits = (bits ^ (bits >> 15)) * 0x846ca68bu;
  return static_cast<double>(bits ^ (bits >> 16)) / 4294967296.0;
}

/// The same, in [-1, 1).
inline double deviation(std::uint32_t figure, std::uint32_t purpose) {
  return 2 * chance(figure, purpose) - 1;
}

}  // namespace crowd_film
