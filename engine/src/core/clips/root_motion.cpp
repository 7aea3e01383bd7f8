#include "clips/root_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "clips/bank.h"
#include "clips/sample.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

/// The axes of the ground.
std::array<std::size_t, 2> groundAxes(std::uint32_t upAxis) {
  return {(upAxis + 1) % 3, (upAxis + 2) % 3};
}

Value interpolatedRotation(const Value& from, const Value& to, double fraction) {
  const double direction = dot(from, to) < 0 ? -1 : 1;
  const double angle = distance(from, to, true) / 2;  // of the quaternions
  double share = 1 - fraction, other = fraction;
  if (angle > 1e-8) {
    share = std::sin(share * angle) / std::sin(angle);
    other = std::sin(other * angle) / std::sin(angle);
  }
  Value value;
  for (std::size_t i = 0; i < 4; ++i) value[i] = share * from[i] + direction * other * to[i];
  return normalized(value);
}

Value interpolatedPlace(const Value& from, const Value& to, double fraction) {
  Value value;
  for (std::size_t i = 0; i < 4; ++i) value[i] = (1 - fraction) * from[i] + fraction * to[i];
  return value;
}

struct KeysOut {
  std::uint64_t& left;  ///< how many more there may be
  std::vector<float> times;
  std::vector<Value> values;
  double error = 0;  ///< the largest found of straight lines between keys

  void add(float time, const Value& value) {
    if (left == 0 || (!times.empty() && times.back() == time && values.back() == value)) return;
    --left;
    times.push_back(time);
    values.push_back(value);
  }
};

/// Samples what remains of a node, and its motion.
class Splitter {
 public:
  Splitter(const MotionFrame& frame, const Curve& place, const Curve& rotation, double length)
      : frame_(frame), place_(place), rotation_(rotation), length_(length) {
    start_ = rotation_.at(0);
  }

  /// A heading is known up to whole turns: of all, that which is nearest to `near`.
  double headingAt(double time, Side side, double near) const {
    const Value now = rotation_.at(time, side);
    const Value turned = product(now, {-start_[0], -start_[1], -start_[2], start_[3]});
    const Value& up = frame_.localUp;
    const double heading =
        2 * std::atan2(turned[0] * up[0] + turned[1] * up[1] + turned[2] * up[2], turned[3]);
    constexpr double whole = 2 * std::numbers::pi;
    return heading + whole * std::round((near - heading) / whole);
  }
  Value motionAt(double time, Side side, double near) const {
    const Value at = place_.at(time, side);
    const auto axes = groundAxes(frame_.upAxis);
    Value value{};
    for (std::size_t i = 0; i < 2; ++i) {
      const auto& row = frame_.above[axes[i]];
      value[i] = row[0] * at[0] + row[1] * at[1] + row[2] * at[2] + row[3];
    }
    value[2] = length_ * headingAt(time, side, near);
    return value;
  }
  Value turnAt(double time, Side side) const {
    const double half = headingAt(time, side, 0) / -2, sine = std::sin(half);
    const Value& up = frame_.localUp;
    return product({sine * up[0], sine * up[1], sine * up[2], std::cos(half)},
                   rotation_.at(time, side));
  }

 private:
  const MotionFrame& frame_;
  const Curve& place_;
  const Curve& rotation_;
  double length_;
  Value start_{};
};

/// Adds the keys after `from` up to `to`, so many that straight lines between them are near enough:
/// by `error`, or by what float32 cannot keep by far. `at` gets a time between both.
template <typename At, typename Between>
void addKeysBetween(float from, const Value& start, float to, const Value& end, bool isRotation,
                    double error, const At& at, const Between& between, KeysOut& out,
                    int depth = 0) {
  if (out.left == 0) return;
  const double gap = double{to} - double{from};
  const auto middle = static_cast<float>(double{from} + gap / 2);
  double worst = 0;
  for (const double fraction : {0.25, 0.5, 0.75}) {
    worst = std::max(worst, distance(between(start, end, fraction),
                                     at(double{from} + fraction * gap), isRotation));
  }
  const double size = isRotation ? 1 : std::sqrt(std::max(dot(start, start), dot(end, end)));
  constexpr int deepest = 8;
  if (worst <= std::max(error, 0x1p-30 * size) || depth == deepest ||
      !(middle > from && middle < to)) {
    out.error = std::max(out.error, worst);
    out.add(to, end);
    return;
  }
  const Value inside = at(double{middle});
  addKeysBetween(from, start, middle, inside, isRotation, error, at, between, out, depth + 1);
  addKeysBetween(middle, inside, to, end, isRotation, error, at, between, out, depth + 1);
}

/// 0, the end, and what is between.
std::vector<float> splitTimes(const ChannelView* translation, const ChannelView* rotation,
                              double duration) {
  const auto end = static_cast<float>(duration);
  std::vector<float> keys{0, end}, times;
  for (const ChannelView* const channel : {translation, rotation}) {
    if (channel == nullptr) continue;
    for (const float time : channel->times) {
      if (time > 0 && time < end) keys.push_back(time);
    }
  }
  std::ranges::sort(keys);
  constexpr int parts = 8;  // so that a heading does not turn far in one
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
    for (int part = 0; part < parts; ++part)
      times.push_back(keys[i] + (keys[i + 1] - keys[i]) * (static_cast<float>(part) / parts));
  }
  times.push_back(end);
  std::ranges::sort(times);
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

ChannelView channelWith(const KeysOut& keys, ChannelPath path,
                        std::deque<std::vector<float>>& storage) {
  ChannelView channel;
  channel.path = path;
  std::vector<float>& values = storage.emplace_back();
  for (const Value& value : keys.values) {
    for (std::size_t i = 0; i < (path == ChannelPath::rotation ? 4u : 3u); ++i)
      values.push_back(static_cast<float>(value[i]));
  }
  channel.times = storage.emplace_back(keys.times);
  channel.values = values;
  return channel;
}

/// The motion of a clip from its beginning to a time inside of it.
GroundMotion motionInClip(const ClipBank& bank, const BankClip& clip, const BankMotion& motion,
                          double time) {
  const std::size_t track = std::size_t{3} * bank.header.nodeCount + bank.header.groupCount;
  const auto at = [&](float seconds) {
    const std::array<float, 4> value = sampleVector(bank, clip, track, seconds);
    return Value{double{value[0]}, double{value[1]}, double{value[2]}, 0};
  };
  return motionBetween(at(0), at(static_cast<float>(time)), double{motion.length});
}

/// `count` times the same motion.
GroundMotion repeated(GroundMotion motion, double count) {
  if (count < 0) {
    motion = reversed(motion);
    count = -count;
  }
  GroundMotion result;
  for (; count >= 1; count = std::floor(count / 2), motion = chained(motion, motion)) {
    if (std::fmod(count, 2) == 1) result = chained(result, motion);
  }
  return result;
}

struct LoopTime {
  double loop, time;
};

LoopTime loopTimeOf(const ClipInfo& info, double seconds, bool hold) {
  const double duration = double{info.duration};
  if (!info.wraps || hold || !(duration > 0)) return {0, std::clamp(seconds, 0.0, duration)};
  const double loop = std::floor(seconds / duration);
  return {loop, std::clamp(std::fma(-loop, duration, seconds), 0.0, duration)};
}

}  // namespace

GroundMotion chained(const GroundMotion& a, const GroundMotion& b) {
  const double cosine = std::cos(a.turn), sine = std::sin(a.turn);
  return {a.first + cosine * b.first - sine * b.second,
          a.second + sine * b.first + cosine * b.second, a.turn + b.turn};
}

GroundMotion reversed(const GroundMotion& motion) {
  const GroundMotion back = chained({0, 0, -motion.turn}, {motion.first, motion.second, 0});
  return {-back.first, -back.second, -motion.turn};
}

GroundMotion motionBetween(const Value& start, const Value& now, double length) {
  const double turn = (now[2] - start[2]) / length;
  const GroundMotion turned = chained({0, 0, turn}, {start[0], start[1], 0});
  return {now[0] - turned.first, now[1] - turned.second, turn};
}

Transform motionMatrix(const GroundMotion& motion, std::uint32_t upAxis) {
  const auto [first, second] = groundAxes(upAxis);
  const double cosine = std::cos(motion.turn), sine = std::sin(motion.turn);
  Transform matrix{};
  matrix[upAxis][upAxis] = 1;
  matrix[first][first] = matrix[second][second] = cosine;
  matrix[first][second] = -sine;
  matrix[second][first] = sine;
  matrix[first][3] = motion.first;
  matrix[second][3] = motion.second;
  return matrix;
}

std::optional<MotionFrame> MotionFrame::of(const Transform& above, std::uint32_t upAxis) {
  const auto column = [&](std::size_t i) {
    return Value{above[0][i], above[1][i], above[2][i], 0};
  };
  const Value x = column(0), y = column(1), z = column(2);
  const double square = dot(x, x),
               determinant = dot({x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2],
                                  x[0] * y[1] - x[1] * y[0], 0},
                                 z);
  if (!(square > 0) || !(determinant > 0)) return std::nullopt;
  constexpr double tolerance = 1e-5;
  for (const double off : {dot(y, y) - square, dot(z, z) - square, dot(x, y), dot(y, z), dot(z, x)})
    if (!(std::abs(off) <= tolerance * square)) return std::nullopt;
  // The inverse of a rotation is its transpose.
  const auto& row = above[upAxis];
  return MotionFrame{above, upAxis, normalized({row[0], row[1], row[2], 0})};
}

std::optional<SplitMotion> splitMotion(const MotionFrame& frame, const ChannelView* translation,
                                       const ChannelView* rotation, const Value& restTranslation,
                                       const Value& restRotation, double duration, double length,
                                       double motionError, double turnError,
                                       std::uint64_t mostBytes) {
  SplitMotion split;
  const Curve place(translation, ChannelPath::translation, restTranslation, {});
  const Curve turn(rotation, ChannelPath::rotation, restRotation, {});
  const Splitter splitter(frame, place, turn, length);
  const std::vector<float> times = splitTimes(translation, rotation, duration);

  constexpr std::uint64_t keyBytes = 64;  // about: in double precision, and in float32
  const std::uint64_t keyLimit = mostBytes / keyBytes;
  std::uint64_t keysLeft = keyLimit;
  KeysOut motions{keysLeft, {}, {}}, turns{keysLeft, {}, {}};
  if (keysLeft < 2) return std::nullopt;
  motions.add(0, splitter.motionAt(0, Side::after, 0));
  turns.add(0, splitter.turnAt(0, Side::after));
  for (std::size_t i = 0; i + 1 < times.size(); ++i) {
    const double to = double{times[i + 1]};
    double near = motions.values.back()[2] / length;
    const Value motion = motions.values.back(), end = splitter.motionAt(to, Side::before, near);
    addKeysBetween(
        times[i], motion, times[i + 1], end, false, motionError,
        [&](double time) { return splitter.motionAt(time, Side::after, near); }, interpolatedPlace,
        motions);
    addKeysBetween(
        times[i], turns.values.back(), times[i + 1], splitter.turnAt(to, Side::before), true,
        turnError, [&](double time) { return splitter.turnAt(time, Side::after); },
        interpolatedRotation, turns);
    // The value from then on, if it jumps.
    near = end[2] / length;
    motions.add(times[i + 1], splitter.motionAt(to, Side::after, near));
    turns.add(times[i + 1], splitter.turnAt(to, Side::after));
    if (keysLeft == 0) return std::nullopt;
  }
  split.bytes = (keyLimit - keysLeft) * keyBytes;
  split.motion = channelWith(motions, ChannelPath::translation, split.keys);
  split.motionError = 2 * motions.error;
  split.turnError = 2 * turns.error;
  if (rotation != nullptr) split.turn = channelWith(turns, ChannelPath::rotation, split.keys);
  if (translation == nullptr) return split;

  // What remains moves along the up axis: a straight line, so keys and tangents are projected.
  const Value start = place.at(0);
  std::vector<float>& values = split.keys.emplace_back();
  const bool isSpline = translation->interpolation == Interpolation::cubicSpline;
  for (std::size_t i = 0; i < translation->values.size(); i += 3) {
    const bool isTangent = isSpline && i / 3 % 3 != 1;
    double along = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      along += frame.localUp[axis] *
               (double{translation->values[i + axis]} - (isTangent ? 0 : start[axis]));
    }
    for (std::size_t axis = 0; axis < 3; ++axis)
      values.push_back(
          static_cast<float>((isTangent ? 0 : start[axis]) + along * frame.localUp[axis]));
  }
  split.place = *translation;
  split.place->values = values;
  return split;
}

Result<RootMotion> rootMotion(const PackedClips& clips, std::uint32_t number, double fromSeconds,
                              double toSeconds, bool hold) {
  const auto refused = [](const std::string& what) {
    return Error{ErrorCode::invalidArgument, "rootMotion: " + what};
  };
  const ClipBank bank(clips);
  if (number >= bank.header.clipCount) {
    return refused("there is no clip " + std::to_string(number) + "; the bank has " +
                   std::to_string(bank.header.clipCount));
  }
  if (!std::isfinite(fromSeconds) || !std::isfinite(toSeconds))
    return refused("a time is not finite");
  const ClipInfo info = clips.clip(number);
  const LoopTime from = loopTimeOf(info, fromSeconds, hold);
  const LoopTime to = loopTimeOf(info, toSeconds, hold);
  if (!(std::abs(from.loop) < 0x1p52 && std::abs(to.loop) < 0x1p52))
    return refused("a time is 2^52 loops away");
  RootMotion result;
  if (bank.header.motion == 0) return result;
  const BankClip clip = bank.clip(number);
  const auto motion = bank.at<BankMotion>(bank.header.motion);
  const auto inClip = [&](double time) { return motionInClip(bank, clip, motion, time); };
  // Both times are in their loops: the motion to the end of a loop is repeated.
  const GroundMotion between = chained(
      reversed(inClip(from.time)),
      chained(repeated(inClip(double{info.duration}), to.loop - from.loop), inClip(to.time)));
  const auto axes = groundAxes(motion.upAxis);
  result.displacement[axes[0]] = between.first;
  result.displacement[axes[1]] = between.second;
  result.turn = between.turn;
  return result;
}

}  // namespace dermis
