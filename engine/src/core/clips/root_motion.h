// Root motion: the path of a node over the ground, which is taken out of a clip.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "clips/curve.h"
#include "dermis/clips.h"
#include "dermis/result.h"

namespace dermis {

/// A turn about the up axis, then a shift over the ground. The axes of the ground follow the up
/// axis in cyclic order.
struct GroundMotion {
  double first = 0, second = 0;  ///< the shift along the axes of the ground
  double turn = 0;               ///< radians
};

/// `b` in the frame of `a`.
GroundMotion chained(const GroundMotion& a, const GroundMotion& b);
GroundMotion reversed(const GroundMotion& motion);

/// The motion of a clip from its beginning. `start` and `now` are values of its track: where the
/// node is on the ground, and its heading times `length`.
GroundMotion motionBetween(const Value& start, const Value& now, double length);

Transform motionMatrix(const GroundMotion& motion, std::uint32_t upAxis);

/// The parent of the node, which no clip moves: its global transform is a rotation with a uniform
/// scale and a translation.
struct MotionFrame {
  Transform above;
  std::uint32_t upAxis = 1;
  Value localUp{};  ///< the up axis in the frame of the node, of unit length

  /// Fails if the transform is another one.
  static std::optional<MotionFrame> of(const Transform& above, std::uint32_t upAxis);
};

/// What `splitMotion` makes. The channels point to `keys`.
struct SplitMotion {
  ChannelView motion;                ///< the values of `motionBetween`, as if of a translation
  std::optional<ChannelView> place;  ///< what remains of the translation, if it has a channel
  std::optional<ChannelView> turn;   ///< what remains of the rotation, if it has a channel
  /// How far the motion and what remains of the rotation are off, about: twice what was measured.
  double motionError = 0, turnError = 0;
  std::uint64_t bytes = 0;  ///< of `keys`, and of what they were made of
  std::deque<std::vector<float>> keys;
};

/// Splits the translation and the rotation of a node. Straight lines between keys of the results
/// are off by `motionError` and `turnError`, if that needs not too many keys. `place` is exact.
/// Empty if the result takes more than `mostBytes`.
std::optional<SplitMotion> splitMotion(const MotionFrame& frame, const ChannelView* translation,
                                       const ChannelView* rotation, const Value& restTranslation,
                                       const Value& restRotation, double duration, double length,
                                       double motionError, double turnError,
                                       std::uint64_t mostBytes);

}  // namespace dermis
