// Measures how a character would move over the ground when it plays a clip in place, from the
// motion of its soles.
#pragma once

#include <vector>

#include "kit/character.h"

namespace crowd_film {

struct ClipGait {
  /// Distance that the character moves in a tick, in the units of the file. {0, 0}: it stands.
  double stepX = 0, stepZ = 0;
  double ground = 0;  ///< height of the ground that it stands on

  bool walks() const { return stepX != 0 || stepZ != 0; }
};

struct Gait {
  double height = 0;                ///< of the character
  double length = 0;                ///< of its longer side, seen from above
  double middleX = 0, middleZ = 0;  ///< the point below its middle
  std::vector<ClipGait> clips;
};

/// Throws `Failure` if `reference::skin` fails.
Gait measureGait(const dermis::samples::Character& character);

}  // namespace crowd_film
