// Clothes: each figure has its own colors.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "character.h"

namespace crowd {

/// Recognizes materials by name: body, hair, shirt, trousers, shoes. Others are not changed.
class Wardrobe {
 public:
  explicit Wardrobe(const Character& character);

  /// Factor for the base color of a figure's part: linear red, green, blue.
  std::array<float, 3> tint(std::uint32_t figure, std::uint32_t part) const;

 private:
  struct Rack {
    std::vector<std::array<double, 3>> tints;
  };
  std::vector<Rack> racks_;  ///< by part
};

}  // namespace crowd
