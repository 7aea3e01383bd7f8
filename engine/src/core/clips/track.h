// Fits keys at equal distances to a curve.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "clips/bank.h"
#include "clips/curve.h"

namespace dermis {

/// What is stored of a curve.
struct Track {
  TrackKind kind = TrackKind::rest;
  std::array<float, 4> constant{};
  KeyFormat format;
  int level = 0;  ///< an interval is 2^level / rate
  std::vector<KeyBits> keys;
  std::array<float, 8> range{};
  std::vector<std::uint8_t> jumps;  ///< one for each interval, as in the bank; or empty
  double error = 0;                 ///< as `ClipError`

  /// As it is sampled, but in double precision. `rate`: finest intervals a second.
  Value at(double time, double rate, const Value& rest, bool isRotation) const;
};

inline constexpr int finestLevel = -10;             ///< of `fitTrack`
inline constexpr double mostIntervals = 1 << 20;    ///< of a clip at its finest rate
inline constexpr double jumpClearance = 2.0 / 256;  ///< intervals in which a jump is rounded

/// The smallest track that is off by `tolerance` at most, if there is one. `rest` is the value of a
/// track without numbers. The error is infinite if keys leave the range of float32.
std::optional<Track> fitTrack(const Curve& curve, const Value& rest, double duration, double rate,
                              double tolerance);

}  // namespace dermis
