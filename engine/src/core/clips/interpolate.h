// Interpolates one channel at one time, in double precision.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "dermis/clips.h"

namespace dermis {

/// Which limit counts where a value jumps.
enum class Side : std::uint8_t { before, after };

/// A part of a key of a spline, by its place.
enum class KeyPart : std::uint8_t { inTangent, value, outTangent };

/// A part of a key, of which only splines have others than the value. `width`: numbers of a value.
const float* keyPart(const ChannelView& channel, std::size_t width, std::size_t key, KeyPart part);

/// Writes the channel's value at a time in seconds, clamped to its keys, to `value`: as many
/// numbers as a key has. Rotations have unit length. A time that is NaN counts as before the first
/// key.
DERMIS_CORE_API void interpolate(const ChannelView& channel, double time, std::span<double> value,
                                 Side side = Side::after);

/// Divides a quaternion by its length, and returns the length. If that is impossible or not exact
/// (the square of the length is 0, denormal or not finite), it becomes the identity.
DERMIS_CORE_API double normalizeQuaternion(std::span<double, 4> quaternion);

}  // namespace dermis
