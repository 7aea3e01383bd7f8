// The colors of a heat map, for legends.
#pragma once

#include <array>
#include <cstdint>

namespace dermis::samples::render {

/// The color of a value from 0 to 1 in sRGB: that of shaders/mesh.frag for a surface in uniform
/// white light.
std::array<std::uint8_t, 3> heatColor(float value);

}  // namespace dermis::samples::render
