// The walk: pelvis, trunk and arms about the legs of walk_leg.cpp.
//
// Angles follow published gait curves (Perry, "Gait Analysis", 1992): the pelvis leads the leg that
// steps and drops on the side that swings; the shoulders turn the other way; each arm goes with the
// opposite leg.
#include <cmath>

#include "figure.h"
#include "walk_leg.h"

namespace dermis::models {
namespace {

constexpr int walkIntervals = 44;

const Vec3 xAxis(1.0, 0.0, 0.0);
const Vec3 yAxis(0.0, 1.0, 0.0);
const Vec3 zAxis(0.0, 0.0, 1.0);

double wave(double phase, double peak) {
  return cosine(2.0 * pi * (phase - peak));
}

Vec3 acrossMiddle(const Vec3& point) {
  return {-point.x, point.y, point.z};
}
Quat acrossMiddle(const Quat& turn) {
  return Quat(turn.w, turn.x, -turn.y, -turn.z);
}

struct Posture {
  Pose pose = Pose(boneCount);
  Quat& operator[](Bone bone) { return pose[indexOf(bone)].turn; }
};

void addPelvisAndTrunk(Posture& posture, double phase) {
  const double yaw = -6.0 * degree * wave(phase, 0.0);  // left hip forward at the left heel strike
  const double list =
      3.5 * degree * wave(phase, 0.22);  // right hip down while the left leg carries
  posture[Bone::hips] = turn(yAxis, yaw) * turn(zAxis, list) * turn(xAxis, 2.0 * degree);
  posture.pose[indexOf(Bone::hips)].offset = {0.020 * wave(phase, 0.30),
                                              -0.029 - 0.018 * cosine(4.0 * pi * (phase - 0.025)),
                                              0.006 * cosine(4.0 * pi * (phase - 0.20))};
  // Three joints share the turn from pelvis to shoulders.
  const double shoulderYaw = 4.5 * degree * wave(phase, 0.02);
  const double share = (shoulderYaw - yaw) / 3.0;
  for (const Bone bone : {Bone::spine, Bone::chest, Bone::upperChest}) {
    posture[bone] = turn(yAxis, share) * turn(zAxis, -list * 0.42) * turn(xAxis, 0.5 * degree);
  }
  // The head looks ahead.
  posture[Bone::neck] =
      turn(yAxis, -0.5 * shoulderYaw) * turn(zAxis, 0.13 * list) * turn(xAxis, -1.0 * degree);
  posture[Bone::head] = turn(yAxis, -0.5 * shoulderYaw) * turn(zAxis, 0.13 * list) *
                        turn(xAxis, -1.5 * degree + 0.8 * degree * cosine(4.0 * pi * phase));
}

// The left arm, `swing` from −1 (back) to 1 (forward).
void addArm(Posture& posture, double swing, bool isRight) {
  const auto set = [&](Bone left, const Quat& turnOfLeft) {
    posture[isRight ? mirrored(left) : left] = isRight ? acrossMiddle(turnOfLeft) : turnOfLeft;
  };
  const Frame arm = leftArmFrame();
  const Vec3 elbowHinge = glm::cross(arm.along, arm.front);
  const double forward = 1.0 * degree + 18.0 * degree * swing;
  set(Bone::leftClavicle, turn(yAxis, -3.0 * degree * swing) * turn(zAxis, -3.0 * degree));
  set(Bone::leftUpperArm, turn(xAxis, -forward) * turn(zAxis, -31.0 * degree));
  set(Bone::leftForearm, turn(elbowHinge, (17.0 + 10.0 * swing) * degree));
  set(Bone::leftHand, turn(elbowHinge, 4.0 * swing * degree));
  set(Bone::leftFingers, turn(arm.front, -14.0 * degree));
  set(Bone::leftThumb, turn(arm.front, -6.0 * degree));
}

void addLeg(Posture& posture, double phase, bool isRight) {
  const Skeleton skeleton = figureSkeleton();
  const JointPose& hips = posture.pose[indexOf(Bone::hips)];
  const Vec3 pelvis = skeleton.joints[indexOf(Bone::hips)].position;
  const Vec3 hipRest = isRight ? acrossMiddle(hipPoint) : hipPoint;
  const Vec3 hip = pelvis + hips.offset + hips.turn * (hipRest - pelvis);

  LegTurns turns = reach(isRight ? acrossMiddle(hip) : hip, footAt(phase));
  if (isRight) {
    for (Quat* each : {&turns.thigh, &turns.shin, &turns.foot, &turns.toes})
      *each = acrossMiddle(*each);
  }
  const auto set = [&](Bone left, const Quat& parent, const Quat& self) {
    posture[isRight ? mirrored(left) : left] = glm::conjugate(parent) * self;
  };
  set(Bone::leftThigh, hips.turn, turns.thigh);
  set(Bone::leftShin, turns.thigh, turns.shin);
  set(Bone::leftFoot, turns.shin, turns.foot);
  set(Bone::leftToes, turns.foot, turns.toes);
}

Pose walkAt(double phase) {
  const double rightPhase = phase < 0.5 ? phase + 0.5 : phase - 0.5;
  Posture posture;
  addPelvisAndTrunk(posture, phase);
  addArm(posture, -wave(phase, 0.03), false);
  addArm(posture, wave(phase, 0.03), true);
  addLeg(posture, phase, false);
  addLeg(posture, rightPhase, true);
  return posture.pose;
}

}  // namespace

double walkingSpeed() {
  return strideLength / walkDuration;
}

Clip walkClip() {
  return sampleCycle("walk", walkDuration, walkIntervals, walkAt);
}

}  // namespace dermis::models
