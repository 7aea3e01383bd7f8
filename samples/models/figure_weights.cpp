// Which bone each vertex follows: a sharp choice first, which then spreads along the surface.
#include <cmath>
#include <glm/geometric.hpp>

#include "arm_shape.h"
#include "figure.h"
#include "weights.h"

namespace dermis::models {
namespace {

constexpr int diffusionSteps = 44;

Bone armBone(const Vec3& point) {
  const Frame arm = leftArmFrame();
  const double along = arm.toLocal(point).y;
  if (thumb(arm).field(point) < 0.004) return Bone::leftThumb;
  if (along > knuckleAlong) return Bone::leftFingers;
  if (along > wristAlong) return Bone::leftHand;
  if (along > elbowAlong) return Bone::leftForearm;
  return Bone::leftUpperArm;
}

Bone legBone(const Vec3& point) {
  const Vec3 foot = leftFootFrame().toLocal(point);
  if (foot.z < 0.085 && foot.y > ballForward) return Bone::leftToes;
  if (foot.z < anklePoint.y + 0.35 * foot.y) return Bone::leftFoot;
  return point.y < kneePoint.y ? Bone::leftShin : Bone::leftThigh;
}

Bone trunkBone(const Vec3& point) {
  // The head's lower edge runs from under the chin up to the nape.
  if (point.y > 1.560 - 0.55 * point.z) return Bone::head;
  if (point.y > 1.465 - 0.25 * (point.z + 0.04)) return Bone::neck;
  if (point.y > 1.375 && point.x > 0.085) return Bone::leftClavicle;
  if (point.y > 1.255) return Bone::upperChest;
  if (point.y > 1.140) return Bone::chest;
  return point.y > 1.035 ? Bone::spine : Bone::hips;
}

// The bone of a point of the left half.
Bone leftBone(const Vec3& point, const FigureShape& shape) {
  const double along = leftArmFrame().toLocal(point).y;
  const bool isArm = shape.leftArm.distance(point) < shape.trunk.distance(point) - 0.003;
  if (isArm && along > 0.0) return armBone(point);
  // The crease of the hip: from the crotch outwards and up, lower behind, where the buttock stays
  // with the pelvis.
  const double crease = 0.805 + 0.62 * point.x - (point.z < -0.02 ? 0.25 * (-0.02 - point.z) : 0.0);
  if (point.y < crease) return legBone(point);
  return trunkBone(point);
}

// How fast weights spread from a bone's vertices: wide at trunk, shoulders and hips, narrow at
// small joints.
double spreadOf(Bone bone) {
  switch (bone) {
    case Bone::leftForearm:
    case Bone::leftShin:
      return 0.55;
    case Bone::leftHand:
      return 0.45;
    case Bone::leftFingers:
    case Bone::leftThumb:
    case Bone::leftFoot:
    case Bone::leftToes:
      return 0.35;
    case Bone::neck:
    case Bone::head:
      return 0.8;
    default:
      return 1.0;
  }
}

// A limb's weights fade out across the middle, so that a step of one leg does not pull at the other
// through the crotch.
double allowanceOf(const Vec3& position, std::size_t joint) {
  const Bone bone = static_cast<Bone>(joint);
  if (bone == mirrored(bone)) return 1.0;
  const bool isLeft = (bone >= Bone::leftClavicle && bone < Bone::rightClavicle) ||
                      (bone >= Bone::leftThigh && bone < Bone::rightThigh);
  return smoothStep(-0.045, 0.030, isLeft ? position.x : -position.x);
}

}  // namespace

std::vector<Influences> figureWeights(const FigureShape& shape, const Mesh& mesh) {
  Diffusion diffusion{boneCount, {}, {}, diffusionSteps, allowanceOf};
  for (const Vec3& position : mesh.positions) {
    const bool isLeft = position.x >= 0.0;
    const Bone bone = leftBone({std::abs(position.x), position.y, position.z}, shape);
    diffusion.nearestJoint.push_back(indexOf(isLeft ? bone : mirrored(bone)));
    diffusion.spread.push_back(spreadOf(bone));
  }
  return diffuseWeights(mesh, diffusion);
}

}  // namespace dermis::models
