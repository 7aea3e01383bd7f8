#include "wardrobe.h"

#include <algorithm>
#include <cstddef>
#include <string_view>

#include <glm/common.hpp>

#include "chance.h"

using namespace dermis;

namespace crowd_film {
namespace {

struct Colors {
  std::string_view material;
  std::vector<glm::vec3> colors;  ///< linear
};

const std::vector<Colors>& allColors() {
  static const std::vector<Colors> all{
      {"body",
       {{0.61, 0.34, 0.23},
        {0.67, 0.42, 0.31},
        {0.50, 0.26, 0.16},
        {0.36, 0.18, 0.10},
        {0.23, 0.11, 0.065},
        {0.13, 0.062, 0.038}}},
      {"hair",
       {{0.050, 0.028, 0.017},
        {0.018, 0.014, 0.013},
        {0.012, 0.011, 0.012},
        {0.110, 0.055, 0.025},
        {0.310, 0.190, 0.085},
        {0.190, 0.055, 0.020},
        {0.150, 0.145, 0.140}}},
      {"shirt",
       {{0.060, 0.215, 0.330},    // petrol
        {0.500, 0.080, 0.050},    // red
        {0.640, 0.330, 0.045},    // ochre
        {0.660, 0.630, 0.560},    // linen
        {0.045, 0.065, 0.150},    // navy
        {0.110, 0.250, 0.120},    // green
        {0.560, 0.190, 0.100},    // rust
        {0.300, 0.420, 0.480},    // sky
        {0.090, 0.085, 0.085}}},  // charcoal
      {"trousers",
       {{0.070, 0.066, 0.070},
        {0.045, 0.070, 0.135},
        {0.110, 0.160, 0.240},
        {0.290, 0.215, 0.130},
        {0.160, 0.155, 0.150},
        {0.120, 0.105, 0.060}}},
      {"shoes", {{0.185, 0.075, 0.035}, {0.080, 0.032, 0.015}, {0.250, 0.115, 0.058}}},
  };
  return all;
}

/// The median color of the part, by channel, which ignores small areas such as eyes and soles.
glm::vec3 ownColor(const gltf::Primitive& primitive) {
  const std::size_t count = primitive.colors.size() / 4;
  if (count == 0) return glm::vec3(1.0f);
  glm::vec3 own(0.0f);
  for (int channel = 0; channel < 3; ++channel) {
    std::vector<float> values;
    for (std::size_t vertex = 0; vertex < count; ++vertex)
      values.push_back(primitive.colors[vertex * 4 + static_cast<std::size_t>(channel)]);
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::ranges::nth_element(values, middle);
    own[channel] = *middle;
  }
  return own;
}

}  // namespace

Wardrobe::Wardrobe(const samples::Character& character) {
  for (const samples::Part& part : character.parts()) {
    std::vector<glm::vec3>& tints = tints_.emplace_back();
    if (part.source->material == noIndex) continue;
    const gltf::Material& material = character.model().materials[part.source->material];
    const auto found = std::ranges::find(allColors(), material.name, &Colors::material);
    if (found == allColors().end()) continue;
    const glm::vec3 own = glm::max(ownColor(*part.source), glm::vec3(1e-3f));
    for (const glm::vec3& color : found->colors) tints.push_back(color / own);
  }
}

glm::vec3 Wardrobe::tint(std::uint32_t figure, std::uint32_t part) const {
  const std::vector<glm::vec3>& tints = tints_[part];
  if (tints.empty()) return glm::vec3(1.0f);
  const double choice = chance(figure, 100 + part) * static_cast<double>(tints.size());
  // Each figure has a slightly different shade.
  const double light = 1 + 0.15 * deviation(figure, 200 + part);
  return tints[static_cast<std::size_t>(choice)] * static_cast<float>(light);
}

}  // namespace crowd_film
