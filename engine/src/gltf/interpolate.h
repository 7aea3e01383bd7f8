// One channel at one time.
#pragma once

#include <span>

#include "dermis/gltf.h"

namespace dermis::gltf {

/// The channel's value at a time in seconds, clamped to its keys, into `value`:
/// `channel.components` doubles. Rotations come out with unit length. A time that is not a number
/// counts as one before the first key.
void interpolate(const Channel& channel, double time, std::span<double> value);

}  // namespace dermis::gltf
