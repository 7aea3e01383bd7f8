// Measures the time to the first skinned frame of a new scene.
#pragma once

#include "kit/bench/crowd.h"
#include "kit/open_device.h"

namespace dermis::samples {

/// Time from `Context::create` to the end of the first frame, for one instance skinned by dual
/// quaternions. Most of it is spent in the driver's compiler, unless the driver finds the pipelines
/// in its own cache.
struct StartUp {
  double seconds = 0;
  double secondsWithoutScale = 0;  ///< with `mayScale` false
};

/// Fails if the device does.
Result<StartUp> measureStartUp(OpenDevice& open, const Crowd& crowd);

}  // namespace dermis::samples
