// Interpolates one channel at one time.
#pragma once

#include <span>

#include "dermis/gltf.h"

namespace dermis::gltf {

/// Writes the channel's value at a time in seconds, clamped to its keys, to `value`:
/// `channel.components` doubles. Rotations have unit length. A time that is NaN counts as before
/// the first key.
void interpolate(const Channel& channel, double time, std::span<double> value);

}  // namespace dermis::gltf
