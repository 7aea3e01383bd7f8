// How a character moves over the ground when it plays a clip on the spot, read off its soles.
#pragma once

#include <vector>

#include "character.h"

namespace crowd {

struct ClipGait {
  /// Metres, or what the file takes for them, that the character comes forward in a tick; {0, 0}:
  /// it stays.
  double stepX = 0, stepZ = 0;
  double ground = 0;  ///< the height of what it stands on

  bool walks() const { return stepX != 0 || stepZ != 0; }
};

struct Gait {
  double height = 0;                ///< of the character
  double length = 0;                ///< of its longer side, seen from above
  double middleX = 0, middleZ = 0;  ///< what it stands above
  std::vector<ClipGait> clips;
};

/// Fails as `reference::skin` does.
dermis::Result<Gait> measureGait(const Character& character);

}  // namespace crowd
