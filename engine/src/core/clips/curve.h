// The channels of source clips as functions of time, in double precision.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "clips/interpolate.h"
#include "dermis/clips.h"

namespace dermis {

using Value = std::array<double, 4>;  ///< x, y, z, and w of rotations

/// One property of one node in one clip, or its value at rest.
class Curve {
 public:
  Curve() = default;
  /// `channel` may be null: the value is `rest`. With `base`, values are differences from it.
  Curve(const ChannelView* channel, ChannelPath path, const Value& rest,
        const std::optional<Value>& base);

  Value at(double time, Side side = Side::after) const;
  bool isRotation() const { return path_ == ChannelPath::rotation; }
  /// Times of the keys in the clip. Between two of them there is no corner.
  std::vector<double> keyTimes(double duration) const;
  /// Where the value jumps by more than `tolerance`, by `distance`.
  std::vector<double> jumps(double duration, double tolerance) const;
  /// The most that the second derivative by time can be from one time to another, as a length. For
  /// rotations it is that of the quaternion. Empty where no formula is known: splines of rotations.
  std::optional<double> curvature(double from, double to) const;

 private:
  Value sourceAt(double time, Side side) const;

  const ChannelView* channel_ = nullptr;
  ChannelPath path_ = ChannelPath::translation;
  Value rest_{};
  std::optional<Value> base_;
};

/// The angle between two rotations of unit length in radians, or the distance of two vectors.
double distance(const Value& a, const Value& b, bool isRotation);
double dot(const Value& a, const Value& b);
Value normalized(Value quaternion);
/// a · b of quaternions.
Value product(const Value& a, const Value& b);

}  // namespace dermis
