// How long a scene takes from nothing to its first skinned frame.
#pragma once

#include "crowd.h"
#include "open_device.h"

namespace dermis::samples {

/// From `Context::create` to the end of the first frame, for one instance that is skinned by dual
/// quaternions. Most of it is the driver's compiler, unless the driver finds the pipelines in a
/// cache of its own.
struct StartUp {
  double seconds = 0;
  double secondsWithoutScale = 0;  ///< if the pose may not scale
};

/// Fails if the device does.
Result<StartUp> measureStartUp(OpenDevice& open, const Crowd& crowd);

}  // namespace dermis::samples
