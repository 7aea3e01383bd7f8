#include "clips/curve.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "strict_floating_point.h"

namespace dermis {
namespace {

double dot(const Value& a, const Value& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

Value mix(const Value& a, double share, const Value& b, double other) {
  Value result;
  for (std::size_t i = 0; i < 4; ++i) result[i] = share * a[i] + other * b[i];
  return result;
}

Value slerp(const Value& from, const Value& to, double fraction) {
  const double cosine = dot(from, to), direction = cosine < 0 ? -1 : 1;
  const double squaredSine = 1 - cosine * cosine;
  if (squaredSine <= std::numeric_limits<double>::epsilon())
    return mix(from, 1 - fraction, to, direction * fraction);
  const double sine = std::sqrt(squaredSine), angle = std::atan2(sine, cosine * direction);
  return mix(from, std::sin((1 - fraction) * angle) / sine, to,
             direction * std::sin(fraction * angle) / sine);
}

// The place of each part of a key of a spline.
enum class Part : std::size_t { inTangent, value, outTangent };

Value part(const ChannelView& channel, std::size_t key, Part part) {
  const std::size_t width = channel.path == ChannelPath::rotation ? 4 : 3;
  const bool isSpline = channel.interpolation == Interpolation::cubicSpline;
  const std::size_t first = width * (isSpline ? 3 * key + static_cast<std::size_t>(part) : key);
  Value value{};
  for (std::size_t i = 0; i < width; ++i) value[i] = double{channel.values[first + i]};
  return value;
}

/// The interval of a spline as a polynomial of the fraction: a + b f + c f² + d f³ (glTF 2.0,
/// appendix C.5).
std::array<Value, 4> spline(const ChannelView& channel, std::size_t key, double length) {
  const Value from = part(channel, key, Part::value), to = part(channel, key + 1, Part::value);
  const Value leaving = part(channel, key, Part::outTangent);
  const Value arriving = part(channel, key + 1, Part::inTangent);
  std::array<Value, 4> result{};
  for (std::size_t i = 0; i < 4; ++i) {
    const double m = length * leaving[i], n = length * arriving[i], step = to[i] - from[i];
    result[0][i] = from[i];
    result[1][i] = m;
    result[2][i] = 3 * step - 2 * m - n;
    result[3][i] = m + n - 2 * step;
  }
  return result;
}

}  // namespace

Value normalized(const Value& quaternion) {
  const double length = std::sqrt(dot(quaternion, quaternion));
  return length > 0 ? mix(quaternion, 1 / length, {}, 0) : Value{0, 0, 0, 1};
}

Value product(const Value& a, const Value& b) {
  return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
          a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
          a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
          a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

double distance(const Value& a, const Value& b, bool isRotation) {
  const Value difference = mix(a, 1, b, isRotation && dot(a, b) < 0 ? 1 : -1);
  const double length = std::sqrt(dot(difference, difference));
  return isRotation ? 4 * std::asin(std::min(1.0, length / 2)) : length;
}

Curve::Curve(const ChannelView* channel, ChannelPath path, const Value& rest,
             const std::optional<Value>& base)
    : channel_(channel), path_(path), rest_(rest), base_(base) {}

Value Curve::sourceAt(double time, Side side) const {
  if (channel_ == nullptr) return rest_;
  const std::span<const float> times = channel_->times;
  // The last key that is not after the time, or before it.
  const auto after = std::partition_point(times.begin(), times.end(), [&](float key) {
    return side == Side::after ? double{key} <= time : double{key} < time;
  });
  const auto next = static_cast<std::size_t>(after - times.begin());
  const std::size_t key = next == 0 ? 0 : next - 1;
  Value value = part(*channel_, key, Part::value);
  if (next > 0 && next < times.size() && channel_->interpolation != Interpolation::step &&
      time > double{times[key]}) {
    const double length = double{times[next]} - double{times[key]};
    const double f = (time - double{times[key]}) / length;
    if (channel_->interpolation == Interpolation::cubicSpline) {
      const std::array<Value, 4> p = spline(*channel_, key, length);
      for (std::size_t i = 0; i < 4; ++i)
        value[i] = p[0][i] + f * (p[1][i] + f * (p[2][i] + f * p[3][i]));
    } else {
      const Value to = part(*channel_, next, Part::value);
      value = isRotation() ? slerp(value, to, f) : mix(value, 1 - f, to, f);
    }
  }
  return isRotation() ? normalized(value) : value;
}

Value Curve::at(double time, Side side) const {
  Value value = sourceAt(time, side);
  if (!base_) return value;
  if (isRotation()) return product({-(*base_)[0], -(*base_)[1], -(*base_)[2], (*base_)[3]}, value);
  for (std::size_t i = 0; i < 3; ++i) {
    if (path_ == ChannelPath::translation)
      value[i] -= (*base_)[i];
    else
      value[i] = (*base_)[i] != 0 ? value[i] / (*base_)[i] : 1;
  }
  return value;
}

std::vector<double> Curve::keyTimes(double duration) const {
  std::vector<double> times;
  if (channel_ == nullptr) return times;
  for (const float time : channel_->times) {
    if (time >= 0 && double{time} <= duration && (times.empty() || double{time} > times.back()))
      times.push_back(double{time});
  }
  return times;
}

std::vector<double> Curve::jumps(double duration, double tolerance) const {
  std::vector<double> result;
  for (const double time : keyTimes(duration)) {
    if (time > 0 && distance(at(time, Side::before), at(time), isRotation()) > tolerance)
      result.push_back(time);
  }
  return result;
}

std::optional<double> Curve::curvature(double from, double to) const {
  if (channel_ == nullptr || channel_->interpolation == Interpolation::step) return 0;
  const bool isSpline = channel_->interpolation == Interpolation::cubicSpline;
  if (!isSpline && !isRotation()) return 0;
  if (isSpline && isRotation()) return std::nullopt;
  double smallest = 1;  // divisor of a difference of scales
  if (base_ && path_ == ChannelPath::scale) {
    for (std::size_t i = 0; i < 3; ++i) {
      if ((*base_)[i] != 0) smallest = std::min(smallest, std::abs((*base_)[i]));
    }
  }
  double worst = 0;
  const std::span<const float> times = channel_->times;
  auto key = static_cast<std::size_t>(
      std::partition_point(times.begin(), times.end(),
                           [&](float time) { return double{time} <= from; }) -
      times.begin());
  if (key > 0) --key;
  for (; key + 1 < times.size() && double{times[key]} < to; ++key) {
    const double length = double{times[key + 1]} - double{times[key]};
    if (length <= 0) continue;
    if (isRotation()) {
      // On a great circle: the square of the speed of the quaternion, half of the angle's.
      const double speed = distance(normalized(part(*channel_, key, Part::value)),
                                    normalized(part(*channel_, key + 1, Part::value)), true) /
                           (2 * length);
      worst = std::max(worst, speed * speed);
      continue;
    }
    // The second derivative is linear, so it is largest at an end.
    const std::array<Value, 4> p = spline(*channel_, key, length);
    for (const double f : {0.0, 1.0}) {
      const Value second = mix(p[2], 2, p[3], 6 * f);
      worst = std::max(worst, std::sqrt(dot(second, second)) / (length * length * smallest));
    }
  }
  return worst;
}

}  // namespace dermis
