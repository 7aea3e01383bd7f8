#include "clips/track.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "strict_floating_point.h"

namespace dermis {
namespace {

constexpr double unitRounding = 0x1p-24;

Value mixed(const Value& a, const Value& b, double fraction, bool isRotation) {
  const double other = isRotation && dot(a, b) < 0 ? -fraction : fraction;
  Value value;
  for (std::size_t i = 0; i < 4; ++i) value[i] = (1 - fraction) * a[i] + other * b[i];
  return isRotation ? normalized(value) : value;
}

Value inDouble(const std::array<float, 4>& value) {
  return {double{value[0]}, double{value[1]}, double{value[2]}, double{value[3]}};
}

KeyBits rotationBits(const Value& q, KeyFormat format) {
  KeyBits key{};
  for (std::uint32_t i = 1; i < 4; ++i) {
    if (std::abs(q[i]) > std::abs(q[key.missing])) key.missing = i;
  }
  const double sign = q[key.missing] < 0 ? -1 : 1, largest = format.largest();
  for (std::uint32_t i = 0; i < 3; ++i) {
    const double c = sign * q[i < key.missing ? i : i + 1] / std::sqrt(0.5);
    key.values[i] =
        static_cast<std::uint32_t>(std::clamp(std::round((c + 1) / 2 * largest), 0.0, largest));
  }
  return key;
}

KeyBits vectorBits(const Value& v, KeyFormat format, const std::array<float, 8>& range) {
  KeyBits key{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double steps = range[4 + i] > 0 ? (v[i] - double{range[i]}) / double{range[4 + i]} : 0;
    key.values[i] = static_cast<std::uint32_t>(
        std::clamp(std::round(steps), 0.0, static_cast<double>(format.largest())));
  }
  return key;
}

/// At how many points of an interval a curve is measured.
int pointsOf(const std::optional<double>& curvature, int level) {
  if (curvature == 0.0) return 1;
  return std::max(curvature ? 4 : 16, 32 >> std::max(0, -3 - level));
}

/// A curve at one level: what its keys should be, and how far those of a track are off.
class Fit {
 public:
  Fit(const Curve& curve, std::span<const double> keyTimes, std::span<const double> jumpTimes,
      double duration, double rate, int level, double tolerance)
      : curve_(curve),
        duration_(duration),
        interval_(std::ldexp(1, level) / rate),
        tolerance_(tolerance),
        points_(pointsOf(curve.curvature(0, duration), level)),
        jumpTimes_(jumpTimes),
        keyTimes_(keyTimes) {
    const double intervals = std::max(1.0, std::ceil(duration / interval_ - 1e-6));
    values_.resize(static_cast<std::size_t>(intervals) + 1);
    jumps_.resize(values_.size() - 1);
    isPossible_ = placeJumps();
    if (isPossible_) fillKeys();
  }

  bool isPossible() const { return isPossible_; }
  const std::vector<Value>& values() const { return values_; }
  std::vector<std::uint8_t> jumps() const {
    return jumpTimes_.empty() ? std::vector<std::uint8_t>{} : jumps_;
  }

  /// The largest error of keys; stops above the tolerance.
  double errorOf(const std::vector<Value>& keys) const {
    double worst = 0;
    std::size_t nextKey = 0;
    for (std::size_t k = 0; k + 1 < keys.size() && worst <= tolerance_; ++k) {
      const double from = static_cast<double>(k) * interval_;
      const double to = std::min(from + interval_, duration_);
      double found = 0;
      const auto check = [&](double time) {
        if (isNearJump(time)) return;
        const Value value = sample(keys, k, (time - from) / interval_);
        double error = distance(value, curve_.at(time), curve_.isRotation());
        if (error > tolerance_)  // beside a jump that is too small to count
          error =
              std::min(error, distance(value, curve_.at(time, Side::before), curve_.isRotation()));
        found = std::max(found, error);
      };
      for (int i = 0; i < points_; ++i) {
        if (const double time = from + i * interval_ / points_; time <= to) check(time);
      }
      check(to);
      while (nextKey < keyTimes_.size() && keyTimes_[nextKey] < from) ++nextKey;
      for (std::size_t i = nextKey; i < keyTimes_.size() && keyTimes_[i] <= to; ++i)
        check(keyTimes_[i]);
      found += betweenPoints(keys, k, from, to);
      worst = std::max(worst, found);
    }
    for (const double time : jumpTimes_) {
      const std::size_t k = intervalOf(time);
      worst =
          std::max({worst, distance(curve_.at(time, Side::before), keys[k], curve_.isRotation()),
                    distance(curve_.at(time), keys[k + 1], curve_.isRotation())});
    }
    return worst;
  }

  /// What float32 adds: times are rounded, and so is arithmetic.
  double roundingOf(const std::vector<Value>& keys) const {
    double step = 0, size = 0;
    for (std::size_t k = 0; k < keys.size(); ++k) {
      if (k > 0) step = std::max(step, distance(keys[k - 1], keys[k], curve_.isRotation()));
      size = std::max(size, std::sqrt(dot(keys[k], keys[k])));
    }
    return unitRounding * (4 * step * duration_ / interval_ + 16 * size);
  }

 private:
  /// The interval that a jump ends or lies in.
  std::size_t intervalOf(double time) const {
    const double position = time / interval_, k = std::floor(position);
    const auto number = std::min(static_cast<std::size_t>(k), jumps_.size());
    return number > 0 && (position - k) * 256 < 1.5 ? number - 1
                                                    : std::min(number, jumps_.size() - 1);
  }

  bool placeJumps() {
    for (const double time : jumpTimes_) {
      const std::size_t k = intervalOf(time);
      const double fraction = time / interval_ - static_cast<double>(k);
      if (jumps_[k] != 0 || (k == 0 && fraction * 256 < 1.5)) return false;
      jumps_[k] = static_cast<std::uint8_t>(std::clamp(std::round(fraction * 256), 2.0, 256.0) - 1);
    }
    return true;
  }

  void fillKeys() {
    for (std::size_t k = 0; k < values_.size(); ++k)
      values_[k] = curve_.at(std::min(static_cast<double>(k) * interval_, duration_));
    // A jump just after a key is moved to it.
    for (const double time : jumpTimes_) {
      const std::size_t next = intervalOf(time) + 1;
      if (static_cast<double>(next) * interval_ <= time) values_[next] = curve_.at(time);
    }
    // The last interval may go on behind the end, where its value has to be that of the clip.
    const std::size_t last = values_.size() - 1;
    const double f = duration_ / interval_ - static_cast<double>(last - 1);
    if (f >= 1 - 1e-9 || f < 0.25 || jumps_[last - 1] != 0) return;
    const Value &from = values_[last - 1], end = values_[last];
    if (!curve_.isRotation()) {
      for (std::size_t i = 0; i < 3; ++i) values_[last][i] = from[i] + (end[i] - from[i]) / f;
      return;
    }
    // Unit length of (c end − (1 − f) from) / f, so that the mean points to `end`.
    const double direction = dot(from, end) < 0 ? -1 : 1;
    const double cosine = direction * dot(from, end), rest = 1 - f;
    const double root = rest * rest * cosine * cosine - rest * rest + f * f;
    if (root <= 0) return;
    const double c = rest * cosine + std::sqrt(root);
    for (std::size_t i = 0; i < 4; ++i)
      values_[last][i] = (c * direction * end[i] - rest * from[i]) / f;
    values_[last] = normalized(values_[last]);
  }

  bool isNearJump(double time) const {
    const double clearance = jumpClearance * interval_;
    const auto next = std::ranges::lower_bound(jumpTimes_, time - clearance);
    return next != jumpTimes_.end() && *next <= time + clearance;
  }

  Value sample(const std::vector<Value>& keys, std::size_t k, double fraction) const {
    if (jumps_[k] != 0) return keys[fraction * 256 >= jumps_[k] + 1 ? k + 1 : k];
    return mixed(keys[k], keys[k + 1], fraction, curve_.isRotation());
  }

  /// How much larger the error may be between two points: an eighth of the square of their distance
  /// times the second derivative.
  double betweenPoints(const std::vector<Value>& keys, std::size_t k, double from,
                       double to) const {
    const std::optional<double> curvature = curve_.curvature(from, to);
    if (!curvature) return 0;
    double second = *curvature * interval_ * interval_;
    if (curve_.isRotation() && jumps_[k] == 0) {
      // With the angle a between quaternions, normalized interpolation moves by at most
      // sin a / cos²(a/2) along its circle, and accelerates by 2 sin a (1 − cos a) / cos⁴(a/2).
      const double cosine = std::abs(dot(keys[k], keys[k + 1]));
      const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine)), half = (1 + cosine) / 2;
      second += sine * sine / (half * half) + 2 * sine * (1 - cosine) / (half * half);
    }
    return (curve_.isRotation() ? 2 : 1) * second / (8 * points_ * points_);
  }

  const Curve& curve_;
  double duration_, interval_, tolerance_;
  /// At which an interval is measured. Between them the error is bounded by an eighth of the square
  /// of their distance, which decides about the size of fast rotations. Between the keys of
  /// straight lines it is largest at a key.
  int points_;
  std::span<const double> jumpTimes_, keyTimes_;
  std::vector<Value> values_;
  std::vector<std::uint8_t> jumps_;
  bool isPossible_ = false;
};

/// Returns false if the values, or the differences of two of them, may overflow.
bool quantize(Track& track, const std::vector<Value>& values) {
  track.keys.clear();
  if (!track.format.isRotation) {
    Value low = values[0], high = values[0];
    for (const Value& value : values) {
      for (std::size_t i = 0; i < 3; ++i) {
        if (!std::isfinite(value[i])) return false;
        low[i] = std::min(low[i], value[i]);
        high[i] = std::max(high[i], value[i]);
      }
    }
    for (std::size_t i = 0; i < 3; ++i) {
      if (!(std::max({-low[i], high[i], high[i] - low[i]}) < 0x1.fffp127)) return false;
      track.range[i] = static_cast<float>(low[i]);
      track.range[4 + i] = static_cast<float>((high[i] - low[i]) / track.format.largest());
    }
  }
  for (const Value& value : values) {
    track.keys.push_back(track.format.isRotation ? rotationBits(value, track.format)
                                                 : vectorBits(value, track.format, track.range));
  }
  return true;
}

std::vector<Value> decoded(const Track& track) {
  std::vector<Value> values;
  for (const KeyBits& key : track.keys) {
    values.push_back(inDouble(track.format.isRotation ? rotationOf(key, track.format)
                                                      : vectorOf(key, track.range)));
  }
  if (track.format.isRotation) {
    for (Value& value : values) value = normalized(value);
  }
  return values;
}

/// How far a curve is from one value, at most.
double errorOfConstant(const Curve& curve, double duration, const Value& value, double tolerance) {
  double worst = 0;
  std::vector<double> times = curve.keyTimes(duration);
  times.insert(times.begin(), 0);
  times.push_back(duration);
  for (std::size_t i = 0; i + 1 < times.size() && worst <= tolerance; ++i) {
    double found = 0;
    for (int step = 0; step <= 16; ++step) {
      const double time = times[i] + step / 16.0 * (times[i + 1] - times[i]);
      for (const Side side : {Side::after, Side::before}) {
        if (side == Side::before && time <= 0) continue;  // no time is before 0
        found = std::max(found, distance(curve.at(time, side), value, curve.isRotation()));
      }
    }
    const double gap = (times[i + 1] - times[i]) / 16;
    found += (curve.isRotation() ? 2 : 1) * gap * gap / 8 *
             curve.curvature(times[i], times[i + 1]).value_or(0);
    worst = std::max(worst, found);
  }
  return worst;
}

std::optional<Track> fitConstant(const Curve& curve, const Value& rest, double duration,
                                 double tolerance) {
  Track track;
  track.error = errorOfConstant(curve, duration, rest, tolerance);
  if (track.error <= tolerance) return track;
  const Value first = curve.at(0);
  for (std::size_t i = 0; i < 4; ++i) track.constant[i] = static_cast<float>(first[i]);
  track.kind = TrackKind::constant;
  Value value = inDouble(track.constant);
  if (curve.isRotation()) value = normalized(value);
  track.error = errorOfConstant(curve, duration, value, tolerance);
  if (track.error <= tolerance) return track;
  return std::nullopt;
}

}  // namespace

Value Track::at(double time, double rate, const Value& rest, bool isRotation) const {
  if (kind == TrackKind::rest) return rest;
  if (kind == TrackKind::constant)
    return isRotation ? normalized(inDouble(constant)) : inDouble(constant);
  const double position = time * rate / std::ldexp(1, level);
  const double k = std::min(std::floor(position), static_cast<double>(keys.size() - 2));
  double fraction = position - k;
  const auto row = static_cast<std::size_t>(k);
  if (!jumps.empty() && jumps[row] != 0) fraction = fraction * 256 >= jumps[row] + 1 ? 1 : 0;
  const auto value = [&](std::size_t i) {
    return inDouble(isRotation ? rotationOf(keys[i], format) : vectorOf(keys[i], range));
  };
  return mixed(value(row), value(row + 1), fraction, isRotation);
}

std::optional<Track> fitTrack(const Curve& curve, const Value& rest, double duration, double rate,
                              double tolerance) {
  if (std::optional<Track> constant = fitConstant(curve, rest, duration, tolerance))
    return constant;
  if (!(duration > 0)) return std::nullopt;
  const std::vector<double> keyTimes = curve.keyTimes(duration);
  const std::vector<double> jumpTimes = curve.jumps(duration, tolerance / 4);
  bool overflows = false;
  const int coarsest = std::clamp(static_cast<int>(std::ceil(std::log2(duration * rate))), 0, 20);
  for (int level = coarsest; level >= finestLevel; --level) {
    if (duration * rate / std::ldexp(1, level) > mostIntervals) break;
    const Fit fit(curve, keyTimes, jumpTimes, duration, rate, level, tolerance);
    if (!fit.isPossible() || fit.errorOf(fit.values()) > tolerance) continue;
    Track track;
    track.kind = TrackKind::animated;
    track.level = level;
    track.jumps = fit.jumps();
    for (track.format = {curve.isRotation(), 0}; track.format.size < 3; ++track.format.size) {
      if (!quantize(track, fit.values())) {
        overflows = true;
        break;
      }
      const std::vector<Value> keys = decoded(track);
      const double error = fit.errorOf(keys);
      if (error > tolerance) continue;
      track.error = error + fit.roundingOf(keys);
      return track;
    }
  }
  if (!overflows) return std::nullopt;
  Track track;
  track.error = std::numeric_limits<double>::infinity();
  return track;
}

}  // namespace dermis
