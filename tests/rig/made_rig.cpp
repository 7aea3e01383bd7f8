#include "made_rig.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/matrix.hpp>

#include "matrix_of.h"
#include "random_number.h"

namespace dermis::test {

std::uint32_t MadeRig::addJoint(std::uint32_t parent, const glm::dmat4& bind) {
  joints.push_back({parent, jointMatrixOf(bind)});
  return static_cast<std::uint32_t>(joints.size() - 1);
}

RigView MadeRig::view() const {
  RigView view;
  view.joints = joints;
  view.writtenJoints = writtenJoints;
  view.givenWeights = givenWeights;
  view.drivenWeights = drivenWeights;
  view.twists = twists;
  view.correctives = correctives;
  view.chains = chains;
  view.linears = linears;
  return view;
}

PackedRig MadeRig::pack() const {
  Result<PackedRig> packed = packRig(view());
  EXPECT_TRUE(packed.ok()) << (packed ? "" : packed.error().message);
  return std::move(*packed);
}

glm::dmat4 MadeRig::bind(std::uint32_t joint) const {
  return matrixOf(joints[joint].bind.m);
}

JointMatrix jointMatrixOf(const glm::dmat4& matrix) {
  JointMatrix joint;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      joint.m[row][column] = static_cast<float>(matrix[column][row]);
  return joint;
}

glm::dvec3 randomDirection(std::mt19937& random) {
  for (;;) {
    const glm::dvec3 v(between(random, -1, 1), between(random, -1, 1), between(random, -1, 1));
    const double length = glm::length(v);
    if (length > 0.1 && length < 1) return v / length;
  }
}

glm::dmat4 rotationAbout(const glm::dvec3& axis, double angle) {
  return glm::rotate(glm::dmat4(1), angle, axis);
}

glm::dmat4 randomRotation(std::mt19937& random, double angle) {
  const glm::dvec3 axis = randomDirection(random);
  return rotationAbout(axis, between(random, -angle, angle));
}

std::array<float, 4> quaternionAbout(const glm::dvec3& axis, double angle) {
  const glm::dvec3 v = glm::normalize(axis) * std::sin(angle / 2);
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z),
          static_cast<float>(std::cos(angle / 2))};
}

namespace {

glm::dmat4 randomScale(std::mt19937& random) {
  return glm::scale(glm::dmat4(1),
                    {between(random, 0.5, 2), between(random, 0.5, 2), between(random, 0.5, 2)});
}

/// Makes one driver after another.
class RigMaker {
 public:
  RigMaker(std::mt19937& random, const RigKind& kind) : random_(random), kind_(kind) {}

  MadeRig make() {
    const std::uint32_t written = 3 + below(random_, 6);
    for (std::uint32_t joint = 0; joint < written; ++joint) addJoint();
    rig_.writtenJoints = written;
    rig_.givenWeights = below(random_, 4);
    const std::uint32_t drivers = 1 + below(random_, 12);
    for (std::uint32_t i = 0; i < drivers; ++i) {
      const std::uint32_t which = below(random_, 4);
      if (which == 0) addTwist();
      if (which == 1) addCorrective();
      if (which == 2) addChain();
      if (which == 3) addLinear();
    }
    std::shuffle(rig_.twists.begin(), rig_.twists.end(), random_);
    std::shuffle(rig_.chains.begin(), rig_.chains.end(), random_);
    std::shuffle(rig_.linears.begin(), rig_.linears.end(), random_);
    std::shuffle(rig_.correctives.begin(), rig_.correctives.end(), random_);
    return rig_;
  }

 private:
  std::uint32_t anyJoint() { return below(random_, rig_.joints.size()); }
  glm::dvec3 anyVector(double size) {
    return randomDirection(random_) * between(random_, 0.2, 1) * size * kind_.unit;
  }

  std::uint32_t addJoint() {
    const bool hasParent = !rig_.joints.empty() && !chance(random_, 15);
    const std::uint32_t parent = hasParent ? anyJoint() : noRigJoint;
    const glm::dvec3 place = anyVector(1) + (hasParent ? glm::dvec3(0) : anyVector(kind_.distance));
    glm::dmat4 local = glm::translate(glm::dmat4(1), place) * randomRotation(random_, pi);
    if (kind_.isScaled) local = local * randomScale(random_);
    if (kind_.isMirrored && chance(random_, 33))
      local = glm::scale(
          local, glm::dvec3(chance(random_, 50) ? glm::dvec3(-1, 1, 1) : glm::dvec3(1, 1, -1)));
    // Relative to where its parent is, so that scales do not pile up.
    glm::dmat4 above(1);
    if (hasParent) {
      above = rotationOf(rig_.bind(parent));
      above[3] = rig_.bind(parent)[3];
    }
    return rig_.addJoint(parent, above * local);
  }
  /// Orthonormal, but with the handedness.
  static glm::dmat4 rotationOf(const glm::dmat4& m) {
    const glm::dvec3 x = glm::normalize(glm::dvec3(m[0]));
    const glm::dvec3 y = glm::normalize(glm::dvec3(m[1]) - glm::dot(x, glm::dvec3(m[1])) * x);
    const glm::dvec3 z =
        glm::cross(x, y) * (glm::dot(glm::cross(x, y), glm::dvec3(m[2])) < 0 ? -1.0 : 1.0);
    return {glm::dvec4(x, 0), glm::dvec4(y, 0), glm::dvec4(z, 0), {0, 0, 0, 1}};
  }

  void addTwist() {
    TwistDriver twist;
    twist.source = anyJoint();
    const glm::dvec3 axis = randomDirection(random_) * between(random_, 0.1, 10);
    twist.axis = {static_cast<float>(axis.x), static_cast<float>(axis.y),
                  static_cast<float>(axis.z)};
    twist.share = static_cast<float>(between(random_, -1, 1));
    twist.joint = addJoint();
    rig_.twists.push_back(twist);
  }

  void addCorrective() {
    CorrectiveDriver corrective;
    std::vector<std::uint32_t> inputs{anyJoint()};
    if (chance(random_, 40)) inputs.push_back(anyJoint());
    corrective.inputs = rig_.keep(inputs);
    corrective.radius = chance(random_, 40) ? 0 : static_cast<float>(between(random_, 0.3, 1.2));
    const std::uint32_t examples = 1 + below(random_, 8);
    std::vector<std::array<float, 4>> rotations;
    for (std::size_t i = 0; i < examples * inputs.size(); ++i) {
      rotations.push_back(quaternionAbout(randomDirection(random_), between(random_, -pi, pi)));
      for (float& number : rotations.back()) number *= 3;
    }
    corrective.examples = rig_.keep(rotations);
    corrective.firstWeight = rig_.givenWeights + rig_.drivenWeights;
    corrective.weightCount = below(random_, 7);
    rig_.drivenWeights += corrective.weightCount;
    std::vector<float> weights;
    for (std::size_t i = 0; i < examples * std::size_t{corrective.weightCount}; ++i)
      weights.push_back(static_cast<float>(between(random_, -1, 2)));
    corrective.weights = rig_.keep(weights);
    std::vector<std::uint32_t> driven;
    const std::uint32_t count = below(random_, 3) + (corrective.weightCount == 0 ? 1 : 0);
    for (std::uint32_t i = 0; i < count; ++i) driven.push_back(addJoint());
    corrective.joints = rig_.keep(driven);
    std::vector<JointOffset> offsets;
    for (std::size_t i = 0; i < examples * driven.size(); ++i) {
      JointOffset& offset = offsets.emplace_back();
      const glm::dvec3 shift = anyVector(0.3);
      offset.translation = {static_cast<float>(shift.x), static_cast<float>(shift.y),
                            static_cast<float>(shift.z)};
      offset.rotation = quaternionAbout(randomDirection(random_), between(random_, -4, 4) / 4);
      if (kind_.isScaled) {
        for (float& scale : offset.scale) scale = static_cast<float>(between(random_, 0.7, 1.5));
      }
    }
    corrective.offsets = rig_.keep(offsets);
    rig_.correctives.push_back(corrective);
  }

  void addChain() {
    std::vector<std::uint32_t> joints;
    const std::uint32_t count = 2 + below(random_, 3);
    for (std::uint32_t tries = 0; tries < 20 && joints.size() < count; ++tries) {
      const std::uint32_t joint = anyJoint();
      const bool isNew = std::ranges::none_of(joints, [&](std::uint32_t other) {
        return glm::length(rig_.bind(other)[3] - rig_.bind(joint)[3]) < 0.1 * kind_.unit;
      });
      if (isNew) joints.push_back(joint);
    }
    if (joints.size() < 2) return;
    ChainDriver chain;
    chain.joints = rig_.keep(joints);
    chain.segments = 2 + below(random_, 7);
    chain.firstDriven = static_cast<std::uint32_t>(rig_.joints.size());
    for (std::uint32_t i = 1; i < chain.segments; ++i) addJoint();
    rig_.chains.push_back(chain);
  }

  void addLinear() {
    LinearDriver linear;
    std::vector<std::uint32_t> weights;
    std::vector<JointMatrix> matrices;
    const std::uint32_t all = rig_.givenWeights + rig_.drivenWeights;
    const std::uint32_t terms = all == 0 ? 0 : below(random_, 5);
    for (std::uint32_t i = 0; i < terms; ++i) {
      weights.push_back(below(random_, all));
      JointMatrix& matrix = matrices.emplace_back();
      for (auto& row : matrix.m) {
        for (float& number : row) number = static_cast<float>(between(random_, -0.2, 0.2));
        row[3] *= static_cast<float>(kind_.unit);
      }
    }
    linear.weights = rig_.keep(weights);
    linear.matrices = rig_.keep(matrices);
    linear.joint = addJoint();
    rig_.linears.push_back(linear);
  }

  std::mt19937& random_;
  const RigKind& kind_;
  MadeRig rig_;
};

}  // namespace

MadeRig randomRig(std::mt19937& random, const RigKind& kind) {
  for (;;) {  // examples of a corrective may be too near each other
    MadeRig rig = RigMaker(random, kind).make();
    if (packRig(rig.view()).ok()) return rig;
  }
}

std::vector<JointMatrix> randomRigPose(std::mt19937& random, const MadeRig& rig,
                                       const RigKind& kind) {
  std::vector<glm::dmat4> globals;
  std::vector<JointMatrix> pose;
  for (std::uint32_t joint = 0; joint < rig.writtenJoints; ++joint) {
    const std::uint32_t parent = rig.joints[joint].parent;
    const bool hasParent = parent != noRigJoint;
    glm::dmat4 local =
        (hasParent ? glm::inverse(rig.bind(parent)) : glm::dmat4(1)) * rig.bind(joint);
    local[3] += glm::dvec4(randomDirection(random) * 0.2 * kind.unit, 0);
    local = local * randomRotation(random, kind.angle);
    if (kind.isScaled) local = local * randomScale(random);
    if (kind.flatness != 1 && chance(random, 30))
      local = glm::scale(local, glm::dvec3(1, kind.flatness, 1));
    globals.push_back(hasParent ? globals[parent] * local : local);
    pose.push_back(jointMatrixOf(globals.back() * glm::inverse(rig.bind(joint))));
  }
  return pose;
}

DrivenPose evaluated(const PackedRig& rig, std::span<const JointMatrix> written,
                     std::span<const float> givenWeights) {
  DrivenPose driven;
  driven.joints.resize(rig.drivenJoints());
  driven.weights.resize(std::size_t{rig.givenWeights()} + rig.drivenWeights());
  const Result<void> done = evaluateRig(rig, written, givenWeights, driven.joints, driven.weights);
  EXPECT_TRUE(done.ok()) << (done ? "" : done.error().message);
  return driven;
}

}  // namespace dermis::test
