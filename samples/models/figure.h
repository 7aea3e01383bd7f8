// The parts of the figure. Left is +x, up is +y, front is +z. The parts on the right mirror those
// on the left.
#pragma once

#include <array>
#include <vector>

#include "borders.h"
#include "loft.h"
#include "mesh.h"
#include "skeleton.h"

namespace dermis::models {

// ---- Landmarks of the left half in the rest pose, in meters
inline const Vec3 shoulderPoint(0.178, 1.425, -0.028);
inline const Vec3 hipPoint(0.090, 0.915, -0.004);
inline const Vec3 kneePoint(0.101, 0.490, 0.008);
inline const Vec3 anklePoint(0.107, 0.082, -0.022);
inline constexpr double toeOut = 7.0 * degree;
inline constexpr double ballForward =
    0.118;  // from the ankle to the ball of the foot, along the foot
inline constexpr double ballHeight = 0.024;

// The left arm, 44° from the vertical.
Frame leftArmFrame();
// The left foot. The origin is on the ground under the ankle, `along` points towards the toes, and
// `front` points up.
Frame leftFootFrame();

// ---- Surface
struct FigureShape {
  Shape whole;
  Shape trunk;    // trunk, neck and head only
  Shape leftArm;  // including the hand
};
FigureShape figureShape();
// The surface, with smaller triangles at hands, feet and head.
struct FigureSurface {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;
  std::vector<std::uint32_t> indices;
};
FigureSurface figureSurface(const FigureShape& shape);

// ---- Skeleton
// The joints of the skin, in order.
enum class Bone : std::size_t {
  hips,
  spine,
  chest,
  upperChest,
  neck,
  head,
  leftClavicle,
  leftUpperArm,
  leftForearm,
  leftHand,
  leftFingers,
  leftThumb,
  rightClavicle,
  rightUpperArm,
  rightForearm,
  rightHand,
  rightFingers,
  rightThumb,
  leftThigh,
  leftShin,
  leftFoot,
  leftToes,
  rightThigh,
  rightShin,
  rightFoot,
  rightToes,
  count
};
inline constexpr std::size_t boneCount = static_cast<std::size_t>(Bone::count);
constexpr std::size_t indexOf(Bone bone) {
  return static_cast<std::size_t>(bone);
}
// The same bone on the other side; a bone in the middle is returned unchanged.
Bone mirrored(Bone bone);

Skeleton figureSkeleton();

// ---- Weights and colors of the surface
std::vector<Influences> figureWeights(const FigureShape& shape, const Mesh& mesh);
// The regions of clothes, skin and hair, and their colors. The shape must outlive the returned
// function.
RegionAt figureRegions(const FigureShape& shape);
const std::vector<Vec3>& figureColors();
// Body, hair, shirt, trousers and shoes. Each has its own material, as in typical characters.
std::vector<Part> figureParts();

// ---- Clips
// The walking speed in meters per second: the feet move towards −z at this speed while they are on
// the ground.
double walkingSpeed();
Clip walkClip();
Clip idleClip();
Clip waveClip();

}  // namespace dermis::models
