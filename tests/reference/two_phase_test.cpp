// Joints that scale, shear or mirror: C = R S, the S blended linearly in bind space, then the
// blended rigid part. Held against a second implementation that shares no algorithm with the
// reference.

#include <limits>

#include "by_hand.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

TEST(ReferenceTwoPhase, DualQuaternionsAreTheirFormula) {
  RigRandom random(1);
  for (const Joints kind : allJoints) {
    SCOPED_TRACE(testing::Message() << "joints of kind " << static_cast<int>(kind));
    const std::vector<JointMatrix> pose = randomJoints(random, kind, 20);
    OwnedMesh mesh = scatteredMesh(random, 1000, 20, 4);
    const Tolerance tolerance =
        kind == Joints::rigid ? Tolerance(1e-13, 1e-13) : Tolerance(1e-12, 1e-11);
    expectFormula(mesh, pose, Method::dualQuaternion, tolerance, dualQuaternionsByHand);
  }
}

TEST(ReferenceTwoPhase, AnyAffineJointsMirroredOnesAmongThem) {
  RigRandom random(3);
  std::vector<JointMatrix> pose;
  int mirrored = 0;
  while (pose.size() < 20) {
    const glm::dmat3 linear(random.vector(2), random.vector(2), random.vector(2));
    if (std::abs(glm::determinant(linear)) < 0.3) continue;
    mirrored += glm::determinant(linear) < 0 ? 1 : 0;
    pose.push_back(jointOf(linear, random.vector(2)));
  }
  ASSERT_GT(mirrored, 4);
  ASSERT_LT(mirrored, 16);
  OwnedMesh mesh = scatteredMesh(random, 1000, 20, 4);
  expectFormula(mesh, pose, Method::dualQuaternion, {1e-11, 1e-9}, dualQuaternionsByHand);
}

// Mirrored and unmirrored joints in one vertex: S of opposite signs, which shrink it.
TEST(ReferenceTwoPhase, AMirrorAndItsOppositeMeetInTheMiddle) {
  const std::array pose{JointMatrix{}, jointOf(glm::dmat3(-1.0))};  // R = 1 for both
  OwnedMesh mesh;
  addVertex(mesh, {1, 2, 3}, {{0, 0.5f}, {1, 0.5f}});
  addVertex(mesh, {1, 2, 3}, {{0, 0.75f}, {1, 0.25f}});
  const reference::AnalyzedMesh result = skinned(mesh, pose, Method::dualQuaternion);
  expectNear(toVector(result.positions[0]), {0, 0, 0}, 1e-15);
  expectNear(toVector(result.positions[1]), {0.5, 1, 1.5}, 1e-15);
}

TEST(ReferenceTwoPhase, Truth19_OneInfluenceKeepsItsWholeMatrix) {
  RigRandom random(5);
  std::vector<JointMatrix> pose;
  std::vector<double> largest;
  for (int joint = 0; joint < 40; ++joint) {
    const glm::dmat3 rotation = randomRotation(random);
    const glm::dmat3 parts[] = {glm::dmat3(100.0),
                                glm::dmat3(0.01),
                                diagonalMatrix(1, 5, 0.25),
                                diagonalMatrix(-1, 1, 1),
                                randomSymmetric(random, 0.1, 10),
                                diagonalMatrix(1, 1, 0),
                                glm::dmat3(-2.0),
                                glm::dmat3(glm::dvec3(1, 0, 0), {0.7, 1, 0}, {0, 0, 1})};
    pose.push_back(jointOf(rotation * parts[joint % 8], random.vector(2)));
  }
  OwnedMesh mesh = scatteredMesh(random, 400, 40, 1);
  const reference::AnalyzedMesh dual = skinned(mesh, pose, Method::dualQuaternion);
  const reference::AnalyzedMesh linear = skinned(mesh, pose, Method::linear);
  for (std::size_t vertex = 0; vertex < 400; ++vertex) {
    expectNear(toVector(dual.positions[vertex]), toVector(linear.positions[vertex]), 1e-12);
    // The two turn a normal through the same matrix, C = R S.
    if (linear.conditioning[vertex].normalAlignment < 1e-2) continue;
    expectNear(toVector(dual.normals[vertex]), toVector(linear.normals[vertex]), 1e-12);
  }
}

// C = R S with a singular S: R is the rotation (det +1) of the two axes that are left.
TEST(ReferenceTwoPhase, RankTwo) {
  RigRandom random(7);
  for (int trial = 0; trial < 100; ++trial) {
    std::vector<JointMatrix> pose;
    std::vector<Parts> parts;
    for (int joint = 0; joint < 3; ++joint) {
      const glm::dmat3 frame = randomRotation(random), rotation = randomRotation(random);
      const glm::dmat3 flat = frame *
                              diagonalMatrix(random.between(0.5, 2), random.between(0.5, 2), 0) *
                              glm::transpose(frame);
      pose.push_back(jointOf(rotation * flat, random.vector(1)));
      parts.push_back({rotation, flat, offsetOf(pose.back())});
    }
    OwnedMesh mesh = scatteredMesh(random, 10, 3, 3);
    const reference::AnalyzedMesh result = skinned(mesh, pose, Method::dualQuaternion);
    for (std::size_t vertex = 0; vertex < 10; ++vertex) {
      const ByHand expected(mesh, vertex, pose, parts);
      if (result.conditioning[vertex].signAmbiguous) continue;
      // The third axis follows from two that float32 rounds.
      expectNear(toVector(result.positions[vertex]), expected.dualQuaternions(expected.position),
                 3e-6);
    }
  }
}

TEST(ReferenceTwoPhase, RankOneAndZeroAreFinite) {
  RigRandom random(8);
  const glm::dvec3 u = random.direction(), v = random.direction();
  const std::vector<JointMatrix> pose{jointOf(glm::dmat3(0.0), {1, 2, 3}),
                                      jointOf(glm::outerProduct(u, v)),
                                      jointOf(glm::outerProduct(u, v) * -3.0, {1, 0, 0}),
                                      jointOf(diagonalMatrix(1, 0, 0)),
                                      jointOf(diagonalMatrix(0, 0, -1)),
                                      jointOf(diagonalMatrix(1e-30, 0, 1e-38)),
                                      JointMatrix{}};
  OwnedMesh mesh = scatteredMesh(random, 500, 7, 3);
  for (const Method method : allMethods) {
    const reference::AnalyzedMesh result = skinned(mesh, pose, method);
    for (std::size_t vertex = 0; vertex < 500; ++vertex) {
      EXPECT_TRUE(isFiniteVector(result.positions[vertex])) << vertex;
      ASSERT_TRUE(isFiniteVector(result.normals[vertex])) << vertex;
      const double length = glm::length(toVector(result.normals[vertex]));
      EXPECT_TRUE(length == 0 || std::abs(length - 1) < 1e-14) << length;
    }
  }
  // What a joint of rank 0 does is known all the same.
  OwnedMesh point;
  addVertex(point, {4, 5, 6}, {{0, 1.0f}});
  const reference::AnalyzedMesh result = skinned(point, pose, Method::dualQuaternion);
  expectNear(toVector(result.positions[0]), {1, 2, 3}, 1e-15);
  EXPECT_TRUE(result.conditioning[0].degenerate);
}

TEST(ReferenceTwoPhase, VerySmallAndVeryLargeScales) {
  RigRandom random(9);
  for (const double scale : {1e-20, 1e-12, 1e-6, 1e6, 1e12, 1e18}) {
    const std::vector<JointMatrix> pose = poseOf(5, [&] {
      return jointOf(randomRotation(random) * randomSymmetric(random, 0.5, 2) * scale,
                     random.vector(1) * scale);
    });
    OwnedMesh mesh = scatteredMesh(random, 200, 5, 3);
    expectFormula(mesh, pose, Method::dualQuaternion, {1e-12 * scale, 1e-10},
                  dualQuaternionsByHand);
  }
}

TEST(ReferenceTwoPhase, ANaNInOneJointStaysWithItsVertices) {
  RigRandom random(10);
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), infinity, -infinity}) {
    const std::vector<JointMatrix> pose =
        poseOf(5, [&] { return jointOf(randomRotation(random), random.vector(1)); });
    OwnedMesh mesh = scatteredMesh(random, 100, 5, 2);
    for (const Method method : allMethods) {
      const reference::AnalyzedMesh before = skinned(mesh, pose, method);
      std::vector<JointMatrix> damaged = pose;
      damaged[3].m[1][2] = bad;
      const reference::AnalyzedMesh after = skinned(mesh, damaged, method);
      for (std::size_t vertex = 0; vertex < 100; ++vertex) {
        const bool touched = mesh.joints[2 * vertex] == 3 || mesh.joints[2 * vertex + 1] == 3;
        if (touched) {
          EXPECT_FALSE(isFiniteVector(after.positions[vertex]));
          EXPECT_TRUE(after.conditioning[vertex].degenerate);
        } else {
          EXPECT_EQ(after.positions[vertex], before.positions[vertex]);
          EXPECT_EQ(after.normals[vertex], before.normals[vertex]);
        }
      }
    }
  }
}

}  // namespace
}  // namespace dermis::test
