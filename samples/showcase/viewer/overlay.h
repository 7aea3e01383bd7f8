// The overlay of the picture: names, joints, and the color scale.
#pragma once

#include "state.h"

namespace dermis::viewer {

/// Drawn behind all windows of the interface.
void drawOverlay(const Facts& facts, const Area& picture, const State& state);

}  // namespace dermis::viewer
