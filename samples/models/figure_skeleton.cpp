#include <array>

#include "arm_shape.h"
#include "figure.h"

namespace dermis::models {
namespace {

constexpr std::size_t armBones = indexOf(Bone::rightClavicle) - indexOf(Bone::leftClavicle);
constexpr std::size_t legBones = indexOf(Bone::rightThigh) - indexOf(Bone::leftThigh);

// A joint, and where it points.
struct Placed {
  const char* name;
  int parent;
  Vec3 position;
  Vec3 target;
};

constexpr int index(Bone bone) {
  return static_cast<int>(indexOf(bone));
}

std::vector<Placed> middleBones() {
  const std::array<Vec3, 7> line = {Vec3(0.0, 0.940, -0.010), Vec3(0.0, 1.040, -0.016),
                                    Vec3(0.0, 1.150, -0.018), Vec3(0.0, 1.270, -0.024),
                                    Vec3(0.0, 1.475, -0.040), Vec3(0.0, 1.565, -0.018),
                                    Vec3(0.0, 1.740, -0.010)};
  const std::array<const char*, 6> names = {"hips", "spine", "chest", "upperChest", "neck", "head"};
  std::vector<Placed> bones;
  for (std::size_t bone = 0; bone < names.size(); ++bone) {
    bones.push_back({names[bone], static_cast<int>(bone) - 1, line[bone], line[bone + 1]});
  }
  return bones;
}

std::vector<Placed> leftArmBones() {
  const Frame arm = leftArmFrame();
  const Vec3 clavicle(0.022, 1.425, 0.020);
  const Vec3 elbow = armCenter(arm, elbowAlong);
  const Vec3 wrist = armCenter(arm, wristAlong);
  const Vec3 knuckles = armCenter(arm, knuckleAlong);
  const Vec3 tips = arm.toModel({-0.018, 0.72, 0.05});
  return {{"Clavicle", index(Bone::upperChest), clavicle, shoulderPoint},
          {"UpperArm", index(Bone::leftClavicle), shoulderPoint, elbow},
          {"Forearm", index(Bone::leftUpperArm), elbow, wrist},
          {"Hand", index(Bone::leftForearm), wrist, knuckles},
          {"Fingers", index(Bone::leftHand), knuckles, tips},
          {"Thumb", index(Bone::leftHand), thumbBase(arm), thumbTip(arm)}};
}

std::vector<Placed> leftLegBones() {
  const Frame foot = leftFootFrame();
  const Vec3 ball = foot.toModel({0.0, ballForward, ballHeight});
  return {{"Thigh", index(Bone::hips), hipPoint, kneePoint},
          {"Shin", index(Bone::leftThigh), kneePoint, anklePoint},
          {"Foot", index(Bone::leftShin), anklePoint, ball},
          {"Toes", index(Bone::leftFoot), ball, ball + foot.along}};
}

Vec3 acrossMiddle(const Vec3& point) {
  return {-point.x, point.y, point.z};
}

void addSides(Skeleton& skeleton, const std::vector<Placed>& left) {
  for (const bool isRight : {false, true}) {
    for (const Placed& bone : left) {
      const Vec3 position = isRight ? acrossMiddle(bone.position) : bone.position;
      const Vec3 target = isRight ? acrossMiddle(bone.target) : bone.target;
      const int parent = isRight ? index(mirrored(static_cast<Bone>(bone.parent))) : bone.parent;
      skeleton.add((isRight ? "right" : "left") + std::string(bone.name), parent, position,
                   target - position);
    }
  }
}

}  // namespace

Bone mirrored(Bone bone) {
  const std::size_t at = indexOf(bone);
  if (at >= indexOf(Bone::rightThigh)) return static_cast<Bone>(at - legBones);
  if (at >= indexOf(Bone::leftThigh)) return static_cast<Bone>(at + legBones);
  if (at >= indexOf(Bone::rightClavicle)) return static_cast<Bone>(at - armBones);
  if (at >= indexOf(Bone::leftClavicle)) return static_cast<Bone>(at + armBones);
  return bone;
}

Skeleton figureSkeleton() {
  Skeleton skeleton;
  for (const Placed& bone : middleBones()) {
    skeleton.add(bone.name, bone.parent, bone.position, bone.target - bone.position);
  }
  addSides(skeleton, leftArmBones());
  addSides(skeleton, leftLegBones());
  return skeleton;
}

}  // namespace dermis::models
