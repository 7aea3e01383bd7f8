#include "walk_leg.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

namespace dermis::models {
namespace {

// The foot is on the ground from phase 0 to here. Meanwhile what touches the ground moves back at
// walking speed: first the heel, on which the foot rolls down; then the whole sole; then the ball,
// over which the heel rises.
constexpr double liftOff = 0.60;
constexpr double strikeForward = 0.312;  // of the ankle, were the foot flat, before the hips
constexpr double ankleSide = 0.082;

struct Key {
  double phase;
  double value;
};

// Cubic Hermite curve through keys, with the slope between neighbors; keys lie on both sides of
// the phase.
double curve(const std::vector<Key>& keys, double phase) {
  std::size_t index = 1;
  while (keys[index + 1].phase < phase) ++index;
  const Key& from = keys[index];
  const Key& to = keys[index + 1];
  const auto slope = [&](std::size_t key) {
    return (keys[key + 1].value - keys[key - 1].value) /
           (keys[key + 1].phase - keys[key - 1].phase);
  };
  const double span = to.phase - from.phase;
  const double t = (phase - from.phase) / span;
  const double t2 = t * t;
  const double t3 = t2 * t;
  return (2.0 * t3 - 3.0 * t2 + 1.0) * from.value + (3.0 * t2 - 2.0 * t3) * to.value +
         (t3 - 2.0 * t2 + t) * span * slope(index) + (t3 - t2) * span * slope(index + 1);
}

double pitchAt(double phase) {
  static const std::vector<Key> degrees = {
      {-0.06, 14.0}, {0.00, 17.0},  {0.05, 7.0},   {0.095, 0.0},  {0.14, 0.0},
      {0.20, 0.0},   {0.26, 0.0},   {0.32, -0.8},  {0.40, -5.0},  {0.47, -14.0},
      {0.54, -33.0}, {0.60, -57.0}, {0.66, -66.0}, {0.73, -48.0}, {0.80, -20.0},
      {0.87, 2.0},   {0.94, 14.0},  {1.00, 17.0},  {1.05, 7.0}};
  const double value = curve(degrees, phase);
  // Between the rockers the sole is flat: no swing of the curve may lift it.
  return (phase > 0.095 && phase < 0.26 ? 0.0 : value) * degree;
}

// How far the toes are bent up against the foot once they have left the ground.
double toeBendAt(double phase) {
  static const std::vector<Key> degrees = {{0.54, 33.0}, {0.60, 57.0}, {0.66, 46.0},
                                           {0.73, 26.0}, {0.80, 12.0}, {0.87, 6.0},
                                           {0.94, 2.0},  {1.00, 0.0},  {1.06, 0.0}};
  return curve(degrees, phase) * degree;
}

// Turns (along, up) of the foot by a pitch.
Vec3 pitched(double along, double up, double pitch) {
  const Frame foot = leftFootFrame();
  const double c = cosine(pitch);
  const double s = sine(pitch);
  return foot.along * (along * c - up * s) + Vec3(0.0, along * s + up * c, 0.0);
}

Vec3 stanceAnkle(double phase) {
  constexpr double heelAlong = -0.052;
  constexpr double heelRadius = 0.028;
  const Vec3 flat(ankleSide, anklePoint.y, strikeForward - strideLength * phase);
  const double pitch = pitchAt(phase);
  if (pitch >= 0.0) {
    // The heel is round and rolls without slipping.
    const double up = heelRadius - anklePoint.y;
    return flat + pitched(heelAlong - heelRadius * pitch, up, 0.0) - pitched(heelAlong, up, pitch);
  }
  // The flesh under the ball bulges where the toes bend; this much keeps it off the ground.
  const double bulge = -0.0045 * pitch;
  const double up = ballHeight - anklePoint.y;
  return flat + pitched(ballForward, up + bulge, 0.0) - pitched(ballForward, up, pitch);
}

// The path through the air joins the path on the ground with its speed, because neighbors on the
// ground are keys too.
Vec3 swingAnkle(double phase) {
  static const std::vector<std::array<double, 3>> inAir = {
      // phase, height, forward
      {0.66, 0.206, -0.245}, {0.72, 0.203, -0.115}, {0.78, 0.168, 0.030},
      {0.84, 0.128, 0.165},  {0.90, 0.107, 0.264},  {0.95, 0.102, 0.308}};
  static const std::array<std::vector<Key>, 3> keys = [] {
    std::array<std::vector<Key>, 3> lists;
    const auto addStance = [&](double at, double stancePhase) {
      const Vec3 ankle = stanceAnkle(stancePhase);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        lists[axis].push_back({at, ankle[static_cast<int>(axis)]});
      }
    };
    addStance(liftOff - 0.03, liftOff - 0.03);
    addStance(liftOff, liftOff);
    for (const auto& [at, height, forward] : inAir) {
      lists[0].push_back({at, ankleSide + 0.008});
      lists[1].push_back({at, height});
      lists[2].push_back({at, forward});
    }
    addStance(1.0, 0.0);
    addStance(1.03, 0.03);
    return lists;
  }();
  return {curve(keys[0], phase), curve(keys[1], phase), curve(keys[2], phase)};
}

// Where the knee goes, seen from the hip: forward and a little out.
Vec3 kneeDirection() {
  return unit({sine(3.0 * degree), 0.0, cosine(3.0 * degree)});
}

// The turn that takes one pair of directions to another; the second of each pair is made square to
// the first.
Quat turnOfPair(const Vec3& from, const Vec3& fromSecond, const Vec3& to, const Vec3& toSecond) {
  const Quat first = turnBetween(unit(from), unit(to));
  const Vec3 moved = first * unit(perpendicular(fromSecond, unit(from)));
  return turnBetween(moved, unit(perpendicular(toSecond, unit(to)))) * first;
}

double lengthOf(const Vec3& vector) {
  return std::sqrt(glm::dot(vector, vector));
}

}  // namespace

FootPose footAt(double phase) {
  const bool isOnGround = phase < liftOff;
  const double pitch = pitchAt(phase);
  // On the ground the toes stay flat while the heel rises.
  const double toePitch = isOnGround ? std::max(pitch, 0.0) : pitch + toeBendAt(phase);
  return {isOnGround ? stanceAnkle(phase) : swingAnkle(phase), pitch, toePitch};
}

LegTurns reach(const Vec3& hip, const FootPose& foot) {
  const Vec3 thighRest = kneePoint - hipPoint;
  const Vec3 shinRest = anklePoint - kneePoint;
  const double thighLength = lengthOf(thighRest);
  const double shinLength = lengthOf(shinRest);
  const Vec3 whole = foot.ankle - hip;
  const double distance = std::min(lengthOf(whole), (thighLength + shinLength) * 0.9999);
  const Vec3 direction = unit(whole);

  // Law of cosines, then Pythagoras: the knee is `ahead` of the line from hip to ankle.
  const double down = (thighLength * thighLength - shinLength * shinLength + distance * distance) /
                      (2.0 * distance);
  const double ahead = std::sqrt(std::max(thighLength * thighLength - down * down, 0.0));
  const Vec3 forward = unit(perpendicular(kneeDirection(), direction));
  const Vec3 thigh = direction * down + forward * ahead;
  const Vec3 shin = direction * distance - thigh;

  const Vec3 hinge = glm::cross(direction, forward);
  const Vec3 restHinge = glm::cross(unit(anklePoint - hipPoint), kneeDirection());
  const Frame frame = leftFootFrame();
  return {turnOfPair(thighRest, restHinge, thigh, hinge),
          turnOfPair(shinRest, restHinge, shin, hinge), turn(frame.side, -foot.pitch),
          turn(frame.side, -foot.toePitch)};
}

double overreach(const Vec3& hip, const FootPose& foot) {
  return lengthOf(foot.ankle - hip) - lengthOf(kneePoint - hipPoint) -
         lengthOf(anklePoint - kneePoint);
}

}  // namespace dermis::models
