// How the interface looks: its typeface, its colors.
#pragma once

#include <cstdint>

#include <imgui.h>

namespace dermis::viewer {

/// Of Dear ImGui's context. `pixelsPerUnit`: how fine the display is; letters are drawn as fine.
void styleGui(float pixelsPerUnit);

/// 0xRRGGBB and alpha, for draw lists.
ImU32 color(std::uint32_t rgb, float alpha = 1);

/// The colors of a heat map from 0 to 1, as render/shaders/mesh.frag has them.
ImU32 heatColor(float value);

inline constexpr std::uint32_t accentColor = 0x4FC3B4, warmColor = 0xFFB454, textColor = 0xE8ECF0,
                               dimColor = 0x93A0AD, badColor = 0xE5604D, errorColor = 0xFFB9AE,
                               panelColor = 0x171C22;

}  // namespace dermis::viewer
