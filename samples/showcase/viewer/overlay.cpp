#include "overlay.h"

#include <fmt/format.h>

#include "gui_style.h"
#include "joint_overlay.h"
#include "legend.h"

namespace dermis::viewer {
namespace {

enum class Align { left, center, right };

/// A line of text on a dark background.
void drawLabel(ImDrawList& list, const std::string& text, float x, float y, Align align,
               ImU32 tint) {
  const ImVec2 size = ImGui::CalcTextSize(text.c_str());
  const float left = align == Align::left     ? x + 10
                     : align == Align::center ? x - size.x / 2
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
    drawLabel(list, facts.loading, x, y - 14, Align::center, color(textColor));
    return;
  }
  const float width = std::min(picture.width - 60, 420.0f) / 2, height = 80;
  list.AddRect({x - width, y - height}, {x + width, y + height}, color(dimColor, 0.7f), 14, 0, 2);
  const std::string text = "drop a .gltf or .glb file here";
  const ImVec2 size = ImGui::CalcTextSize(text.c_str());
  list.AddText({x - size.x / 2, y - size.y / 2}, color(textColor), text.c_str());
}

/// Draws the legend on the picture if there is no panel for it.
void drawFreeLegend(const Facts& facts, const Area& picture, const State& state) {
  const float width = 250, pad = 12;
  const float height = legendHeight(facts, state);
  const float x = picture.x + 16, y = picture.y + picture.height - 80 - height - 2 * pad;
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  list.AddRectFilled({x, y}, {x + width + 2 * pad, y + height + 2 * pad}, color(panelColor, 0.82f),
                     8);
  drawLegend(facts, state, list, x + pad, y + pad, width);
}

samples::render::Camera cameraOf(const Area& area, const State& state) {
  // The clipping planes do not matter here.
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
              area.y + 16, Align::center, color(textColor));
  }
}

}  // namespace

void drawOverlay(const Facts& facts, const Area& picture, const State& state) {
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  if (facts.view == nullptr) {
    drawEmpty(facts, picture);
  } else {
    drawViews(facts, picture, state);
    if (!state.showsPanel && state.coloring != Coloring::surface)
      drawFreeLegend(facts, picture, state);
    if (facts.isLoading) {
      drawLabel(list, facts.loading, picture.x + 16, picture.y + 16, Align::left, color(warmColor));
    }
  }
  if (!state.notice.empty()) {
    drawLabel(list, state.notice, picture.x + picture.width / 2, picture.y + picture.height - 110,
              Align::center, color(accentColor));
  }
}

}  // namespace dermis::viewer
