#include "legend.h"

#include <fmt/format.h>

#include <algorithm>

#include "gui_style.h"

namespace dermis::viewer {
namespace {

constexpr float barHeight = 12;

struct Legend {
  std::string title, low, high;
  std::vector<std::string> lines;
};

Legend weightsLegend(const SceneView& view, const State& state) {
  Legend legend{"weight", "0", "1", {}};
  if (state.joint < view.joints().size()) legend.title += " of " + view.joints()[state.joint].name;
  return legend;
}

void addError(const FigureError& error, Legend& legend) {
  legend.lines.push_back(std::string(methodName(error.method)));
  legend.lines.push_back(fmt::format("  largest error {:.2g}", error.greatest));
  legend.lines.push_back(
      fmt::format("  largest error ÷ bound {:.0f} %", 100 * error.greatestPartOfBound));
}

Legend errorLegend(const Facts& facts, const State& state) {
  // Only the author of the model knows the unit.
  Legend legend{"position error", "0", "", {}};
  if (facts.errors == nullptr) {
    legend.lines.push_back("computing the reference …");
    return legend;
  }
  double greatest = 0;
  for (const FigureError& error : facts.errors->figures) {
    greatest = std::max(greatest, error.greatest);
    addError(error, legend);
  }
  legend.high = fmt::format("{:.2g}", greatest);
  const bool isOld =
      facts.errors->time != state.playback.time() || facts.errors->clip != state.clip;
  legend.lines.push_back(fmt::format("of the pose at {:.2f} s{}", facts.errors->time,
                                     isOld ? ", not the one shown" : ""));
  return legend;
}

Legend legendOf(const Facts& facts, const State& state) {
  return state.coloring == Coloring::weights ? weightsLegend(*facts.view, state)
                                             : errorLegend(facts, state);
}

float lineHeight() {
  return ImGui::GetTextLineHeight() + 3;
}

void drawBar(ImDrawList& list, float x, float y, float width) {
  constexpr int steps = 32;
  for (int step = 0; step < steps; ++step) {
    const float a = static_cast<float>(step) / steps, b = static_cast<float>(step + 1) / steps;
    const ImU32 from = heatColor(a), to = heatColor(b);
    list.AddRectFilledMultiColor({x + a * width, y}, {x + b * width, y + barHeight}, from, to, to,
                                 from);
  }
}

}  // namespace

float legendHeight(const Facts& facts, const State& state) {
  const auto lines = static_cast<float>(legendOf(facts, state).lines.size());
  return barHeight + 4 + lineHeight() * (2 + lines);
}

void drawLegend(const Facts& facts, const State& state, ImDrawList& list, float x, float y,
                float width) {
  const Legend legend = legendOf(facts, state);
  list.AddText({x, y}, color(textColor), legend.title.c_str());
  y += lineHeight() + 2;
  drawBar(list, x, y, width);
  y += barHeight + 2;
  list.AddText({x, y}, color(dimColor), legend.low.c_str());
  const float high = ImGui::CalcTextSize(legend.high.c_str()).x;
  list.AddText({x + width - high, y}, color(dimColor), legend.high.c_str());
  for (const std::string& text : legend.lines) {
    y += lineHeight();
    list.AddText({x, y}, color(textColor, 0.9f), text.c_str());
  }
}

}  // namespace dermis::viewer
