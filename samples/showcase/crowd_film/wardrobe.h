// Clothes: each figure has its own colors.
#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "kit/character.h"

namespace crowd_film {

/// Recognizes materials by name: body, hair, shirt, trousers, shoes. Others are not changed.
class Wardrobe {
 public:
  explicit Wardrobe(const dermis::samples::Character& character);

  /// Factor for the base color of a figure's part: linear red, green, blue.
  glm::vec3 tint(std::uint32_t figure, std::uint32_t part) const;

 private:
  std::vector<std::vector<glm::vec3>> tints_;  ///< by part
};

}  // namespace crowd_film
