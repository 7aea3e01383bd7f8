// Invariance, shortest path and rigidity of dual-quaternion blending over 100,000 random cases
// each, those among them where quaternions are antipodal, nearly opposite, or half a turn.

#include <algorithm>
#include <string>

#include "exact_joints.h"
#include "few_cases.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

constexpr int caseCount = fewer(100000);

/// What is special about the joints of a case.
enum class Kind {
  uniform,         ///< any rotations
  antipodal,       ///< any rotations, some of them as −q
  nearlyOpposite,  ///< two whose dot product is within 1e-3 of 0, on either side
  halfTurns,       ///< each of exactly 180°
  almostHalfTurns  ///< two that are 180° ± 1e-6 apart
};
constexpr int kindCount = 5;

struct Case {
  Kind kind;
  std::vector<DualQuatd> joints;
  std::vector<double> weights;
};

/// A turn by about 180° about any axis, so that its quaternion's dot product with the identity is
/// `dot`.
glm::dquat turnOfDot(RigRandom& random, double dot) {
  const glm::dvec3 v = std::sqrt(1 - dot * dot) * random.direction();
  return {dot, v.x, v.y, v.z};
}

DualQuatd withTranslation(RigRandom& random, const glm::dquat& q) {
  return rigidOf(q, random.vector(1));
}

Case randomCase(RigRandom& random, int number) {
  Case result;
  result.kind = static_cast<Kind>(number % kindCount);
  const std::size_t count = 2 + static_cast<std::size_t>(number / kindCount % 3);
  std::vector<DualQuatd>& joints = result.joints;
  while (joints.size() < count) {
    joints.push_back(result.kind == Kind::halfTurns ? withTranslation(random, turnOfDot(random, 0))
                                                    : randomRigid(random));
  }
  const double side = random.below(2) == 0 ? -1 : 1;
  if (result.kind == Kind::nearlyOpposite) {
    const double dot = side * std::pow(10, random.between(-12, -3));
    joints[1] = withTranslation(random, joints[0].real * turnOfDot(random, dot));
  } else if (result.kind == Kind::almostHalfTurns) {
    const double dot = side * std::sin(0.5e-6 * pi / 180);
    joints[1] = withTranslation(random, joints[0].real * turnOfDot(random, dot));
  }
  if (result.kind == Kind::antipodal) {
    for (DualQuatd& joint : joints) {
      if (random.below(2) == 0) joint = -joint;
    }
  }
  result.weights = randomWeights(random, count);
  // The pivot is one of the two.
  if (result.kind == Kind::nearlyOpposite || result.kind == Kind::almostHalfTurns) {
    std::vector<double>& weights = result.weights;
    std::iter_swap(weights.begin(), std::max_element(weights.begin(), weights.end()));
    if (random.below(2) == 0) std::swap(weights[0], weights[1]);
  }
  return result;
}

glm::dvec3 moved(std::span<const DualQuatd> joints, std::span<const double> weights,
                 const glm::dvec3& p, Method method = Method::dualQuaternion) {
  return ExactRig(joints, weights).move(p, method);
}

std::size_t pivotOf(std::span<const double> weights) {
  return static_cast<std::size_t>(std::max_element(weights.begin(), weights.end()) -
                                  weights.begin());
}

/// The same by dual quaternions of GLM: Σ ±w q, in the hemisphere of the pivot, made unit.
DualQuatd blend(const Case& sample) {
  const glm::dquat pivot = sample.joints[pivotOf(sample.weights)].real;
  DualQuatd sum{glm::dquat(0, 0, 0, 0), glm::dquat(0, 0, 0, 0)};
  for (std::size_t i = 0; i < sample.joints.size(); ++i) {
    const double sign = glm::dot(sample.joints[i].real, pivot) < 0 ? -1 : 1;
    sum = sum + sample.joints[i] * (sign * sample.weights[i]);
  }
  return sum * (1 / std::sqrt(glm::dot(sum.real, sum.real)));
}

/// The least |dot| with the pivot: what rounding may tip where it is small.
double leastDot(const Case& sample) {
  const std::size_t pivot = pivotOf(sample.weights);
  double least = 1;
  for (const DualQuatd& joint : sample.joints)
    least = std::min(least, std::abs(glm::dot(joint.real, sample.joints[pivot].real)));
  return least;
}

std::string nameOf(const Case& sample, int number) {
  return "case " + std::to_string(number) + ", kind " +
         std::to_string(static_cast<int>(sample.kind));
}

// ---- Invariance

TEST(Property, Truth04_DualQuaternionsAreInvariantFromTheLeftAndTheRight) {
  RigRandom random(1);
  const DualQuatd one;
  int compared[kindCount] = {};
  for (int number = 0; number < caseCount; ++number) {
    const Case sample = randomCase(random, number);
    const DualQuatd g = randomRigid(random);
    const glm::dvec3 p = random.vector(1);
    // The dot product survives the products with g but for a few roundings.
    if (leastDot(sample) < 1e-14) continue;
    ++compared[static_cast<int>(sample.kind)];
    const glm::dvec3 here = moved(sample.joints, sample.weights, p);
    const glm::dvec3 there = moved(sample.joints, sample.weights, transformPoint(g, p));
    ASSERT_LE(glm::length(moved(movedBy(g, sample.joints, one), sample.weights, p) -
                          transformPoint(g, here)),
              1e-13)
        << nameOf(sample, number);
    ASSERT_LE(glm::length(moved(movedBy(one, sample.joints, g), sample.weights, p) - there), 1e-13)
        << nameOf(sample, number);
    ASSERT_LE(glm::length(moved(movedBy(g, sample.joints, conjugate(g)), sample.weights,
                                transformPoint(g, p)) -
                          transformPoint(g, here)),
              1e-13)
        << nameOf(sample, number);
  }
  for (const int count : compared) EXPECT_GT(count, caseCount / kindCount * 99 / 100);
}

// q and −q are one transform: with either of them every bit is the same.
TEST(Property, Truth06_AntipodalQuaternionsMoveAlike) {
  RigRandom random(2);
  for (int number = 0; number < caseCount; ++number) {
    Case sample = randomCase(random, number);
    if (leastDot(sample) == 0) continue;
    const glm::dvec3 p = random.vector(1);
    const glm::dvec3 before = moved(sample.joints, sample.weights, p);
    const DualQuatd b = blend(sample);
    DualQuatd& joint =
        sample.joints[random.below(static_cast<std::uint32_t>(sample.joints.size()))];
    joint = -joint;
    const glm::dvec3 after = moved(sample.joints, sample.weights, p);
    for (int i = 0; i < 3; ++i) ASSERT_EQ(after[i], before[i]) << nameOf(sample, number);
    // By GLM, too, where the pivot's sign goes through to the blend's.
    const glm::dvec3 byBlend = transformPoint(b, p);
    const glm::dvec3 byOther = transformPoint(blend(sample), p);
    for (int i = 0; i < 3; ++i) ASSERT_EQ(byOther[i], byBlend[i]) << nameOf(sample, number);
    ASSERT_LE(glm::length(byBlend - before), 1e-13);
  }
}

// ---- Shortest path

/// Two joints of a case, of which the result is followed from one to the other.
TEST(Property, TwoJointsBlendOnTheShortestWayBetweenThem) {
  RigRandom random(3);
  double worstBent = 0, worstSpeed = 0;
  for (int number = 0; number < caseCount; ++number) {
    Case sample = randomCase(random, number);
    const std::span<const DualQuatd> pair = std::span(sample.joints).first(2);
    const glm::dmat3 a = glm::mat3_cast(pair[0].real), b = glm::mat3_cast(pair[1].real);
    const double whole = angleBetween(a, b);
    double weights[3] = {random.between(0, 1), random.between(0, 1), random.between(0, 1)};
    std::sort(weights, weights + 3);
    double before = 0;
    for (const double w : weights) {
      const glm::dmat3 result =
          ExactRig(pair, std::array{1 - w, w}).motion(Method::dualQuaternion).rotation;
      const double fromA = angleBetween(a, result), fromB = angleBetween(result, b);
      // Nowhere further from either than they are from each other, and on the way between.
      ASSERT_LE(fromA, whole + 1e-14 * 10) << nameOf(sample, number);
      ASSERT_LE(fromB, whole + 1e-14 * 10) << nameOf(sample, number);
      worstBent = std::max(worstBent, std::abs(fromA + fromB - whole));
      // By rising weight ever further from the first.
      ASSERT_GE(fromA, before - 1e-14 * 10) << nameOf(sample, number);
      before = fromA;
      const double known = 2 * std::atan2(w * std::sin(whole / 2), 1 - w + w * std::cos(whole / 2));
      worstSpeed = std::max(worstSpeed, std::abs(fromA - known));
    }
  }
  // Rounding of rotations goes into their angle: 1e-15 of a radian, or a few.
  EXPECT_LE(worstBent, 1e-14);
  EXPECT_LE(worstSpeed, 1e-14);
}

// The exact screw, at constant speed; of a logarithm it is not true.
TEST(Property, IterativeBlendingOfTwoJointsTakesTheShortestWayAtConstantSpeed) {
  RigRandom random(4);
  double worst = 0;
  for (int number = 0; number < caseCount; ++number) {
    const Case sample = randomCase(random, number);
    const std::span<const DualQuatd> pair = std::span(sample.joints).first(2);
    const glm::dmat3 a = glm::mat3_cast(pair[0].real), b = glm::mat3_cast(pair[1].real);
    const double whole = angleBetween(a, b);
    const double w = random.between(0, 1);
    const glm::dmat3 result =
        ExactRig(pair, std::array{1 - w, w}).motion(Method::dualQuaternionIterative).rotation;
    worst = std::max({worst, std::abs(angleBetween(a, result) - w * whole),
                      std::abs(angleBetween(result, b) - (1 - w) * whole)});
  }
  EXPECT_LE(worst, 1e-14);
}

TEST(Property, LogarithmsMayLeaveTheShortestWay) {
  RigRandom random(5);
  int longer = 0, cases = 0;
  for (int number = 0; number < fewer(10000); ++number) {
    const Case sample = randomCase(random, kindCount * number);  // uniform
    const std::span<const DualQuatd> pair = std::span(sample.joints).first(2);
    const glm::dmat3 a = glm::mat3_cast(pair[0].real), b = glm::mat3_cast(pair[1].real);
    const glm::dmat3 result =
        ExactRig(pair, std::array{0.5, 0.5}).motion(Method::logMatrix).rotation;
    ++cases;
    if (angleBetween(a, result) > angleBetween(a, b) + 0.01) ++longer;
  }
  EXPECT_GT(longer, cases / 20);
}

// Of any number of joints: the result stays in the pivot's hemisphere, less than half a turn away.
TEST(Property, NoResultIsHalfATurnFromItsPivot) {
  RigRandom random(6);
  for (int number = 0; number < caseCount; ++number) {
    const Case sample = randomCase(random, number);
    const std::size_t pivot = pivotOf(sample.weights);
    reference::Conditioning conditioning;
    const ExactRig rig(sample.joints, sample.weights);
    const DualQuatd b = fromReference(
        reference::blendRigid({rig.joints(), rig.influences(), {}, {}}, conditioning).rigid);
    // |cos| of half the angle between them is at least the pivot's weight.
    ASSERT_GE(std::abs(glm::dot(b.real, sample.joints[pivot].real)), sample.weights[pivot] - 1e-15)
        << nameOf(sample, number);
  }
}

// ---- Rigidity

void expectRigid(const Motion3& motion, double tolerance, const std::string& what) {
  const glm::dmat3 gram = glm::transpose(motion.rotation) * motion.rotation;
  for (int i = 0; i < 9; ++i)
    ASSERT_NEAR(gram[i / 3][i % 3], i % 4 == 0 ? 1 : 0, tolerance) << what;
  ASSERT_NEAR(glm::determinant(motion.rotation), 1, tolerance) << what;
}

TEST(Property, Truth08_WhatBlendsRotationsIsRigid) {
  RigRandom random(7);
  for (int number = 0; number < caseCount; ++number) {
    const Case sample = randomCase(random, number);
    ExactRig rig(sample.joints, sample.weights);
    const glm::dvec3 p = random.vector(1), q = random.vector(1);
    ASSERT_NEAR(
        glm::length(rig.move(p, Method::dualQuaternion) - rig.move(q, Method::dualQuaternion)),
        glm::length(p - q), 1e-14)
        << nameOf(sample, number);
    reference::MethodInputs inputs;
    inputs.center = random.vector(1);
    inputs.bulgeStrength = random.between(0, 1);
    for (const Method method : rigidMethods) {
      if (method != Method::dualQuaternion && number >= caseCount / 10) continue;  // they take long
      const Motion3 motion = rig.motion(method, inputs);
      // Differences of points that lie as far away as the center was thrown.
      ASSERT_NO_FATAL_FAILURE(
          expectRigid(motion, 1e-14 * (1 + rig.conditioning.leverage),
                      std::string(methodName(method)) + ", " + nameOf(sample, number)));
    }
  }
}

// ---- Through palettes in float32

// 100,000 vertices, four of them to a rigid body; joints in float32 are rigid but for rounding, and
// what is blended of them is no less so.
TEST(Property, Truth08_ThroughPosesTheBlendIsAsRigidAsItsJoints) {
  RigRandom random(9);
  constexpr std::uint32_t bodies = caseCount / 4, jointCount = 1000;
  std::vector<JointMatrix> pose;
  double stretch = 0;  // the largest |CᵀC − 1| of a joint
  for (std::uint32_t joint = 0; joint < jointCount; ++joint) {
    const double angle = joint % 4 == 0   ? pi
                         : joint % 4 == 1 ? pi + random.between(-1e-6, 1e-6)
                                          : random.between(-pi, pi);
    pose.push_back(jointOf(rotationAbout(random.direction(), angle), random.vector(1)));
    const glm::dmat3 c = linearOf(pose.back());
    const glm::dmat3 gram = glm::transpose(c) * c - glm::dmat3(1.0);
    for (int i = 0; i < 3; ++i) stretch = std::max(stretch, glm::length(gram[i]) * std::sqrt(3.0));
  }
  ASSERT_LT(stretch, 1e-6);
  OwnedMesh mesh;
  const glm::dvec3 corners[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (std::uint32_t body = 0; body < bodies; ++body) {
    const std::uint32_t first = random.below(jointCount - 3);
    const float weights[] = {static_cast<float>(random.between(0.05, 1)),
                             static_cast<float>(random.between(0.05, 1)),
                             static_cast<float>(random.between(0.05, 1))};
    for (const glm::dvec3& corner : corners) {
      addVertex(mesh, corner,
                {{first, weights[0]}, {first + 1, weights[1]}, {first + 2, weights[2]}});
    }
  }
  const reference::AnalyzedMesh result = skinned(mesh, pose, Method::dualQuaternion);
  ASSERT_EQ(result.positions.size(), std::size_t{caseCount});
  for (std::size_t body = 0; body < bodies; ++body) {
    Motion3 motion;
    motion.translation = toVector(result.positions[4 * body]);
    for (std::size_t i = 0; i < 3; ++i) {
      motion.rotation[static_cast<int>(i)] =
          toVector(result.positions[4 * body + 1 + i]) - motion.translation;
    }
    ASSERT_NO_FATAL_FAILURE(expectRigid(motion, 2 * stretch, "body " + std::to_string(body)));
  }
}

}  // namespace
}  // namespace dermis::test
