// The numbered truths for every method of the reference that they can be said of.

#include <algorithm>
#include <functional>
#include <set>
#include <string>

#include "exact_joints.h"
#include "few_cases.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

/// Those that turn as dual quaternions do, whatever becomes of the translation.
constexpr std::array methodsThatTurnAlike{Method::sphericalBlend, Method::quaternionTranslation,
                                          Method::centerOfRotation, Method::bulgeControlled};

/// Vertices at one place between joints 0 and 1, by rising weight of joint 1.
OwnedMesh betweenTwo(const glm::dvec3& position, int steps) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = 2;
  for (int step = 0; step <= steps; ++step) {
    const auto weight = static_cast<float>(static_cast<double>(step) / steps);
    addVertex(mesh, position, {{0, 1 - weight}, {1, weight}});
  }
  return mesh;
}

// ---- 1 to 3: dual quaternions beside the exact screw, which iterative blending of two joints is

struct Worst {
  double difference = 0, at = 0;
};

Worst worstOf(
    const reference::AnalyzedMesh& a, const reference::AnalyzedMesh& b,
    const std::function<double(const reference::Double3&, const reference::Double3&)>& difference) {
  Worst worst;
  const std::size_t steps = a.positions.size() - 1;
  for (std::size_t step = 0; step <= steps / 2; ++step) {  // the other half mirrors this one
    const double d = difference(a.positions[step], b.positions[step]);
    if (d > worst.difference) worst = {d, static_cast<double>(step) / static_cast<double>(steps)};
  }
  return worst;
}

TEST(ReferenceTruths, Truth01_DlbTurnsUpTo8149ThousandthsOfADegreeOtherThanTheScrew) {
  OwnedMesh mesh = betweenTwo({1, 0, 0}, 10000);
  const auto worstAt = [&](double degrees) {
    const std::array pose{JointMatrix{}, turnAboutZ(degrees)};
    return worstOf(
        skinned(mesh, pose, Method::dualQuaternion),
        skinned(mesh, pose, Method::dualQuaternionIterative),
        [](const reference::Double3& a, const reference::Double3& b) {
          return std::abs(std::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])) * 180 /
                 pi;
        });
  };
  const Worst worst = worstAt(179.9999);
  EXPECT_NEAR(worst.difference, 8.149, 0.0006);
  EXPECT_NEAR(worst.at, 0.2386, 0.00011);
  double before = worst.difference;
  for (const double degrees : {179.0, 150.0, 120.0, 90.0, 45.0, 10.0}) {
    const double difference = worstAt(degrees).difference;
    EXPECT_LT(difference, before) << degrees;
    before = difference;
  }
}

TEST(ReferenceTruths, Truth02_TheTranslationAlongTheScrewDiffersBy1501HundredthsOfAPercent) {
  OwnedMesh mesh = betweenTwo({0, 0, 0}, 10000);
  const glm::dvec3 center(0.3, -0.4, 0);
  const glm::dmat3 turn = rotationAbout({0, 0, 1}, 179.9999 * pi / 180);
  const std::array pose{JointMatrix{}, jointOf(turn, center - turn * center + glm::dvec3(0, 0, 1))};
  const reference::AnalyzedMesh exact = skinned(mesh, pose, Method::dualQuaternionIterative);
  for (std::size_t step = 0; step <= 10000; ++step)
    ASSERT_NEAR(exact.positions[step][2], static_cast<double>(step) * 1e-4, 1e-6);
  const Worst worst = worstOf(skinned(mesh, pose, Method::dualQuaternion), exact,
                              [](const reference::Double3& a, const reference::Double3& b) {
                                return std::abs(a[2] - b[2]);
                              });
  EXPECT_NEAR(worst.difference, 0.1501, 0.00006);
  EXPECT_NEAR(worst.at, 0.257, 0.00055);
}

TEST(ReferenceTruths, Truth03_BothStayOnTheScrewAxis) {
  RigRandom random(3);
  for (int trial = 0; trial < 2000; ++trial) {
    const glm::dvec3 axis = random.direction(), center = random.vector(1);
    const glm::dquat turn = turnAbout(axis, random.between(0.2, pi - 0.05));
    const DualQuatd screw = rigidOf(turn, center - turn * center + random.between(-2, 2) * axis);
    const double t = random.between(0.1, 0.9);
    ExactRig rig(std::array{DualQuatd{}, screw}, std::array{1 - t, t});
    const glm::dvec3 onAxis = center + random.between(-1, 1) * axis;
    for (const Method method :
         {Method::dualQuaternion, Method::dualQuaternionIterative, Method::logMatrix}) {
      const glm::dvec3 way = rig.move(onAxis, method) - onAxis;
      EXPECT_LE(glm::length(way - glm::dot(way, axis) * axis), 1e-12) << methodName(method);
      const glm::dmat3 rotation = rig.motion(method).rotation;
      EXPECT_LE(glm::length(rotation * axis - axis), 1e-12) << methodName(method);
    }
  }
}

// ---- 4: which methods are invariant under what

/// From the left: the world moved. From the right: the bind pose moved. Of the frame: both, g ·
/// g⁻¹.
struct Invariance {
  Method method;
  bool left, right, frame;
};
constexpr std::array invariances{Invariance{Method::linear, true, true, true},
                                 Invariance{Method::dualQuaternion, true, true, true},
                                 Invariance{Method::dualQuaternionIterative, true, true, true},
                                 Invariance{Method::logMatrix, false, false, true},
                                 Invariance{Method::sphericalBlend, true, true, true},
                                 Invariance{Method::quaternionTranslation, true, false, false},
                                 Invariance{Method::blended, true, true, true},
                                 Invariance{Method::centerOfRotation, true, true, true},
                                 Invariance{Method::bulgeControlled, true, true, true}};

/// How far what a method makes of moved joints is from its moved result: the largest seen of many
/// cases, and the mean.
struct Deviation {
  double largest = 0, sum = 0;
  int cases = 0;

  void add(double deviation) {
    largest = std::max(largest, deviation);
    sum += deviation;
    ++cases;
  }
  void expect(bool invariant, double tolerance, const std::string& what) const {
    ASSERT_GT(cases, 500) << what;
    if (invariant) {
      EXPECT_LE(largest, tolerance) << what;
    } else {
      EXPECT_GT(sum / cases, 0.05) << what;
    }
  }
};

TEST(ReferenceTruths, Truth04_WhoIsInvariantUnderWhat) {
  for (const Invariance& invariance : invariances) {
    const Method method = invariance.method;
    RigRandom random(4);
    Deviation ofLeft, ofRight, ofFrame;
    const DualQuatd one;
    for (int trial = 0; trial < 2000; ++trial) {
      const std::size_t count = 2 + static_cast<std::size_t>(trial % 3);
      const std::vector<DualQuatd> joints = randomRigids(random, count);
      const std::vector<double> weights = randomWeights(random, count);
      const DualQuatd g = randomRigid(random), back = conjugate(g);
      const glm::dvec3 p = random.vector(1);
      reference::MethodInputs inputs, moved;
      inputs.center = random.vector(1);
      inputs.dualQuaternionWeight = moved.dualQuaternionWeight = random.between(0, 1);
      inputs.bulgeStrength = moved.bulgeStrength = random.between(0, 1);
      moved.center = transformPoint(g, inputs.center);
      const auto deviation = [&](std::span<const DualQuatd> changed, const glm::dvec3& point,
                                 const reference::MethodInputs& at, const glm::dvec3& expected) {
        ExactRig rig(changed, weights);
        const double distance = glm::length(rig.move(point, method, at) - expected);
        return rig.conditioning.signAmbiguous ? -1 : distance / (1 + rig.conditioning.leverage);
      };
      ExactRig rig(joints, weights);
      const glm::dvec3 here = rig.move(p, method, inputs);
      if (rig.conditioning.signAmbiguous) continue;
      const double l = deviation(movedBy(g, joints, one), p, inputs, transformPoint(g, here));
      // C g at p is C at g p: the bind pose, center and all, moved by g.
      const glm::dvec3 there = rig.move(transformPoint(g, p), method, moved);
      const double r = deviation(movedBy(one, joints, g), p, inputs, there);
      const double f =
          deviation(movedBy(g, joints, back), transformPoint(g, p), moved, transformPoint(g, here));
      if (rig.conditioning.signAmbiguous || l < 0 || r < 0 || f < 0) continue;
      ofLeft.add(l);
      ofRight.add(r);
      ofFrame.add(f);
    }
    constexpr double tolerance = 1e-14;
    const std::string name(methodName(method));
    ofLeft.expect(invariance.left, tolerance, name + " from the left");
    ofRight.expect(invariance.right, tolerance, name + " from the right");
    ofFrame.expect(invariance.frame, tolerance, name + " of the frame");
  }
}

// In the palettes' own float32, where g and its product with the joints are exact.
TEST(ReferenceTruths, Truth04_ThroughPoses) {
  RigRandom random(5);
  const auto exactly = [](const glm::dvec3& v) { return glm::round(v * 1024.0) / 1024.0; };
  for (const auto& [method, left, right, frame] : invariances) {
    if (!left && !frame) continue;
    for (int trial = 0; trial < 50; ++trial) {
      const glm::dmat3 turn = exactRotation(random);
      const glm::dvec3 shift = exactly(random.vector(4));
      std::vector<JointMatrix> pose, moved;
      for (int joint = 0; joint < 6; ++joint) {
        const JointMatrix any = jointOf(rotationAbout(random.direction(), random.between(-3, 3)),
                                        exactly(random.vector(4)));
        pose.push_back(any);
        const glm::dmat3 rotation = turn * linearOf(any);
        // A change of frame with a shift would round in float32.
        moved.push_back(left ? jointOf(rotation, turn * offsetOf(any) + shift)
                             : jointOf(rotation * glm::transpose(turn), turn * offsetOf(any)));
      }
      OwnedMesh mesh = scatteredMesh(random, 50, 6, 3), turned = mesh;
      if (!left) {
        for (std::vector<float>* values : {&turned.positions, &turned.centersOfRotation}) {
          for (std::size_t i = 0; i < values->size(); i += 3) {
            const glm::dvec3 v =
                turn * glm::dvec3((*values)[i], (*values)[i + 1], (*values)[i + 2]);
            for (int k = 0; k < 3; ++k)
              (*values)[i + static_cast<std::size_t>(k)] = static_cast<float>(v[k]);
          }
        }
      }
      const reference::AnalyzedMesh before = skinned(mesh, pose, method);
      const reference::AnalyzedMesh after = skinned(turned, moved, method);
      for (std::size_t vertex = 0; vertex < 50; ++vertex) {
        if (before.conditioning[vertex].signAmbiguous) continue;
        const glm::dvec3 expected =
            turn * toVector(before.positions[vertex]) + (left ? shift : glm::dvec3(0.0));
        const double lost = method == Method::dualQuaternionIterative ? 1e-10 : 1e-13;
        const double tolerance = lost * (10 + 100 * before.conditioning[vertex].leverage);
        expectNear(toVector(after.positions[vertex]), expected, tolerance);
        if (!left) continue;  // their normals are not turned
        expectNear(toVector(after.normals[vertex]), turn * toVector(before.normals[vertex]),
                   tolerance);
      }
    }
  }
}

// ---- 5: the library normalizes weights, for every method (input_test.cpp has it by the bit)

TEST(ReferenceTruths, Truth05_DlbItselfDoesNotChangeLinearBlendingItselfDoes) {
  RigRandom random(6);
  for (int trial = 0; trial < 500; ++trial) {
    const std::vector<DualQuatd> joints = randomRigids(random, 3);
    const std::vector<double> weights = randomWeights(random, 3);
    std::vector<double> part = weights;
    for (double& weight : part) weight *= 0.37;
    const glm::dvec3 p = random.vector(1);
    ExactRig whole(joints, weights), scaled(joints, part);
    const auto blended = [](const ExactRig& rig) {
      reference::Conditioning conditioning;
      return fromReference(
          reference::blendRigid({rig.joints(), rig.influences(), {}, {}}, conditioning).rigid);
    };
    const DualQuatd b = blended(whole), same = blended(scaled);
    EXPECT_LE(std::sqrt(glm::dot(b.real - same.real, b.real - same.real)), 1e-15);
    EXPECT_LE(std::sqrt(glm::dot(b.dual - same.dual, b.dual - same.dual)), 2e-15);
    EXPECT_LE(glm::length(transformPoint(b, p) - transformPoint(same, p)), 1e-14);
    expectNear(scaled.move(p, Method::linear), 0.37 * whole.move(p, Method::linear), 1e-15);
  }
}

// ---- 6: the sign of a quaternion is no part of the joint

TEST(ReferenceTruths, Truth06_NegatingAJointMovesNoPointInAnyBitWhateverTheMethod) {
  RigRandom random(7);
  for (int trial = 0; trial < 500; ++trial) {
    const std::size_t count = 2 + static_cast<std::size_t>(trial % 4);
    std::vector<DualQuatd> joints = randomRigids(random, count);
    const std::vector<double> weights = randomWeights(random, count);
    const glm::dvec3 p = random.vector(1);
    reference::MethodInputs inputs;
    inputs.center = random.vector(1);
    inputs.dualQuaternionWeight = inputs.bulgeStrength = 0.375;
    for (const Method method : allMethods) {
      const glm::dvec3 before = ExactRig(joints, weights).move(p, method, inputs);
      for (DualQuatd& joint : joints) {
        joint = -joint;
        const glm::dvec3 after = ExactRig(joints, weights).move(p, method, inputs);
        for (int i = 0; i < 3; ++i) EXPECT_EQ(after[i], before[i]) << methodName(method);
      }
    }
  }
}

// ---- 7: iterative blending

TEST(ReferenceTruths, Truth07_IterativeBlendingOfTwoJointsIsTheScrew) {
  RigRandom random(8);
  double worst = 0;
  for (int trial = 0; trial < fewer(5000); ++trial) {
    const DualQuatd a = randomRigid(random), b = randomRigid(random);
    if (std::abs(glm::dot(a.real, b.real)) < 0.01) continue;  // either way round is as short
    const double t = random.between(0, 1);
    ExactRig rig(std::array{a, b}, std::array{1 - t, t});
    const glm::dvec3 p = random.vector(1);
    worst = std::max(worst, glm::length(rig.move(p, Method::dualQuaternionIterative) -
                                        transformPoint(screwInterpolate(a, b, t), p)));
  }
  EXPECT_LE(worst, 1e-14);
}

/// Four joints of at most 1.5 rad from a common base, and their weights.
struct FourJoints {
  std::array<glm::dvec3, 4> turns;
  std::array<glm::dvec3, 4> translations;
  std::array<double, 4> weights;

  explicit FourJoints(RigRandom& random) {
    for (std::size_t i = 0; i < 4; ++i) {
      turns[i] = random.direction() * 1.5 * std::cbrt(random.between(0, 1));
      translations[i] = random.vector(1);
      weights[i] = random.between(0.01, 1);
    }
  }
  void step(RigRandom& random, double size) {
    for (std::size_t i = 0; i < 4; ++i) {
      turns[i] += random.vector(size);
      if (glm::length(turns[i]) > 1.5) turns[i] *= 1.5 / glm::length(turns[i]);
      weights[i] = std::clamp(weights[i] * std::exp(random.between(-size, size)), 1e-3, 1.0);
    }
  }
  ExactRig rig(const DualQuatd& base) const {
    std::vector<DualQuatd> joints;
    double sum = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const double angle = glm::length(turns[i]);
      joints.push_back(base * rigidOf(turnAbout(turns[i] / angle, angle), translations[i]));
      sum += weights[i];
    }
    std::array<double, 4> normalized = weights;
    for (double& weight : normalized) weight /= sum;
    return {joints, normalized};
  }
};

/// Σ w log(b* q): 0 where the iteration has ended.
double residualOf(const ExactRig& rig, const DualQuatd& b) {
  const reference::Influence& strongest = reference::pivotOf(rig.influences());
  const glm::dquat pivot = fromReference(rig.joints()[strongest.joint].rigid).real;
  DualQuatd mean{glm::dquat(0, 0, 0, 0), glm::dquat(0, 0, 0, 0)};
  for (const reference::Influence& influence : rig.influences()) {
    DualQuatd joint = fromReference(rig.joints()[influence.joint].rigid);
    if (glm::dot(joint.real, pivot) < 0) joint = -joint;
    mean = mean + log(normalize(conjugate(b) * joint)) * influence.weight;
  }
  return std::sqrt(std::max(glm::dot(mean.real, mean.real), glm::dot(mean.dual, mean.dual)));
}

TEST(ReferenceTruths, Truth07_FourJointsWithin15RadiansEndWithin20Steps) {
  RigRandom random(9);
  double worst = 0;
  for (int trial = 0; trial < fewer(20000); ++trial) {
    const ExactRig rig = FourJoints(random).rig(randomRigid(random));
    const reference::VertexToSkin vertex{rig.joints(), rig.influences(), {}, {}};
    reference::Conditioning conditioning;
    const reference::RigidBlend blend = reference::blendRigid(vertex, conditioning);
    // The last of its steps, however many they were, left this much to do.
    worst = std::max(
        worst,
        residualOf(rig, fromReference(reference::iterate(vertex, blend.rigid, conditioning))));
  }
  EXPECT_LE(worst, 1e-12);
}

TEST(ReferenceTruths, Truth07_DlbIsUpTo7DegreesFromIt) {
  RigRandom random(10);
  const auto differenceOf = [](const FourJoints& four) {
    ExactRig rig = four.rig(DualQuatd{});
    return angleBetween(rig.motion(Method::dualQuaternion).rotation,
                        rig.motion(Method::dualQuaternionIterative).rotation) *
           180 / pi;
  };
  double most = 0;
  for (int climb = 0; climb < 30; ++climb) {
    FourJoints best(random);
    double highest = differenceOf(best);
    for (int step = 0; step < 600; ++step) {
      FourJoints next = best;
      next.step(random, step < 300 ? 0.3 : 0.03);
      const double difference = differenceOf(next);
      if (difference > highest) {
        highest = difference;
        best = next;
      }
    }
    most = std::max(most, highest);
  }
  RecordProperty("degrees", std::to_string(most));
  EXPECT_NEAR(most, 7.0, 0.1);
}

// ---- 8: rigid joints, rigid result

// Linear blending of two rotations by 180° is flat; half of that is between.
TEST(ReferenceTruths, Truth08_LinearBlendingAndWhatIsBlendedWithItAreNotRigid) {
  ExactRig rig(std::array{DualQuatd{}, rigidOf(turnAbout({0, 0, 1}, 2), {0, 0, 0})},
               std::array{0.5, 0.5});
  EXPECT_NEAR(glm::determinant(rig.motion(Method::linear).rotation), std::cos(1) * std::cos(1),
              1e-14);
  reference::MethodInputs half;
  half.dualQuaternionWeight = 0.5;
  const double side = (std::cos(1) + 1) / 2;
  EXPECT_NEAR(glm::determinant(rig.motion(Method::blended, half).rotation), side * side, 1e-14);
}

TEST(ReferenceTruths, SomeMethodsTurnAsDualQuaternionsDo) {
  RigRandom random(12);
  for (int trial = 0; trial < 1000; ++trial) {
    const std::vector<DualQuatd> joints = randomRigids(random, 4);
    ExactRig rig(joints, randomWeights(random, 4));
    reference::MethodInputs inputs;
    inputs.center = random.vector(1);
    inputs.bulgeStrength = random.between(0, 1);
    const glm::dmat3 expected = rig.motion(Method::dualQuaternion, inputs).rotation;
    for (const Method method : methodsThatTurnAlike) {
      const glm::dmat3 rotation = rig.motion(method, inputs).rotation;
      for (int i = 0; i < 3; ++i)
        EXPECT_LE(glm::length(rotation[i] - expected[i]), 1e-14 * (1 + rig.conditioning.leverage));
    }
  }
}

// ---- 9 to 11: the tube

/// The angle at which a method has the point (1, 0, z), and its distance from the axis.
struct Twisted {
  double radius, angle;
};

Twisted twistedBy(double degrees, double weight, Method method) {
  const std::array pose{JointMatrix{}, turnAboutZ(degrees)};
  OwnedMesh mesh;
  addVertex(mesh, {1, 0, 0.5},
            {{0, static_cast<float>(1 - weight)}, {1, static_cast<float>(weight)}});
  mesh.centersOfRotation = {0, 0, 0.5f};
  const reference::Double3 p = skinned(mesh, pose, method).positions[0];
  EXPECT_NEAR(p[2], 0.5, 1e-7);
  return {std::hypot(p[0], p[1]), std::atan2(p[1], p[0]) * 180 / pi};
}

TEST(ReferenceTruths, Truth09_CandyWrapperRadiusOfLinearBlending) {
  for (const double degrees : {10.0, 60.0, 90.0, 120.0, 150.0, 179.0, 180.0}) {
    for (const double weight : {0.0, 0.125, 0.25, 0.5, 0.625, 1.0}) {
      const double sine = std::sin(degrees * pi / 360);
      EXPECT_NEAR(twistedBy(degrees, weight, Method::linear).radius,
                  std::sqrt(std::max(0.0, 1 - 4 * weight * (1 - weight) * sine * sine)), 1.5e-7)
          << degrees << " degrees, weight " << weight;
    }
  }
  EXPECT_NEAR(twistedBy(90, 0.5, Method::linear).radius, 0.7071, 5e-5);
  EXPECT_NEAR(twistedBy(120, 0.5, Method::linear).radius, 0.5, 1e-7);
  EXPECT_NEAR(twistedBy(180, 0.5, Method::linear).radius, 0, 1e-7);
}

TEST(ReferenceTruths, Truth09_NoCandyWrapperWhateverTheMethodButLinear) {
  for (const double degrees : {10.0, 60.0, 90.0, 120.0, 150.0, 179.0, 179.9}) {
    for (const double weight : {0.0, 0.125, 0.25, 0.5, 0.75, 1.0}) {
      const double half = degrees * pi / 360;
      const double byDlb =
          2 * std::atan2(weight * std::sin(half), 1 - weight + weight * std::cos(half)) * 180 / pi;
      for (const Method method : rigidMethods) {
        const Twisted twisted = twistedBy(degrees, weight, method);
        EXPECT_NEAR(twisted.radius, 1, 2e-7) << methodName(method) << ", " << degrees;
        const bool atConstantSpeed =
            method == Method::dualQuaternionIterative || method == Method::logMatrix;
        EXPECT_NEAR(twisted.angle, atConstantSpeed ? weight * degrees : byDlb, 3e-5)
            << methodName(method) << ", " << degrees << " degrees, weight " << weight;
      }
    }
    // Half way both lie in one direction: a mean of lengths.
    const double half = degrees * pi / 360;
    EXPECT_NEAR(twistedBy(degrees, 0.5, Method::blended).radius, (std::cos(half) + 1) / 2, 2e-7);
  }
}

/// A turn about the line parallel to x through (0, 0, height).
JointMatrix bendAt(double height, double degrees) {
  const glm::dmat3 bend = rotationAbout({1, 0, 0}, degrees * pi / 180);
  const glm::dvec3 pivot(0, 0, height);
  return jointOf(bend, pivot - bend * pivot);
}

/// The deviation from a tube of infinitely many rings and sides must fall as 1/N².
void expectVolume(const JointMatrix& joint, Method method, double expected, double length,
                  float bulgeStrength = 1) {
  SCOPED_TRACE(testing::Message() << methodName(method) << ", length " << length);
  double error[3];
  int index = 0;
  for (const std::uint32_t count : {16u, 32u, 64u}) {
    Tube tube = tubeOf(count, count, length, 0.5);
    tube.mesh.bulgeStrengths.assign(tube.mesh.vertexCount(), bulgeStrength);
    error[index++] = volumeRatio(tube, joint, method) - expected;
  }
  EXPECT_NEAR(error[2], 0, 3e-3);
  if (std::abs(error[0]) < 1e-5) return;
  EXPECT_NEAR(error[0] / error[1], 4, 0.4);
  EXPECT_NEAR(error[1] / error[2], 4, 0.2);
}

TEST(ReferenceTruths, Truth10_TwistKeepsTheVolumeWhateverTheMethodButLinear) {
  for (const double degrees : {45.0, 90.0, 120.0, 170.0}) {
    for (const double length : {0.5, 3.0}) {
      for (const Method method : rigidMethods) expectVolume(turnAboutZ(degrees), method, 1, length);
    }
  }
}

TEST(ReferenceTruths, Truth10_LinearTwistLosesTwoThirdsOfSquaredSine) {
  for (const double degrees : {45.0, 90.0, 120.0, 180.0}) {
    const double sine = std::sin(degrees * pi / 360);
    for (const double length : {0.5, 3.0})
      expectVolume(turnAboutZ(degrees), Method::linear, 1 - 2.0 / 3 * sine * sine, length);
  }
}

TEST(ReferenceTruths, Truth11_LinearBendLosesAThirdOfSquaredSine) {
  for (const double degrees : {45.0, 90.0, 120.0, 180.0}) {
    const double sine = std::sin(degrees * pi / 360);
    for (const double length : {0.5, 3.0}) {
      for (const double height : {0.0, 0.2 * length})
        expectVolume(bendAt(height, degrees), Method::linear, 1 - 1.0 / 3 * sine * sine, length);
    }
  }
}

// About the origin, where sections stay flat whatever the speed of the turn: each turns about a
// line through its own plane's axis, and its centroid stays on that. Away from the origin, too:
// where translations are blended on their own sections are shifted, but by symmetry as much volume
// is won on one side of the bend as is lost on the other.
TEST(ReferenceTruths, Truth11_BendKeepsTheVolumeWhereAllTurnsShareTheirLine) {
  for (const double degrees : {45.0, 90.0, 120.0, 170.0}) {
    for (const Method method :
         {Method::dualQuaternion, Method::dualQuaternionIterative, Method::logMatrix,
          Method::sphericalBlend, Method::quaternionTranslation}) {
      expectVolume(bendAt(0, degrees), method, 1, 3);
      if (degrees < 170 || method == Method::dualQuaternion)
        expectVolume(bendAt(0.4, degrees), method, 1, 3);
    }
  }
}

// The point at which two bones meet stays where it is; but for the method that blends translations
// on their own, which tears there.
TEST(ReferenceTruths, APointThatBothJointsKeepIsKept) {
  RigRandom random(14);
  for (int trial = 0; trial < 200; ++trial) {
    const glm::dmat3 bend = rotationAbout(random.direction(), random.between(1, 2.5));
    const auto elbow = glm::dvec3(glm::vec3(random.direction() * random.between(0.5, 1)));
    const std::array pose{JointMatrix{}, jointOf(bend, elbow - bend * elbow)};
    OwnedMesh mesh;
    addVertex(mesh, elbow, {{0, 0.375f}, {1, 0.625f}});
    for (const Method method : allMethods) {
      const double way = glm::length(toVector(skinned(mesh, pose, method).positions[0]) - elbow);
      if (method == Method::quaternionTranslation) {
        // Turned about the origin by φ and shifted by 0.625 t.
        EXPECT_GT(way, 1e-3);
      } else if (!needsCentersOfRotation(method)) {
        EXPECT_LE(way, 1e-6) << methodName(method);
      }
    }
    mesh.centersOfRotation = mesh.positions;
    for (const Method method : {Method::centerOfRotation, Method::bulgeControlled})
      EXPECT_LE(glm::length(toVector(skinned(mesh, pose, method).positions[0]) - elbow), 1e-6);
  }
}

/// The volume of a bent tube whose centres of rotation lie on its axis. Sections turn by φ(w) as
/// with dual quaternions, their centres go where linear blending takes them; so that by the
/// determinant of that map, in which what is odd across a section cancels, the ratio is the
/// integral over w of d(center)/dz · Q e_z. By symmetry that is ∫ (3 − 4 w) cos φ(w).
double bentVolume(double angle) {
  const int steps = 100000;
  double sum = 0;
  for (int step = 0; step < steps; ++step) {
    const double w = (step + 0.5) / steps;
    const double turn = 2 * std::atan2(w * std::sin(angle / 2), 1 - w + w * std::cos(angle / 2));
    sum += (3 - 4 * w) * std::cos(turn) / steps;
  }
  return sum;
}

TEST(ReferenceTruths, Truth11_BendAboutCentersOfRotationOnTheAxis) {
  for (const double degrees : {45.0, 90.0, 120.0, 170.0}) {
    const JointMatrix bend = bendAt(0, degrees);
    const double volume = bentVolume(degrees * pi / 180);
    // Between linear blending's and 1.
    const double sine = std::sin(degrees * pi / 360);
    EXPECT_GT(volume, 1 - sine * sine / 3);
    EXPECT_LT(volume, 1);
    expectVolume(bend, Method::centerOfRotation, volume, 3);
    // In between by its strength, for the map's determinant is linear in where the center goes.
    for (const float strength : {0.0f, 0.25f, 0.5f, 1.0f}) {
      expectVolume(bend, Method::bulgeControlled, 1 - static_cast<double>(strength) * (1 - volume),
                   3, strength);
    }
  }
}

// ---- 12 and 13: the pivot

double angleOf(std::span<const JointMatrix> pose, std::initializer_list<RigInfluence> slots,
               Method method) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = static_cast<std::uint32_t>(slots.size());
  addVertex(mesh, {1, 0, 0}, slots);
  mesh.centersOfRotation = {0, 0, 0};
  mesh.dualQuaternionWeights = {1};
  const reference::Double3 p = skinned(mesh, pose, method).positions[0];
  const double angle = std::atan2(p[1], p[0]) * 180 / pi;
  return angle < -1e-4 ? angle + 360 : angle;
}

TEST(ReferenceTruths, Truth12_TheStrongestWithTheLowerJointIsThePivotWhateverTheMethod) {
  const std::array pose{turnAboutZ(0), turnAboutZ(170), turnAboutZ(-170)};
  const auto expectAngle = [&](Method method, double degrees) {
    for (const auto& slots :
         {std::initializer_list<RigInfluence>{{0, 0.1f}, {1, 0.45f}, {2, 0.45f}},
          {{2, 0.45f}, {1, 0.45f}, {0, 0.1f}}})
      EXPECT_NEAR(angleOf(pose, slots, method), degrees, 0.005) << methodName(method);
  };
  expectAngle(Method::dualQuaternion, 167.27);
  expectAngle(Method::blended, 167.27);
  for (const Method method : methodsThatTurnAlike) expectAngle(method, 167.27);
  // The order of the slots does not matter, the joint's index does.
  const std::array swapped{turnAboutZ(0), turnAboutZ(-170), turnAboutZ(170)};
  EXPECT_NEAR(angleOf(swapped, {{0, 0.1f}, {1, 0.45f}, {2, 0.45f}}, Method::dualQuaternion),
              360 - 167.27, 0.005);
  // −170° counts as 190°: a mean of angles, 0.1 · 0 + 0.45 · 170 + 0.45 · 190.
  expectAngle(Method::dualQuaternionIterative, 162);
  // It has no pivot: 0.45 · 170 − 0.45 · 170.
  expectAngle(Method::logMatrix, 0);
}

TEST(ReferenceTruths, Truth13_OnATieOfThreeTheLowestJointIsThePivotWhateverTheMethod) {
  const std::array pose{turnAboutZ(0), turnAboutZ(140), turnAboutZ(220)};
  const auto third = 1.0f / 3;
  const float more = std::nextafter(third, 1.0f);
  std::vector<Method> methods{Method::dualQuaternion, Method::blended};
  methods.insert(methods.end(), methodsThatTurnAlike.begin(), methodsThatTurnAlike.end());
  for (const Method method : methods) {
    EXPECT_NEAR(angleOf(pose, {{0, third}, {1, third}, {2, third}}, method), 0, 1e-4);
    EXPECT_NEAR(angleOf(pose, {{2, third}, {0, third}, {1, third}}, method), 0, 1e-4);
    EXPECT_NEAR(angleOf(pose, {{0, third}, {1, more}, {2, third}}, method), 123.97, 0.005)
        << methodName(method);
    EXPECT_NEAR(angleOf(pose, {{0, third}, {1, third}, {2, more}}, method), 236.03, 0.005)
        << methodName(method);
  }
  // The mean of 0, 140 and −140 about joint 0, of 0, 140 and 220 about joint 1, of 360 about 2.
  const Method iterative = Method::dualQuaternionIterative;
  EXPECT_NEAR(angleOf(pose, {{0, third}, {1, third}, {2, third}}, iterative), 0, 1e-4);
  EXPECT_NEAR(angleOf(pose, {{0, third}, {1, more}, {2, third}}, iterative), 120, 1e-3);
  EXPECT_NEAR(angleOf(pose, {{0, third}, {1, third}, {2, more}}, iterative), 240, 1e-3);
}

// ---- 16: linear blending in float32 against double

TEST(ReferenceTruths, Truth16_LinearBlendingInFloatIsWithin6UnitsOfRounding) {
  RigRandom random(13);
  const double unit = std::ldexp(1.0, -24);
  double worst = 0, sum = 0;
  int count = 0;
  for (int pass = 0; pass < 40; ++pass) {
    std::vector<JointMatrix> pose;
    const double reach = pass % 2 == 0 ? 1 : 10000;
    for (int joint = 0; joint < 20; ++joint)
      pose.push_back(jointOf(rotationAbout(random.direction(), random.between(-pi, pi)),
                             random.vector(reach)));
    OwnedMesh mesh = scatteredMesh(random, 1000, 20, 4);
    for (std::size_t i = 0; i < mesh.weights.size(); i += 4) {  // they sum to 1, exactly
      for (std::size_t slot = 0; slot < 4; ++slot)
        mesh.weights[i + slot] = static_cast<float>(1 + random.below(5000)) / 32768;
      mesh.weights[i] = 1 - mesh.weights[i + 1] - mesh.weights[i + 2] - mesh.weights[i + 3];
    }
    const reference::AnalyzedMesh expected = skinned(mesh, pose, Method::linear);
    for (std::size_t vertex = 0; vertex < 1000; ++vertex) {
      float result[3];
      for (std::size_t row = 0; row < 3; ++row) {
        float blended[4] = {0, 0, 0, 0};
        for (std::size_t slot = 0; slot < 4; ++slot) {
          const JointMatrix& joint = pose[mesh.joints[vertex * 4 + slot]];
          for (std::size_t column = 0; column < 4; ++column)
            blended[column] += mesh.weights[vertex * 4 + slot] * joint.m[row][column];
        }
        const float* p = &mesh.positions[vertex * 3];
        result[row] = blended[0] * p[0] + blended[1] * p[1] + blended[2] * p[2] + blended[3];
      }
      const double error = glm::length(glm::dvec3(result[0], result[1], result[2]) -
                                       toVector(expected.positions[vertex])) /
                           (unit * expected.conditioning[vertex].scale);
      worst = std::max(worst, error);
      sum += error;
      ++count;
    }
  }
  EXPECT_LE(worst, 6);
  EXPECT_LE(sum / count, 4);
  RecordProperty("worst", std::to_string(worst));
}

}  // namespace
}  // namespace dermis::test
