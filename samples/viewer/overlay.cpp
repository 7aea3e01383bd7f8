#include "overlay.h"

#include <fmt/format.h>

#include "gui_style.h"
#include "joint_overlay.h"

namespace dermis::viewer {
namespace {

enum class Align { left, centre, right };

/// A line of text on a dark plate.
void drawLabel(ImDrawList& list, const std::string& text, float x, float y, Align align,
               ImU32 tint) {
  const ImVec2 size = ImGui::CalcTextSize(text.c_str());
  const float left = align == Align::left     ? x + 10
                     : align == Align::centre ? x - size.x / 2
                                              : x - size.x - 10;
  list.AddRectFilled({left - 10, y}, {left + size.x + 10, y + size.y + 10},
                     color(panelColor, 0.78f), 6);
  list.AddText({left, y + 5}, tint, text.c_str());
}

void drawEmpty(const Facts& facts, const Area& picture) {
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  list.AddRectFilledMultiColor({picture.x, picture.y},
                               {picture.x + picture.width, picture.y + picture.height},
                               color(0x2B333C), color(0x2B333C), color(0x474F58), color(0x474F58));
  const float x = picture.x + picture.width / 2, y = picture.y + picture.height / 2;
  if (facts.isLoading) {
    drawLabel(list, facts.loading, x, y - 14, Align::centre, color(textColor));
    return;
  }
  const float width = std::min(picture.width - 60, 420.0f) / 2, height = 80;
  list.AddRect({x - width, y - height}, {x + width, y + height}, color(dimColor, 0.7f), 14, 0, 2);
  const std::string text = "drop a .gltf or .glb file here";
  const ImVec2 size = ImGui::CalcTextSize(text.c_str());
  list.AddText({x - size.x / 2, y - size.y / 2}, color(textColor), text.c_str());
}

/// The units' prefix is left to the model: what is 1 in it.
std::string errorLine(const FigureError& error) {
  return fmt::format("{}: at most {:.2g}, {:.0f} % of its bound", methodName(error.method),
                     error.greatest, 100 * error.greatestPartOfBound);
}

struct Legend {
  std::string title, low, high;
  std::vector<std::string> lines;
};

Legend weightsLegend(const SceneView& view, const State& state) {
  Legend legend{"weight", "0", "1", {}};
  if (state.joint < view.joints().size()) legend.title += " of " + view.joints()[state.joint].name;
  return legend;
}

Legend errorLegend(const Facts& facts, const State& state) {
  Legend legend{"error of position, in the model's unit", "0", "", {}};
  if (facts.errors == nullptr) {
    legend.lines.push_back("computing the reference …");
    return legend;
  }
  double greatest = 0;
  for (const FigureError& error : facts.errors->figures) {
    greatest = std::max(greatest, error.greatest);
    legend.lines.push_back(errorLine(error));
  }
  legend.high = fmt::format("{:.2g}", greatest);
  const bool isOld =
      facts.errors->time != state.playback.time() || facts.errors->clip != state.clip;
  legend.lines.push_back(
      fmt::format("at {:.2f} s{}", facts.errors->time, isOld ? ", not of the pose shown" : ""));
  return legend;
}

void drawLegend(const Legend& legend, const Area& picture) {
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  const float line = ImGui::GetTextLineHeight() + 3, pad = 12, barWidth = 240, barHeight = 12;
  float width = std::max(barWidth, ImGui::CalcTextSize(legend.title.c_str()).x);
  for (const std::string& text : legend.lines)
    width = std::max(width, ImGui::CalcTextSize(text.c_str()).x);
  const float height =
      2 * pad + line + barHeight + 4 + line + line * static_cast<float>(legend.lines.size());
  const float x = picture.x + picture.width - width - 2 * pad - 16, y = picture.y + 56;
  list.AddRectFilled({x, y}, {x + width + 2 * pad, y + height}, color(panelColor, 0.82f), 8);
  const float left = x + pad;
  float top = y + pad;
  list.AddText({left, top}, color(textColor), legend.title.c_str());
  top += line + 2;
  constexpr int steps = 32;
  for (int step = 0; step < steps; ++step) {
    const float a = static_cast<float>(step) / steps, b = static_cast<float>(step + 1) / steps;
    const ImU32 from = heatColor(a), to = heatColor(b);
    list.AddRectFilledMultiColor({left + a * width, top}, {left + b * width, top + barHeight}, from,
                                 to, to, from);
  }
  top += barHeight + 2;
  list.AddText({left, top}, color(dimColor), legend.low.c_str());
  const float high = ImGui::CalcTextSize(legend.high.c_str()).x;
  list.AddText({left + width - high, top}, color(dimColor), legend.high.c_str());
  top += line;
  for (const std::string& text : legend.lines) {
    list.AddText({left, top}, color(textColor, 0.9f), text.c_str());
    top += line;
  }
}

samples::render::Camera cameraOf(const Area& area, const State& state) {
  // How far away things are cut off does not matter here.
  return state.camera.camera(Box{{0, 0, 0}, {0, 0, 0}}, area.width / area.height);
}

void drawViews(const Facts& facts, const Area& picture, const State& state) {
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  std::vector<glm::vec3> joints;
  if (state.showsJoints) {
    joints = jointPositions(facts.view->scene(), facts.view->joints(), state.clip,
                            state.playback.time());
  }
  for (std::uint32_t index = 0; index < state.views(); ++index) {
    const Area area = picture.part(index, state.views());
    if (state.showsJoints) drawJoints(*facts.view, state, joints, cameraOf(area, state), area);
    if (index > 0) {
      list.AddLine({area.x, area.y}, {area.x, area.y + area.height}, color(0x0B0F14, 0.55f), 2);
    }
    drawLabel(list, std::string(methodName(facts.methods[index])), area.x + area.width / 2,
              area.y + 16, Align::centre, color(textColor));
  }
}

}  // namespace

void drawOverlay(const Facts& facts, const Area& picture, const State& state) {
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  if (facts.view == nullptr) {
    drawEmpty(facts, picture);
  } else {
    drawViews(facts, picture, state);
    if (state.coloring == Coloring::weights) drawLegend(weightsLegend(*facts.view, state), picture);
    if (state.coloring == Coloring::error) drawLegend(errorLegend(facts, state), picture);
    if (facts.isLoading) {
      drawLabel(list, facts.loading, picture.x + 16, picture.y + 16, Align::left, color(warmColor));
    }
  }
  if (!state.notice.empty()) {
    drawLabel(list, state.notice, picture.x + picture.width / 2, picture.y + picture.height - 110,
              Align::centre, color(accentColor));
  }
}

}  // namespace dermis::viewer
