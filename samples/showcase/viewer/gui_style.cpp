#include "gui_style.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "kit/render/picture.h"

namespace dermis::viewer {
namespace {

constexpr float letterHeight = 15;

void useFont(float pixelsPerUnit) {
  ImGuiIO& io = ImGui::GetIO();
  static const std::array<ImWchar, 7> glyphs{0x20, 0xff, 0x2010, 0x2030, 0x2190, 0x2193, 0};
  const Result<std::string> file = samples::render::findFontFile();
  // Without the file, Dear ImGui's own font is used.
  if (file) {
    io.Fonts->AddFontFromFileTTF(file->c_str(), letterHeight * pixelsPerUnit, nullptr,
                                 glyphs.data());
    io.FontGlobalScale = 1 / pixelsPerUnit;
  }
}

ImVec4 vector(std::uint32_t rgb, float alpha = 1) {
  return ImGui::ColorConvertU32ToFloat4(color(rgb, alpha));
}

float displayed(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

}  // namespace

void styleGui(float pixelsPerUnit) {
  useFont(pixelsPerUnit);
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowRounding = style.PopupRounding = 8;
  style.FrameRounding = style.GrabRounding = 5;
  style.WindowBorderSize = 0;
  style.WindowPadding = {16, 14};
  style.FramePadding = {9, 5};
  style.ItemSpacing = {8, 6};
  style.ScrollbarSize = 10;
  style.GrabMinSize = 12;
  auto& colors = style.Colors;
  colors[ImGuiCol_Text] = vector(textColor);
  colors[ImGuiCol_TextDisabled] = vector(dimColor);
  colors[ImGuiCol_WindowBg] = vector(panelColor, 0.97f);
  colors[ImGuiCol_PopupBg] = vector(0x1E252D, 0.98f);
  colors[ImGuiCol_Border] = vector(0x2C353F);
  colors[ImGuiCol_FrameBg] = vector(0x242C35);
  colors[ImGuiCol_FrameBgHovered] = vector(0x2D3742);
  colors[ImGuiCol_FrameBgActive] = vector(0x34404C);
  colors[ImGuiCol_Button] = vector(0x2A333D);
  colors[ImGuiCol_ButtonHovered] = vector(0x35414D);
  colors[ImGuiCol_ButtonActive] = vector(0x3E4C5A);
  colors[ImGuiCol_Header] = vector(accentColor, 0.22f);
  colors[ImGuiCol_HeaderHovered] = vector(accentColor, 0.32f);
  colors[ImGuiCol_HeaderActive] = vector(accentColor, 0.40f);
  colors[ImGuiCol_SliderGrab] = colors[ImGuiCol_CheckMark] = vector(accentColor);
  colors[ImGuiCol_SliderGrabActive] = vector(0x7FE0D3);
  colors[ImGuiCol_Separator] = vector(0x2C353F);
  colors[ImGuiCol_TextSelectedBg] = vector(accentColor, 0.35f);
  colors[ImGuiCol_ScrollbarBg] = vector(panelColor, 0);
}

ImU32 color(std::uint32_t rgb, float alpha) {
  const auto part = [&](int shift) { return (rgb >> shift) & 0xffu; };
  const auto opacity = static_cast<std::uint32_t>(std::lround(std::clamp(alpha, 0.f, 1.f) * 255));
  return part(16) | part(8) << 8 | part(0) << 16 | opacity << 24;
}

ImU32 heatColor(float value) {
  static constexpr float stops[5][3]{{0.10f, 0.13f, 0.22f},
                                     {0.05f, 0.32f, 0.42f},
                                     {0.25f, 0.60f, 0.30f},
                                     {0.90f, 0.65f, 0.10f},
                                     {0.75f, 0.05f, 0.03f}};
  const float place = std::clamp(value, 0.0f, 1.0f) * 4;
  const int stop = std::min(static_cast<int>(place), 3);
  const float part = place - static_cast<float>(stop);
  std::array<float, 3> mixed{};
  for (std::size_t i = 0; i < 3; ++i)
    mixed[i] = displayed(stops[stop][i] * (1 - part) + stops[stop + 1][i] * part);
  return ImGui::ColorConvertFloat4ToU32({mixed[0], mixed[1], mixed[2], 1});
}

}  // namespace dermis::viewer
