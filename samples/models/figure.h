// The parts that the figure is made of. Left is +x, front +z, up +y; right-hand parts mirror left
// ones.
#pragma once

#include <array>
#include <vector>

#include "borders.h"
#include "loft.h"
#include "mesh.h"
#include "skeleton.h"

namespace dermis::models {

// ---- Landmarks of the left half in rest, metres
// -------------------------------------------------------------------
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
// The left foot: origin on the ground under the ankle, `along` towards the toes, `front` up.
Frame leftFootFrame();

// ---- Surface
// ------------------------------------------------------------------------------------------------------
struct FigureShape {
  Shape whole;
  Shape trunk;    // trunk, neck and head alone
  Shape leftArm;  // with the hand
};
FigureShape figureShape();
// The surface as quads, finer at hands, feet and head.
struct FigureSurface {
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;
  std::vector<std::uint32_t> indices;
};
FigureSurface figureSurface(const FigureShape& shape);

// ---- Skeleton
// -----------------------------------------------------------------------------------------------------
// The joints, in the order of the skin.
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
// The same bone on the right; bones of the middle stay.
Bone mirrored(Bone bone);

Skeleton figureSkeleton();

// ---- What lies on the surface
// ---------------------------------------------------------------------------------------
std::vector<Influences> figureWeights(const FigureShape& shape, const Mesh& mesh);
// Clothes, skin and hair: where each is, and its color. The shape must outlive the function that
// is returned.
RegionAt figureRegions(const FigureShape& shape);
const std::vector<Vec3>& figureColors();
// Body, hair, shirt, trousers, shoes: as characters come, each with a material of its own.
std::vector<Part> figureParts();

// ---- Clips
// --------------------------------------------------------------------------------------------------------
// Metres a second at which the ground would pass under the walking figure, towards −z.
double walkingSpeed();
Clip walkClip();
Clip idleClip();
Clip waveClip();

}  // namespace dermis::models
