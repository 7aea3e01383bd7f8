#include "clips/curve.h"

#include <algorithm>
#include <cmath>

#include "strict_floating_point.h"

namespace dermis {
namespace {

Value mix(const Value& a, double share, const Value& b, double other) {
  Value result;
  for (std::size_t i = 0; i < 4; ++i) result[i] = share * a[i] + other * b[i];
  return result;
}

Value valueOf(const ChannelView& channel, std::size_t key, KeyPart part = KeyPart::value) {
  const std::size_t width = channel.path == ChannelPath::rotation ? 4 : 3;
  const float* numbers = keyPart(channel, width, key, part);
  Value value{};
  for (std::size_t i = 0; i < width; ++i) value[i] = double{numbers[i]};
  return value;
}

}  // namespace

double dot(const Value& a, const Value& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

Value normalized(Value quaternion) {
  normalizeQuaternion(quaternion);
  return quaternion;
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
  Value value{};
  interpolate(*channel_, time, std::span(value).first(isRotation() ? 4 : 3), side);
  return value;
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
      const double speed = distance(normalized(valueOf(*channel_, key)),
                                    normalized(valueOf(*channel_, key + 1)), true) /
                           (2 * length);
      worst = std::max(worst, speed * speed);
      continue;
    }
    // The second derivative of the polynomial (glTF 2.0, appendix C.5) is linear, so it is largest
    // at an end: 6 (to − from) − length (4 leaving + 2 arriving), all over length², and the other.
    const Value step = mix(valueOf(*channel_, key + 1), 1, valueOf(*channel_, key), -1);
    const Value leaving = valueOf(*channel_, key, KeyPart::outTangent);
    const Value arriving = valueOf(*channel_, key + 1, KeyPart::inTangent);
    for (const double end : {1.0, -1.0}) {
      const Value slopes = mix(leaving, -3 - end, arriving, -3 + end);
      const Value second = mix(step, 6, slopes, length);
      worst = std::max(worst, std::sqrt(dot(second, second)) / (length * length * smallest));
    }
  }
  return worst;
}

}  // namespace dermis
