#include "clips/interpolate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "strict_floating_point.h"

namespace dermis {
namespace {

// glTF 2.0, appendix C.4: interpolates along the shorter arc. Linear if the two are so close that
// the angle is lost in rounding.
void slerp(const float* from, const float* to, double fraction, std::span<double> value) {
  double cosine = 0;
  for (std::size_t i = 0; i < 4; ++i) cosine += double{from[i]} * double{to[i]};
  const double direction = cosine < 0 ? -1 : 1;
  const double squaredSine = 1 - cosine * cosine;
  double fromShare = 1 - fraction;
  double toShare = fraction;
  if (squaredSine > std::numeric_limits<double>::epsilon()) {
    const double sine = std::sqrt(squaredSine);
    const double angle = std::atan2(sine, cosine * direction);
    fromShare = std::sin(fromShare * angle) / sine;
    toShare = std::sin(toShare * angle) / sine;
  }
  for (std::size_t i = 0; i < 4; ++i) {
    value[i] = fromShare * double{from[i]} + direction * toShare * double{to[i]};
  }
}

// glTF 2.0, appendix C.5: a Hermite spline whose tangents are scaled by the time between the keys.
void cubicSpline(const ChannelView& channel, std::size_t key, double distance, double t,
                 std::span<double> value) {
  const float* from = keyPart(channel, value.size(), key, KeyPart::value);
  const float* leaving = keyPart(channel, value.size(), key, KeyPart::outTangent);
  const float* arriving = keyPart(channel, value.size(), key + 1, KeyPart::inTangent);
  const float* to = keyPart(channel, value.size(), key + 1, KeyPart::value);
  const double t2 = t * t;
  const double t3 = t2 * t;
  for (std::size_t i = 0; i < value.size(); ++i) {
    value[i] = (2 * t3 - 3 * t2 + 1) * double{from[i]} +
               distance * (t3 - 2 * t2 + t) * double{leaving[i]} +
               (3 * t2 - 2 * t3) * double{to[i]} + distance * (t3 - t2) * double{arriving[i]};
  }
}

void between(const ChannelView& channel, std::size_t key, double time, std::span<double> value) {
  const double distance = double{channel.times[key + 1]} - double{channel.times[key]};
  const double fraction = (time - double{channel.times[key]}) / distance;
  const float* from = keyPart(channel, value.size(), key, KeyPart::value);
  const float* to = keyPart(channel, value.size(), key + 1, KeyPart::value);
  if (channel.interpolation == Interpolation::cubicSpline) {
    cubicSpline(channel, key, distance, fraction, value);
  } else if (channel.path == ChannelPath::rotation) {
    slerp(from, to, fraction, value);
  } else {
    for (std::size_t i = 0; i < value.size(); ++i) {
      value[i] = (1 - fraction) * double{from[i]} + fraction * double{to[i]};
    }
  }
}

}  // namespace

const float* keyPart(const ChannelView& channel, std::size_t width, std::size_t key, KeyPart part) {
  if (channel.interpolation != Interpolation::cubicSpline) return &channel.values[key * width];
  return &channel.values[(3 * key + static_cast<std::size_t>(part)) * width];
}

double normalizeQuaternion(std::span<double, 4> quaternion) {
  double square = 0;
  for (const double component : quaternion) square += component * component;
  const double length = std::sqrt(square);
  if (!std::isnormal(square)) {
    std::ranges::copy(std::array<double, 4>{0, 0, 0, 1}, quaternion.begin());
    return length;
  }
  for (double& component : quaternion) component /= length;
  return length;
}

void interpolate(const ChannelView& channel, double time, std::span<double> value, Side side) {
  // The last key that is not after the time, or that is before it; the first if there is none.
  const auto after = std::partition_point(
      channel.times.begin(), channel.times.end(),
      [&](float key) { return side == Side::after ? time >= double{key} : time > double{key}; });
  const auto next = static_cast<std::size_t>(after - channel.times.begin());
  const std::size_t key = next == 0 ? 0 : next - 1;
  const bool hold = next == 0 || next == channel.times.size() ||
                    channel.interpolation == Interpolation::step ||
                    time == double{channel.times[key]};
  if (hold) {
    std::copy_n(keyPart(channel, value.size(), key, KeyPart::value), value.size(), value.begin());
  } else {
    between(channel, key, time, value);
  }
  if (channel.path == ChannelPath::rotation) normalizeQuaternion(value.first<4>());
}

}  // namespace dermis
