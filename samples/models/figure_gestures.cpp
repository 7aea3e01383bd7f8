// Clips on the spot: breathing, and a wave of the right hand.
#include <cmath>
#include <glm/geometric.hpp>

#include "figure.h"

namespace dermis::models {
namespace {

constexpr double idleDuration = 4.0;
constexpr int idleIntervals = 24;
constexpr double waveDuration = 3.0;
constexpr int waveIntervals = 45;

const Vec3 xAxis(1.0, 0.0, 0.0);
const Vec3 yAxis(0.0, 1.0, 0.0);
const Vec3 zAxis(0.0, 0.0, 1.0);

Quat acrossMiddle(const Quat& turn) {
  return Quat(turn.w, turn.x, -turn.y, -turn.z);
}

Quat& turnOf(Pose& pose, Bone bone) {
  return pose[indexOf(bone)].turn;
}

// A left arm that hangs; `lift` raises the shoulder a little.
void hangArm(Pose& pose, bool isRight, double lift) {
  const Frame arm = leftArmFrame();
  const Vec3 hinge = glm::cross(arm.along, arm.front);
  const auto set = [&](Bone left, const Quat& turnOfLeft) {
    turnOf(pose, isRight ? mirrored(left) : left) = isRight ? acrossMiddle(turnOfLeft) : turnOfLeft;
  };
  set(Bone::leftClavicle, turn(zAxis, (-3.0 + 2.0 * lift) * degree));
  set(Bone::leftUpperArm, turn(zAxis, (-31.0 - 1.5 * lift) * degree));
  set(Bone::leftForearm, turn(hinge, 14.0 * degree));
  set(Bone::leftFingers, turn(arm.front, -12.0 * degree));
}

// 0 breathed out, 1 breathed in.
void breathe(Pose& pose, double breath) {
  turnOf(pose, Bone::spine) = turn(xAxis, 0.6 * breath * degree);
  turnOf(pose, Bone::chest) = turn(xAxis, -1.2 * breath * degree);
  turnOf(pose, Bone::upperChest) = turn(xAxis, -1.8 * breath * degree);
  turnOf(pose, Bone::neck) = turn(xAxis, 1.2 * breath * degree);
  turnOf(pose, Bone::head) = turn(xAxis, 1.0 * breath * degree);
}

Pose idleAt(double phase) {
  Pose pose(boneCount);
  const double breath = 0.5 * (1.0 - cosine(2.0 * pi * phase));
  breathe(pose, breath);
  hangArm(pose, false, breath);
  hangArm(pose, true, breath);
  return pose;
}

Pose waveAt(double phase) {
  Pose pose = idleAt(phase);
  // Up, four swings, down.
  const double raise = smoothStep(0.0, 0.25, phase) * (1.0 - smoothStep(0.75, 1.0, phase));
  const double swing = raise * sine(2.0 * pi * 4.0 * (phase - 0.25));
  const Frame arm = leftArmFrame();
  const Vec3 hinge = glm::cross(arm.along, arm.front);
  const auto mix = [&](Bone left, const Quat& raised) {
    Quat& current = turnOf(pose, mirrored(left));
    const Quat mixed = current * (1.0 - raise) + acrossMiddle(raised) * raise;
    current = mixed / std::sqrt(glm::dot(mixed, mixed));
  };
  mix(Bone::leftClavicle, turn(zAxis, 12.0 * degree));
  // The upper arm out to the side; turned about itself so that the elbow bends upwards.
  mix(Bone::leftUpperArm,
      turn(zAxis, 32.0 * degree) * turn(yAxis, -10.0 * degree) * turn(arm.along, -80.0 * degree));
  mix(Bone::leftForearm, turn(hinge, (84.0 + 20.0 * swing) * degree));
  mix(Bone::leftHand, turn(hinge, 8.0 * swing * degree));
  mix(Bone::leftFingers, turn(arm.front, 4.0 * degree));
  turnOf(pose, Bone::head) = turnOf(pose, Bone::head) * turn(yAxis, -8.0 * raise * degree) *
                             turn(zAxis, 3.0 * raise * degree);
  return pose;
}

}  // namespace

Clip idleClip() {
  return sampleCycle("idle", idleDuration, idleIntervals, idleAt);
}

Clip waveClip() {
  return sampleCycle("wave", waveDuration, waveIntervals, waveAt);
}

}  // namespace dermis::models
