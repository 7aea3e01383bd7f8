// What drivers do, apart from how exactly.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/matrix.hpp>

#include "made_rig.h"
#include "matrix_of.h"
#include "random_number.h"

namespace dermis::test {
namespace {

constexpr double rightAngle = std::numbers::pi / 2;

/// Compares the numbers of the first three rows.
double differenceOf(const glm::dmat4& a, const glm::dmat4& b) {
  double most = 0;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 3; ++row)
      most = std::max(most, std::abs(a[column][row] - b[column][row]));
  return most;
}

glm::dmat4 randomBind(std::mt19937& random) {
  return glm::translate(glm::dmat4(1), randomDirection(random)) * randomRotation(random, 3);
}

/// Joint 0 is above 1, whose twist joint 2 shares. All have random bind matrices.
struct Forearm {
  MadeRig rig;
  glm::dvec3 axis;  ///< in the axes of joint 1

  Forearm(std::mt19937& random, double share, const glm::dmat4& shape = glm::dmat4(1))
      : axis(randomDirection(random)) {
    rig.addJoint(noRigJoint, shape * randomBind(random));
    rig.addJoint(0, rig.bind(0) * randomBind(random));
    rig.writtenJoints = 2;
    TwistDriver twist;
    twist.source = 1;
    twist.axis = {static_cast<float>(axis.x * 3), static_cast<float>(axis.y * 3),
                  static_cast<float>(axis.z * 3)};
    twist.share = static_cast<float>(share);
    twist.joint = rig.addJoint(0, rig.bind(1));
    rig.twists.push_back(twist);
  }
  /// Joint 1 turned in its own axes, below a joint that is moved somehow.
  glm::dmat4 driven(const glm::dmat4& turn, const glm::dmat4& above) const {
    const std::vector<JointMatrix> pose{jointMatrixOf(above), jointMatrixOf(above * turned(turn))};
    return matrixOf(evaluated(rig.pack(), pose).joints[0].m);
  }
  glm::dmat4 turned(const glm::dmat4& turn) const {
    return rig.bind(1) * turn * glm::inverse(rig.bind(1));
  }
};

TEST(RigTwist, ATwistIsSharedFromMinus180To180Degrees) {
  std::mt19937 random(1);
  for (int round = 0; round < 20; ++round) {
    const double share = between(random, -1, 1);
    const Forearm arm(random, share);
    const glm::dmat4 above = randomBind(random);
    for (double degrees = -179.5; degrees < 180; degrees += 7.25) {
      const double angle = degrees * rightAngle / 90;
      const glm::dmat4 expected =
          above * arm.turned(rotationAbout(arm.axis, double{static_cast<float>(share)} * angle));
      ASSERT_LT(differenceOf(arm.driven(rotationAbout(arm.axis, angle), above), expected), 1e-5)
          << degrees << " degrees, share " << share;
    }
  }
}

TEST(RigTwist, ASwingGivesNone) {
  std::mt19937 random(2);
  for (int round = 0; round < 200; ++round) {
    const Forearm arm(random, 1);
    const glm::dmat4 above = randomBind(random);
    const glm::dvec3 about = glm::normalize(glm::cross(arm.axis, randomDirection(random)));
    const glm::dmat4 swing = rotationAbout(about, between(random, -3, 3));
    ASSERT_LT(differenceOf(arm.driven(swing, above), above), 2e-5);
    // A swing after the twist does not change the twist.
    const double angle = between(random, -3, 3);
    const glm::dmat4 twist = rotationAbout(arm.axis, angle);
    ASSERT_LT(differenceOf(arm.driven(swing * twist, above), above * arm.turned(twist)), 2e-4);
  }
}

TEST(RigTwist, IsContinuousBelow180Degrees) {
  std::mt19937 random(3);
  const Forearm arm(random, 0.7);
  const glm::dmat4 above = randomBind(random);
  glm::dmat4 before = arm.driven(rotationAbout(arm.axis, -3.1), above);
  for (double angle = -3.1; angle < 3.1; angle += 0.01) {
    const glm::dmat4 now = arm.driven(rotationAbout(arm.axis, angle), above);
    ASSERT_LT(differenceOf(now, before), 0.05) << angle;
    before = now;
  }
}

// An arm that is the mirror image of another one, because it or all of the figure is scaled by -1.
TEST(RigTwist, AMirroredOrStretchedJointTurnsAsItsSourceDoes) {
  std::mt19937 random(4);
  for (const glm::dvec3& scale :
       {glm::dvec3(-1, 1, 1), glm::dvec3(1, 1, -1), glm::dvec3(-2), glm::dvec3(0.1)}) {
    for (const bool isParent : {true, false}) {
      Forearm arm(random, 1, isParent ? glm::scale(glm::dmat4(1), scale) : glm::dmat4(1));
      if (!isParent) {
        for (const std::uint32_t joint : {1u, 2u})
          arm.rig.joints[joint].bind = jointMatrixOf(glm::scale(arm.rig.bind(1), scale));
      }
      const glm::dmat4 twist = rotationAbout(arm.axis, 1.2);
      glm::dmat4 above = randomBind(random);
      EXPECT_LT(differenceOf(arm.driven(twist, above), above * arm.turned(twist)), 1e-5)
          << scale.x << scale.y << scale.z << isParent;
      above = glm::scale(above, {1, -1, 1});  // mirrored in the pose alone
      EXPECT_LT(differenceOf(arm.driven(twist, above), above * arm.turned(twist)), 1e-5)
          << scale.x << scale.y << scale.z << isParent;
    }
  }
  // The axis of a stretched joint is that which a twist keeps.
  Forearm arm(random, 1);
  for (const std::uint32_t joint : {1u, 2u})
    arm.rig.joints[joint].bind = jointMatrixOf(
        glm::scale(arm.rig.bind(1), joint == 1 ? glm::dvec3(1, 2, 3) : glm::dvec3(1)));
  const glm::dvec3 axis(glm::normalize(glm::dvec3(arm.rig.bind(1) * glm::dvec4(arm.axis, 0))));
  const glm::dmat4 origin = glm::translate(glm::dmat4(1), glm::dvec3(arm.rig.bind(1)[3]));
  const glm::dmat4 turn = origin * rotationAbout(axis, 1.2) * glm::inverse(origin);
  const std::vector<JointMatrix> pose{jointMatrixOf(glm::dmat4(1)), jointMatrixOf(turn)};
  EXPECT_LT(differenceOf(matrixOf(evaluated(arm.rig.pack(), pose).joints[0].m), turn), 1e-5);
}

TEST(RigBindPose, MovesNothing) {
  std::mt19937 random(5);
  const RigKind kind{.name = "", .isScaled = true, .isMirrored = true};
  const JointMatrix identity = jointMatrixOf(glm::dmat4(1));
  for (int round = 0; round < 300; ++round) {
    MadeRig rig = randomRig(random, kind);
    rig.linears.clear();
    if (!rig.correctives.empty() || !packRig(rig.view()).ok()) continue;
    const std::vector<JointMatrix> pose(rig.writtenJoints, identity);
    const std::vector<float> weights(rig.givenWeights, 0.5f);
    for (const JointMatrix& joint : evaluated(rig.pack(), pose, weights).joints)
      ASSERT_LT(differenceOf(matrixOf(joint.m), glm::dmat4(1)), 3e-6) << "round " << round;
  }
}

/// A corrective of two joints below joint 0, with weights 0 and 1 and a driven joint.
struct Corrected {
  MadeRig rig;
  std::vector<std::array<glm::dmat4, 2>> turns;
  std::vector<JointOffset> offsets;
  std::vector<float> weights;

  Corrected(std::mt19937& random, float radius, std::size_t examples) {
    rig.addJoint(noRigJoint, randomBind(random));
    for (int i = 0; i < 2; ++i) rig.addJoint(0, rig.bind(0) * randomBind(random));
    rig.writtenJoints = 3;
    rig.givenWeights = 1;
    rig.drivenWeights = 2;
    rig.addJoint(1, rig.bind(1) * randomBind(random));
    CorrectiveDriver corrective;
    corrective.inputs = rig.keep(std::vector<std::uint32_t>{1, 2});
    corrective.radius = radius;
    std::vector<std::array<float, 4>> rotations;
    for (std::size_t i = 0; i < examples; ++i) {
      std::array<glm::dmat4, 2>& turn = turns.emplace_back();
      JointOffset& offset = offsets.emplace_back();
      for (glm::dmat4& one : turn) {
        const glm::dvec3 axis = randomDirection(random);
        const double angle = i == 0 ? 0 : between(random, -2.5, 2.5);  // the first is at rest
        one = rotationAbout(axis, angle);
        rotations.push_back(quaternionAbout(axis, angle));
      }
      for (int j = 0; j < 2; ++j)
        weights.push_back(i == 0 ? 0 : static_cast<float>(between(random, -1, 1)));
      if (i == 0) continue;
      for (float& number : offset.translation) number = static_cast<float>(between(random, -1, 1));
      for (float& number : offset.scale) number = static_cast<float>(between(random, 0.5, 2));
      offset.rotation = quaternionAbout(randomDirection(random), between(random, -3, 3));
    }
    corrective.examples = rig.keep(rotations);
    corrective.firstWeight = 1;
    corrective.weightCount = 2;
    corrective.weights = rig.keep(weights);
    corrective.joints = rig.keep(std::vector<std::uint32_t>{3});
    corrective.offsets = rig.keep(offsets);
    rig.correctives.push_back(corrective);
  }
  DrivenPose driven(const std::array<glm::dmat4, 2>& turn, const glm::dmat4& above) const {
    std::vector<JointMatrix> pose{jointMatrixOf(above)};
    for (const std::uint32_t joint : {1u, 2u})
      pose.push_back(
          jointMatrixOf(above * rig.bind(joint) * turn[joint - 1] * glm::inverse(rig.bind(joint))));
    return evaluated(rig.pack(), pose, std::vector<float>{0.25f});
  }
};

TEST(RigCorrective, GivesTheValuesOfItsExamples) {
  std::mt19937 random(6);
  for (const float radius : {0.0f, 0.7f}) {
    for (int round = 0; round < 30; ++round) {
      const Corrected made(random, radius, 1 + below(random, 8));
      if (radius == 0 && made.turns.size() == 1) continue;  // singular
      for (std::size_t i = 0; i < made.turns.size(); ++i) {
        const glm::dmat4 above = randomBind(random);
        const DrivenPose pose = made.driven(made.turns[i], above);
        EXPECT_EQ(pose.weights[0], 0.25f);
        for (std::size_t j = 0; j < 2; ++j)
          EXPECT_NEAR(pose.weights[1 + j], made.weights[2 * i + j], 1e-5);
        const JointOffset& offset = made.offsets[i];
        const auto& [x, y, z, w] = offset.rotation;
        const glm::dvec3 v(x, y, z);
        const glm::dmat4 turn =
            glm::length(v) == 0
                ? glm::dmat4(1)
                : rotationAbout(glm::normalize(v), 2 * std::atan2(glm::length(v), double{w}));
        const glm::dmat4 moved =
            glm::translate(glm::dmat4(1),
                           {offset.translation[0], offset.translation[1], offset.translation[2]}) *
            glm::scale(turn, {offset.scale[0], offset.scale[1], offset.scale[2]});
        const glm::dmat4 parent =
            above * made.rig.bind(1) * made.turns[i][0] * glm::inverse(made.rig.bind(1));
        const glm::dmat4 expected =
            parent * made.rig.bind(3) * moved * glm::inverse(made.rig.bind(3));
        EXPECT_LT(differenceOf(matrixOf(pose.joints[0].m), expected), 5e-5);
      }
    }
  }
}

TEST(RigCorrective, GaussianFunctionsEndFarFromAllExamples) {
  std::mt19937 random(7);
  const Corrected made(random, 0.05f, 4);
  const DrivenPose pose =
      made.driven({rotationAbout({1, 0, 0}, 3), rotationAbout({1, 0, 0}, -3)}, glm::dmat4(1));
  for (std::size_t i = 1; i < 3; ++i) EXPECT_NEAR(pose.weights[i], 0, 1e-30);
  EXPECT_LT(
      differenceOf(matrixOf(pose.joints[0].m),
                   made.rig.bind(1) * rotationAbout({1, 0, 0}, 3) * glm::inverse(made.rig.bind(1))),
      1e-5);
}

// At distance d from the only example, the functions are exp(-d² / (2 radius²)) and, with two
// examples that are D apart, values between them are linear in the distances.
TEST(RigCorrective, ItsFunctionsAreThoseOfTheDocument) {
  MadeRig rig;
  rig.addJoint(noRigJoint, glm::dmat4(1));
  rig.writtenJoints = 1;
  rig.drivenWeights = 1;
  CorrectiveDriver corrective;
  corrective.inputs = rig.keep(std::vector<std::uint32_t>{0});
  corrective.examples = rig.keep(std::vector<std::array<float, 4>>{{0, 0, 0, 1}});
  corrective.weightCount = 1;
  corrective.weights = rig.keep(std::vector<float>{2});
  corrective.radius = 0.6f;
  rig.correctives.push_back(corrective);
  const auto weightAt = [&](double angle) {
    const std::vector<JointMatrix> pose{jointMatrixOf(rotationAbout({0, 0.6, 0.8}, angle))};
    return double{evaluated(rig.pack(), pose).weights[0]};
  };
  for (double angle = -3; angle < 3; angle += 0.1) {
    const double d = 2 * std::sin(angle / 2);
    EXPECT_NEAR(weightAt(angle), 2 * std::exp(-d * d / (2 * 0.36)), 1e-5);
  }
  rig.correctives[0].radius = 0;
  rig.correctives[0].examples = rig.keep(
      std::vector<std::array<float, 4>>{{0, 0, 0, 1}, quaternionAbout({0, 0.6, 0.8}, rightAngle)});
  rig.correctives[0].weights = rig.keep(std::vector<float>{0, 3});
  for (double angle = 0; angle < 1.5; angle += 0.1) {
    const double whole = 2 * std::sin(rightAngle / 2);
    EXPECT_NEAR(weightAt(angle), 3 * 2 * std::sin(angle / 2) / whole, 1e-5);
  }
}

/// Half of a rotation.
glm::dmat4 halfOf(const glm::dmat4& m) {
  const glm::dvec3 v(m[1][2] - m[2][1], m[2][0] - m[0][2], m[0][1] - m[1][0]);
  const double cosine = (m[0][0] + m[1][1] + m[2][2] - 1) / 2;
  return rotationAbout(glm::normalize(v), std::atan2(glm::length(v) / 2, cosine) / 2);
}

/// A chain of four joints on a curved line, with the joints between them.
struct Tentacle {
  MadeRig rig;
  static constexpr std::uint32_t count = 4;

  Tentacle(std::mt19937& random, std::uint32_t segments) {
    for (std::uint32_t joint = 0; joint < count; ++joint) {
      glm::dmat4 bind = randomBind(random);
      bind[3] = glm::dvec4(joint, 0.3 * between(random, 0, 1), 0.2 * joint * joint, 1);
      rig.addJoint(noRigJoint, bind);
    }
    rig.writtenJoints = count;
    ChainDriver chain;
    chain.joints = rig.keep(std::vector<std::uint32_t>{0, 1, 2, 3});
    chain.firstDriven = count;
    chain.segments = segments;
    for (std::uint32_t i = 1; i < segments; ++i) rig.addJoint(noRigJoint, glm::dmat4(1));
    rig.chains.push_back(chain);
  }
  glm::dvec3 origin(std::uint32_t joint) const { return rig.bind(joint)[3]; }
  std::vector<JointMatrix> pose(std::mt19937& random) const {
    std::vector<JointMatrix> pose;
    for (std::uint32_t joint = 0; joint < count; ++joint) {
      const glm::dmat4 to = glm::translate(glm::dmat4(1), origin(joint));
      pose.push_back(jointMatrixOf(glm::translate(glm::dmat4(1), 0.2 * randomDirection(random)) *
                                   to * randomRotation(random, 0.8) * glm::inverse(to)));
    }
    return pose;
  }
};

TEST(RigChain, MovesNothingInBindPoseAndAllTogether) {
  std::mt19937 random(8);
  for (const std::uint32_t segments : {2u, 3u, 8u, 40u}) {
    const Tentacle tentacle(random, segments);
    const glm::dmat4 move = randomBind(random);
    for (const glm::dmat4& all : {glm::dmat4(1), move, glm::scale(move, glm::dvec3(2))}) {
      const std::vector<JointMatrix> pose(Tentacle::count, jointMatrixOf(all));
      for (const JointMatrix& joint : evaluated(tentacle.rig.pack(), pose).joints)
        ASSERT_LT(differenceOf(matrixOf(joint.m), all), 1e-5);
    }
  }
}

// With very many segments, driven joints are as near as wanted to each joint of the chain: there
// they move as it does, from both sides; inner ones are turned by half of the bend.
TEST(RigChain, PassesThroughItsJoints) {
  std::mt19937 random(9);
  const std::uint32_t segments = 20000;
  const Tentacle tentacle(random, segments);
  const std::vector<JointMatrix> pose = tentacle.pose(random);
  const DrivenPose driven = evaluated(tentacle.rig.pack(), pose);
  std::vector<double> places{0};
  for (std::uint32_t joint = 1; joint < Tentacle::count; ++joint) {
    places.push_back(places.back() +
                     glm::distance(tentacle.origin(joint - 1), tentacle.origin(joint)));
  }
  for (std::uint32_t joint = 0; joint < Tentacle::count; ++joint) {
    const double end = places[joint] / places.back() * segments;
    for (const double at : {std::floor(end), std::floor(end) + 1}) {
      if (at < 1 || at > segments - 1) continue;
      const glm::dmat4 matrix = matrixOf(driven.joints[static_cast<std::size_t>(at) - 1].m);
      const glm::dmat4 own = matrixOf(pose[joint].m);
      const glm::dvec4 origin(tentacle.origin(joint), 1);
      EXPECT_LT(glm::length(matrix * origin - own * origin), 2e-3) << "joint " << joint;
      glm::dmat4 turn = own;
      if (joint != 0 && joint + 1 != Tentacle::count) {
        const glm::dmat4 before = matrixOf(pose[joint - 1].m);
        turn = before * halfOf(glm::dmat4(glm::inverse(glm::dmat3(before)) * glm::dmat3(own)));
      }
      EXPECT_LT(
          glm::length(glm::dvec3((matrix - turn)[0])) + glm::length(glm::dvec3((matrix - turn)[1])),
          4e-3)
          << "joint " << joint;
    }
  }
  // And nowhere does the curve jump.
  for (std::size_t i = 0; i + 1 < driven.joints.size(); ++i)
    ASSERT_LT(differenceOf(matrixOf(driven.joints[i].m), matrixOf(driven.joints[i + 1].m)), 1e-3);
}

TEST(RigChain, SpreadsTheTwist) {
  MadeRig rig;
  for (int joint = 0; joint < 2; ++joint)
    rig.addJoint(noRigJoint, glm::translate(glm::dmat4(1), glm::dvec3(joint, 5, 0)));
  rig.writtenJoints = 2;
  for (int i = 1; i < 4; ++i) rig.addJoint(noRigJoint, glm::dmat4(1));
  ChainDriver chain;
  chain.joints = rig.keep(std::vector<std::uint32_t>{0, 1});
  chain.firstDriven = 2;
  chain.segments = 4;
  rig.chains.push_back(chain);
  const glm::dmat4 origin = glm::translate(glm::dmat4(1), glm::dvec3(0, 5, 0));
  const auto about = [&](double angle) {
    return origin * rotationAbout({1, 0, 0}, angle) * glm::inverse(origin);
  };
  const double angle = 1.2;
  const std::vector<JointMatrix> pose{jointMatrixOf(glm::dmat4(1)), jointMatrixOf(about(angle))};
  const DrivenPose driven = evaluated(rig.pack(), pose);
  // The mean of two quaternions, of length 1.
  for (std::size_t i = 0; i < 3; ++i) {
    const double share = static_cast<double>(i + 1) / 4;
    const double mean =
        2 * std::atan2(share * std::sin(angle / 2), 1 - share + share * std::cos(angle / 2));
    EXPECT_LT(differenceOf(matrixOf(driven.joints[i].m), about(mean)), 1e-5);
    EXPECT_NEAR(mean, share * angle, 0.03);
  }
}

TEST(RigLinear, IsItsParentTimesOnePlusWeightedMatrices) {
  std::mt19937 random(10);
  for (const std::uint32_t parent : {noRigJoint, 0u}) {
    MadeRig rig;
    rig.addJoint(noRigJoint, randomBind(random));
    rig.writtenJoints = 1;
    rig.givenWeights = 3;
    rig.addJoint(parent, glm::dmat4(1));
    LinearDriver linear;
    linear.joint = 1;
    linear.weights = rig.keep(std::vector<std::uint32_t>{2, 0});
    const std::vector<JointMatrix> matrices{jointMatrixOf(randomBind(random)),
                                            jointMatrixOf(randomBind(random))};
    linear.matrices = rig.keep(matrices);
    rig.linears.push_back(linear);
    const glm::dmat4 above = randomBind(random);
    const std::vector<float> weights{0.3f, 9, -0.7f};
    glm::dmat4 expected = glm::dmat4(1) + matrixOf(matrices[0].m) * double{weights[2]} +
                          matrixOf(matrices[1].m) * double{weights[0]};
    expected[3][3] = 1;
    if (parent != noRigJoint) expected = above * expected;
    const std::vector<JointMatrix> pose{jointMatrixOf(above)};
    const DrivenPose driven = evaluated(rig.pack(), pose, weights);
    EXPECT_LT(differenceOf(matrixOf(driven.joints[0].m), expected), 1e-6);
    EXPECT_EQ(driven.weights, weights);
  }
}

TEST(RigIsRigid, UnlessADriverScales) {
  std::mt19937 random(11);
  Corrected made(random, 0.7f, 3);
  EXPECT_FALSE(made.rig.pack().isRigid());
  std::vector<JointOffset> offsets = made.offsets;
  for (JointOffset& offset : offsets) offset.scale = {1, 1, 1};
  made.rig.correctives[0].offsets = made.rig.keep(offsets);
  EXPECT_TRUE(made.rig.pack().isRigid());
  EXPECT_LT(made.rig.pack().residual(), 1e-5f);
  made.rig.joints[3].bind = jointMatrixOf(glm::scale(made.rig.bind(3), {1, 2, 1}));
  EXPECT_FALSE(made.rig.pack().isRigid());

  const Tentacle tentacle(random, 5);
  EXPECT_TRUE(tentacle.rig.pack().isRigid());
  EXPECT_TRUE(Forearm(random, 0.5).rig.pack().isRigid());
}

}  // namespace
}  // namespace dermis::test
