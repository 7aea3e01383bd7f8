// Rigs that tests make, with the memory of their views.
#pragma once

#include <cstdint>
#include <memory>
#include <numbers>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "dermis/rig.h"

namespace dermis::test {

inline constexpr double pi = std::numbers::pi;
inline constexpr std::uint32_t noRigJoint = 0xffffffffu;

struct MadeRig {
  std::vector<RigJoint> joints;
  std::uint32_t writtenJoints = 0, givenWeights = 0, drivenWeights = 0;
  std::vector<TwistDriver> twists;
  std::vector<CorrectiveDriver> correctives;
  std::vector<ChainDriver> chains;
  std::vector<LinearDriver> linears;

  std::uint32_t addJoint(std::uint32_t parent, const glm::dmat4& bind);
  /// Keeps an array as long as this rig or a copy of it.
  template <typename T>
  std::span<const T> keep(std::vector<T> values) {
    auto kept = std::make_shared<std::vector<T>>(std::move(values));
    kept_.push_back(kept);
    return *kept;
  }
  RigView view() const;
  PackedRig pack() const;
  glm::dmat4 bind(std::uint32_t joint) const;

 private:
  std::vector<std::shared_ptr<void>> kept_;
};

JointMatrix jointMatrixOf(const glm::dmat4& matrix);
glm::dvec3 randomDirection(std::mt19937& random);
/// By less than this angle, in radians, about any axis.
glm::dmat4 randomRotation(std::mt19937& random, double angle);
glm::dmat4 rotationAbout(const glm::dvec3& axis, double angle);
/// x, y, z, w.
std::array<float, 4> quaternionAbout(const glm::dvec3& axis, double angle);

/// What random rigs have, and poses of them.
struct RigKind {
  const char* name;
  double unit = 1;      ///< of lengths
  double distance = 0;  ///< from the origin, in units
  bool isScaled =
      false;  ///< joints have scales from 0.5 to 2 along each axis, in bind pose and pose
  bool isMirrored = false;  ///< a third of the joints are mirrored
  double flatness = 1;      ///< joints have this scale along one axis in poses
  double angle = 2.5;       ///< of joints in poses at most, in radians
};

/// A rig of written joints and 1 to 12 drivers of all kinds, in any order, which read what others
/// drive.
MadeRig randomRig(std::mt19937& random, const RigKind& kind);
/// Of the written joints.
std::vector<JointMatrix> randomRigPose(std::mt19937& random, const MadeRig& rig,
                                       const RigKind& kind);

/// What `evaluateRig` writes.
struct DrivenPose {
  std::vector<JointMatrix> joints;
  std::vector<float> weights;
};
DrivenPose evaluated(const PackedRig& rig, std::span<const JointMatrix> written,
                     std::span<const float> givenWeights = {});

}  // namespace dermis::test
