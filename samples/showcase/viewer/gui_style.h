// The style of the interface: its font and its colors.
#pragma once

#include <cstdint>

#include <imgui.h>

namespace dermis::viewer {

/// Sets the style of Dear ImGui's context. `pixelsPerUnit` is the resolution of the display, and so
/// of letters.
void styleGui(float pixelsPerUnit);

/// 0xRRGGBB and alpha, for draw lists.
ImU32 color(std::uint32_t rgb, float alpha = 1);

/// The colors of a heat map from 0 to 1, as in render/shaders/mesh.frag.
ImU32 heatColor(float value);

inline constexpr std::uint32_t accentColor = 0x4FC3B4, warmColor = 0xFFB454, textColor = 0xE8ECF0,
                               dimColor = 0x93A0AD, badColor = 0xE5604D, errorColor = 0xFFB9AE,
                               panelColor = 0x171C22;

}  // namespace dermis::viewer
