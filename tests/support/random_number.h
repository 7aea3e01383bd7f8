// Random numbers that are the same with every standard library, unlike those of its distributions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

namespace dermis::test {

/// From `least` to less than `most`.
inline double between(std::mt19937& random, double least, double most) {
  return least + (most - least) * (static_cast<double>(random()) * 0x1p-32);
}

/// From 0 to `count` - 1.
inline std::uint32_t below(std::mt19937& random, std::size_t count) {
  return static_cast<std::uint32_t>(random() % count);
}

inline bool chance(std::mt19937& random, std::uint32_t percent) {
  return below(random, 100) < percent;
}

}  // namespace dermis::test
