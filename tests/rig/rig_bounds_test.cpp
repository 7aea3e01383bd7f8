// What a rig drives is as near to the reference as the reference says, in the arithmetic of the CPU
// and in one as inexact as Vulkan allows.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <glm/gtc/matrix_transform.hpp>

#include "dermis/verify.h"
#include "made_rig.h"
#include "random_number.h"
#include "rig/blob.h"

namespace dermis::test {
namespace {

/// float32 on a GPU that flushes denormals, and whose divisions and square roots are off by what
/// Vulkan allows before the kernels' step of Newton's method (shaders/exact.glsl). Which way they
/// are off follows from the bits of the result.
namespace kernel_arithmetic {

float flushed(float value) {
  return std::abs(value) < 0x1p-126f ? std::copysign(0.0f, value) : value;
}
float off(float value, float units) {
  const bool isUp = std::popcount(std::bit_cast<std::uint32_t>(value) * 0x9e3779b1u) % 2 == 0;
  return value * (1 + (isUp ? units : -units) * 0x1p-23f);
}

struct Inexact {
  float value = 0;
  Inexact() = default;
  explicit Inexact(float number) : value(flushed(number)) {}

  friend Inexact operator+(Inexact a, Inexact b) { return Inexact(a.value + b.value); }
  friend Inexact operator-(Inexact a, Inexact b) { return Inexact(a.value - b.value); }
  friend Inexact operator*(Inexact a, Inexact b) { return Inexact(a.value * b.value); }
  friend Inexact operator-(Inexact a) { return Inexact(-a.value); }
  friend Inexact operator/(Inexact a, Inexact b) {
    const Inexact guess(off(a.value / b.value, 2.5f));
    const Inexact step(off((a - guess * b).value / b.value, 2.5f));
    return guess + step;
  }
  friend bool operator<(Inexact a, Inexact b) { return a.value < b.value; }
  friend bool operator>(Inexact a, Inexact b) { return a.value > b.value; }
};

Inexact squareRoot(Inexact square) {
  const float root = std::sqrt(square.value);
  if (square.value < 1e-37f) return Inexact(0);
  const Inexact guess(off(root, 4.5f));
  return guess + Inexact(0.5f) * Inexact(off((square - guess * guess).value / guess.value, 2.5f));
}
Inexact floorOf(Inexact number) {
  return Inexact(std::floor(number.value));
}
Inexact select(bool condition, Inexact a, Inexact b) {
  return condition ? a : b;
}
Inexact powerOfTwo(Inexact exponent) {
  return Inexact(std::ldexp(1.0f, static_cast<int>(exponent.value)));
}

#include "rig/evaluate_inl.h"

struct PoseMemory {
  std::vector<Transform<Inexact>> joints;
  std::size_t written;
  std::vector<Inexact> weights;

  Transform<Inexact> joint(std::size_t number) const { return joints[number]; }
  void setDriven(std::size_t number, const Transform<Inexact>& t) { joints[written + number] = t; }
  Inexact weight(std::size_t number) const { return weights[number]; }
  void setWeight(std::size_t number, Inexact value) { weights[number] = value; }
};

DrivenPose evaluate(const PackedRig& rig, std::span<const JointMatrix> written,
                    std::span<const float> givenWeights) {
  const RigBlob blob(rig);
  PoseMemory memory{{}, written.size(), {}};
  for (const JointMatrix& matrix : written)
    memory.joints.push_back(transformFrom<Inexact>(matrix.m));
  memory.joints.resize(written.size() + rig.drivenJoints());
  for (const float weight : givenWeights) memory.weights.emplace_back(weight);
  memory.weights.resize(givenWeights.size() + rig.drivenWeights());
  std::vector<Quat<Inexact>> rotations(blob.header.mostInputs);
  std::vector<Inexact> basis(maxRigExamples);
  evaluateDrivers<Inexact>(blob, rotations, basis, memory);
  DrivenPose pose;
  for (std::size_t i = written.size(); i < memory.joints.size(); ++i) {
    const Linear<Inexact>& m = memory.joints[i].linear;
    const Vec<Inexact>& shift = memory.joints[i].shift;
    pose.joints.push_back({{{m.r0.x.value, m.r0.y.value, m.r0.z.value, shift.x.value},
                            {m.r1.x.value, m.r1.y.value, m.r1.z.value, shift.y.value},
                            {m.r2.x.value, m.r2.y.value, m.r2.z.value, shift.z.value}}});
  }
  for (const Inexact& weight : memory.weights) pose.weights.push_back(weight.value);
  return pose;
}

}  // namespace kernel_arithmetic

/// How much of their bounds numbers use.
struct Shares {
  double worst = 0;        ///< of all
  double worstOfPose = 0;  ///< of the pose that is added
  double sum = 0;          ///< of the worst of each pose
  std::size_t poses = 0, count = 0, unbounded = 0;

  void add(double actual, double expected, double bound) {
    if (!std::isfinite(bound)) {
      ++unbounded;
      return;
    }
    const double error = std::abs(actual - expected);
    const double share = error == 0 ? 0 : error / bound;
    worstOfPose = std::max(worstOfPose, share <= 1e9 ? share : 1e9);  // not a number, too
    worst = std::max(worst, worstOfPose);
    ++count;
  }
  void add(const DrivenPose& actual, const reference::EvaluatedRig& expected) {
    ASSERT_EQ(actual.joints.size(), expected.joints.size());
    ASSERT_EQ(actual.weights.size(), expected.weights.size());
    for (std::size_t i = 0; i < actual.joints.size(); ++i) {
      for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 4; ++column)
          add(double{actual.joints[i].m[row][column]}, expected.joints[i][row][column],
              expected.jointBounds[i][row][column]);
      }
    }
    for (std::size_t i = 0; i < actual.weights.size(); ++i)
      add(double{actual.weights[i]}, expected.weights[i], expected.weightBounds[i]);
    sum += std::exchange(worstOfPose, 0);
    ++poses;
  }
  double mean() const { return sum / static_cast<double>(poses); }
  double shareUnbounded() const {
    return static_cast<double>(unbounded) / static_cast<double>(count + unbounded);
  }
};

constexpr RigKind kinds[] = {
    {.name = "Plain"},
    {.name = "Gentle", .angle = 0.7},
    {.name = "Scaled", .isScaled = true},
    {.name = "Mirrored", .isMirrored = true},
    {.name = "Far", .distance = 1e4},
    {.name = "Tiny", .unit = 1e-6, .isScaled = true},
    {.name = "Huge", .unit = 1e6, .isScaled = true, .isMirrored = true},
    {.name = "Flat", .flatness = 1e-4},
};

class RigBounds : public testing::TestWithParam<RigKind> {};
INSTANTIATE_TEST_SUITE_P(All, RigBounds, testing::ValuesIn(kinds),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(RigBounds, HoldForEvaluateRigAndForInexactArithmetic) {
  std::mt19937 random(7);
  Shares exact, inexact;
  for (int round = 0; round < 300; ++round) {
    const MadeRig rig = randomRig(random, GetParam());
    const PackedRig packed = rig.pack();
    for (int i = 0; i < 4; ++i) {
      const std::vector<JointMatrix> pose = randomRigPose(random, rig, GetParam());
      std::vector<float> weights;
      for (std::uint32_t weight = 0; weight < rig.givenWeights; ++weight)
        weights.push_back(static_cast<float>(between(random, -1, 1)));
      const auto expected = reference::evaluateRig(rig.view(), pose, weights);
      ASSERT_TRUE(expected.ok()) << expected.error().message;
      exact.add(evaluated(packed, pose, weights), *expected);
      inexact.add(kernel_arithmetic::evaluate(packed, pose, weights), *expected);
      ASSERT_LE(exact.worst, 1) << "round " << round;
      ASSERT_LE(inexact.worst, 1) << "round " << round;
    }
  }
  std::printf(
      "%s: %zu numbers, error / bound: %.3f at most, of a pose %.3f in the mean; inexact "
      "arithmetic: %.3f, %.3f; without a bound: %.2f %%\n",
      GetParam().name, exact.count, exact.worst, exact.mean(), inexact.worst, inexact.mean(),
      100 * exact.shareUnbounded());
  EXPECT_GT(exact.mean(), 0.02);
  EXPECT_LT(exact.shareUnbounded(), 0.3);  // drivers that read drivers that read drivers
}

/// Any numbers as a pose: many are 0, and some are larger or smaller by such a factor.
std::vector<JointMatrix> arbitraryPose(std::mt19937& random, std::uint32_t joints, double factor) {
  std::vector<JointMatrix> pose(joints);
  for (JointMatrix& joint : pose) {
    for (auto& row : joint.m) {
      for (float& entry : row) {
        const std::uint32_t kind = below(random, 12);
        const double size = kind == 0 ? factor : kind == 1 ? 1 / factor : 1;
        entry = kind < 5 && kind > 1 ? 0 : static_cast<float>(between(random, -2, 2) * size);
      }
    }
  }
  return pose;
}

// Singular matrices among them, whose bounds must be infinite.
TEST(RigBounds, HoldForAnyMatrices) {
  std::mt19937 random(11);
  for (const double factor : {1.0, 1e2, 1e4, 1e8, 1e12}) {
    Shares shares;
    for (int round = 0; round < 300; ++round) {
      const MadeRig rig = randomRig(random, kinds[round % 4]);
      const PackedRig packed = rig.pack();
      const std::vector<float> weights(rig.givenWeights, 0.5f);
      for (int i = 0; i < 4; ++i) {
        const std::vector<JointMatrix> pose = arbitraryPose(random, rig.writtenJoints, factor);
        const auto expected = reference::evaluateRig(rig.view(), pose, weights);
        ASSERT_TRUE(expected.ok()) << expected.error().message;
        shares.add(evaluated(packed, pose, weights), *expected);
        ASSERT_LE(shares.worst, 1) << "factor " << factor << ", round " << round;
      }
    }
    EXPECT_LT(shares.shareUnbounded(), 0.7) << factor;
  }
}

/// The largest bound of a joint that takes half of the twist about x of joint 1, which is below 0.
double boundOfTwist(const glm::dmat4& turn, const glm::dmat4& above = glm::dmat4(1)) {
  MadeRig rig;
  rig.addJoint(noRigJoint, glm::dmat4(1));
  rig.addJoint(0, glm::dmat4(1));
  rig.addJoint(0, glm::dmat4(1));
  rig.writtenJoints = 2;
  TwistDriver twist;
  twist.joint = 2;
  twist.source = 1;
  rig.twists.push_back(twist);
  const std::vector<JointMatrix> pose{jointMatrixOf(above), jointMatrixOf(above * turn)};
  const auto expected = reference::evaluateRig(rig.view(), pose);
  double most = 0;
  for (const auto& row : expected->jointBounds[0])
    for (const double bound : row) most = std::max(most, bound);
  return most;
}

TEST(RigBoundsAreInfinite, WhereRoundingDecidesAndNowhereElse) {
  EXPECT_LT(boundOfTwist(glm::dmat4(1)), 6e-6);
  const glm::dvec3 x(1, 0, 0), y(0, 1, 0);
  EXPECT_LT(boundOfTwist(rotationAbout(x, pi - 2e-5)), 1e-5);
  EXPECT_TRUE(std::isinf(boundOfTwist(rotationAbout(x, pi))));
  EXPECT_LT(boundOfTwist(rotationAbout(y, pi - 1e-2)), 1e-2);  // the error / w
  EXPECT_TRUE(std::isinf(boundOfTwist(rotationAbout(y, pi))));
  EXPECT_LT(boundOfTwist(glm::dmat4(1), glm::dmat4(glm::dmat3(1e-3))), 1e-5);
  for (const double size : {1e-20, 1e15}) {
    EXPECT_TRUE(std::isinf(boundOfTwist(glm::dmat4(1), glm::dmat4(glm::dmat3(size))))) << size;
  }
  glm::dmat4 flat(1);
  flat[1][1] = 0;
  EXPECT_TRUE(std::isinf(boundOfTwist(glm::dmat4(1), flat)));

  // Two joints of a chain that are turned against each other, and a linear driver too far away.
  MadeRig rig;
  for (int joint = 0; joint < 2; ++joint)
    rig.addJoint(noRigJoint, glm::translate(glm::dmat4(1), glm::dvec3(joint, 0, 0)));
  for (int joint = 0; joint < 3; ++joint) rig.addJoint(joint == 2 ? 0 : noRigJoint, glm::dmat4(1));
  rig.writtenJoints = 2;
  ChainDriver chain;
  chain.joints = rig.keep(std::vector<std::uint32_t>{0, 1});
  chain.firstDriven = 2;
  chain.segments = 3;
  rig.chains.push_back(chain);
  rig.linears.push_back({.joint = 4});
  const auto boundsOf = [&](const glm::dmat4& first, const glm::dmat4& second) {
    const std::vector<JointMatrix> pose{jointMatrixOf(first), jointMatrixOf(second)};
    const auto expected = reference::evaluateRig(rig.view(), pose);
    return std::array{expected->jointBounds[0][1][1], expected->jointBounds[2][0][0]};
  };
  EXPECT_LT(boundsOf(glm::dmat4(1), rotationAbout(x, 3.14))[0], 1e-2);
  EXPECT_TRUE(std::isinf(boundsOf(glm::dmat4(1), rotationAbout(x, pi))[0]));
  const glm::dmat4 reversed = glm::translate(glm::dmat4(1), glm::dvec3(-4, 0, 0));
  EXPECT_TRUE(std::isinf(boundsOf(glm::dmat4(1), reversed)[0]));
  EXPECT_LT(boundsOf(glm::dmat4(1), reversed)[1], 1e-6);
  EXPECT_TRUE(std::isinf(boundsOf(glm::scale(glm::dmat4(1), glm::dvec3(2e38)), reversed)[1]));
}

}  // namespace
}  // namespace dermis::test
