// The colors of a heat map, for what explains it.
#pragma once

#include <array>
#include <cstdint>

namespace dermis::samples::render {

/// The color of a value from 0 to 1, as shaders/mesh.frag has it, in sRGB: that of a surface in
/// even white light.
std::array<std::uint8_t, 3> heatColor(float value);

}  // namespace dermis::samples::render
