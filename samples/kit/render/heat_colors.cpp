#include "kit/render/heat_colors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace dermis::samples::render {
namespace {

/// Linear; the same as in shaders/mesh.frag.
constexpr std::array<std::array<float, 3>, 5> stops{{{0.10f, 0.13f, 0.22f},
                                                     {0.05f, 0.32f, 0.42f},
                                                     {0.25f, 0.60f, 0.30f},
                                                     {0.90f, 0.65f, 0.10f},
                                                     {0.75f, 0.05f, 0.03f}}};

std::uint8_t encoded(float linear) {
  const float value =
      linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.f, 1.f)));
}

}  // namespace

std::array<std::uint8_t, 3> heatColor(float value) {
  const float place = std::clamp(value, 0.f, 1.f) * 4;
  const std::size_t stop = std::min(static_cast<std::size_t>(place), std::size_t{3});
  const float share = place - static_cast<float>(stop);
  std::array<std::uint8_t, 3> color{};
  for (std::size_t i = 0; i < 3; ++i)
    color[i] = encoded(std::lerp(stops[stop][i], stops[stop + 1][i], share));
  return color;
}

}  // namespace dermis::samples::render
