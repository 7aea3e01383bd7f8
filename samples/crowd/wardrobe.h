// What figures wear: each is dressed in colours of its own.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "character.h"

namespace crowd {

/// By the names of materials: body, hair, shirt, trousers, shoes. Others stay as they are.
class Wardrobe {
 public:
  explicit Wardrobe(const Character& character);

  /// What the base colour of a figure's part is multiplied by: linear red, green, blue.
  std::array<float, 3> tint(std::uint32_t figure, std::uint32_t part) const;

 private:
  struct Rack {
    std::vector<std::array<double, 3>> tints;
  };
  std::vector<Rack> racks_;  ///< by part
};

}  // namespace crowd
