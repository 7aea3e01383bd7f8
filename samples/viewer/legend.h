// What the colors of a heat map mean.
#pragma once

#include <imgui.h>

#include "state.h"

namespace dermis::viewer {

/// Where weights or errors are shown as colors.
float legendHeight(const Facts& facts, const State& state);
void drawLegend(const Facts& facts, const State& state, ImDrawList& list, float x, float y,
                float width);

}  // namespace dermis::viewer
