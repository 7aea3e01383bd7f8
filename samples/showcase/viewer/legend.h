// The legend of a heat map.
#pragma once

#include <imgui.h>

#include "state.h"

namespace dermis::viewer {

/// The height of the legend. Weights or errors must be shown as colors.
float legendHeight(const Facts& facts, const State& state);
void drawLegend(const Facts& facts, const State& state, ImDrawList& list, float x, float y,
                float width);

}  // namespace dermis::viewer
