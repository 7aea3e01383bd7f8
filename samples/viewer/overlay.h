// What lies on the picture itself: names, joints, the scale of colors.
#pragma once

#include "state.h"

namespace dermis::viewer {

/// Behind all windows of the interface.
void drawOverlay(const Facts& facts, const Area& picture, const State& state);

}  // namespace dermis::viewer
