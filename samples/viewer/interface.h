// The panel, and what lies over the picture.
#pragma once

#include "state.h"

namespace dermis::viewer {

/// Where the picture of the scene goes, beside the panel.
Area pictureArea(const State& state, float windowWidth, float windowHeight);

/// Between `Gui::beginFrame` and `endFrame`. Changes the state as the user does.
void drawInterface(const Facts& facts, const Area& picture, State& state);

}  // namespace dermis::viewer
