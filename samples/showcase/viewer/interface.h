// The panel, and the overlay of the picture.
#pragma once

#include "state.h"

namespace dermis::viewer {

/// The area of the picture of the scene, next to the panel.
Area pictureArea(const State& state, float windowWidth, float windowHeight);

/// Call between `Gui::beginFrame` and `endFrame`. Changes the state as the user requests.
void drawInterface(const Facts& facts, const Area& picture, State& state);

}  // namespace dermis::viewer
