// Joints that scale, shear or mirror: C = R S, the S blended linearly in bind space, then the
// blended rigid part. Held against a second implementation that shares no algorithm with the
// reference.

#include <limits>

#include "by_hand.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

struct Skinned {
  glm::dvec3 position, normal;
  bool ambiguous = false;
};

/// Vertex `index` by the formulas of TRUTHS.md, with joints already taken apart.
Skinned skinByHand(const OwnedMesh& mesh, std::size_t index, std::span<const Parts> joints) {
  std::vector<double> weight(joints.size(), 0.0);
  double sum = 0;
  for (std::size_t slot = 0; slot < mesh.influencesPerVertex; ++slot) {
    const std::size_t entry = index * mesh.influencesPerVertex + slot;
    weight[mesh.joints[entry]] += static_cast<double>(mesh.weights[entry]);
    sum += static_cast<double>(mesh.weights[entry]);
  }
  std::size_t pivot = 0;
  for (std::size_t joint = 1; joint < joints.size(); ++joint) {
    if (weight[joint] > weight[pivot]) pivot = joint;
  }
  const Quaternion pivotQuaternion = quaternionOf(joints[pivot].rotation);

  Skinned result;
  Quaternion real{}, dual{};
  glm::dmat3 m(0.0);
  for (std::size_t joint = 0; joint < joints.size(); ++joint) {
    if (weight[joint] == 0) continue;
    const Quaternion q = quaternionOf(joints[joint].rotation);
    const glm::dvec3& t = joints[joint].translation;
    const Quaternion d = times({0, t.x / 2, t.y / 2, t.z / 2}, q);
    double dot = 0;
    for (std::size_t i = 0; i < 4; ++i) dot += q[i] * pivotQuaternion[i];
    result.ambiguous |= std::abs(dot) < 1e-5;
    for (std::size_t i = 0; i < 4; ++i) {
      real[i] += (dot < 0 ? -1 : 1) * weight[joint] / sum * q[i];
      dual[i] += (dot < 0 ? -1 : 1) * weight[joint] / sum * d[i];
    }
    m += weight[joint] / sum * joints[joint].scaleShear;
  }
  double square = 0;
  for (const double part : real) square += part * part;
  const Quaternion conjugate{real[0], -real[1], -real[2], -real[3]};
  const Quaternion t = times(dual, conjugate);
  const auto rotate = [&](const glm::dvec3& v) {
    const Quaternion turned = times(times(real, {0, v.x, v.y, v.z}), conjugate);
    return glm::dvec3(turned[1], turned[2], turned[3]) / square;
  };
  result.position =
      rotate(m * bindPosition(mesh, index)) + 2.0 / square * glm::dvec3(t[1], t[2], t[3]);
  // det(M) M⁻ᵀ is the adjugate transpose; its sign once gives M⁻ᵀ's direction.
  result.normal = glm::normalize(rotate(glm::transpose(glm::inverse(m)) * bindNormal(mesh, index)));
  return result;
}

/// The condition number decides how exact a normal can be in double.
void expectAsByHand(OwnedMesh& mesh, std::span<const JointMatrix> pose, double positionTolerance,
                    double normalTolerance) {
  std::vector<Parts> parts;
  for (const JointMatrix& joint : pose) parts.push_back(partsOf(joint));
  const reference::AnalyzedMesh result = skinned(mesh, pose, Method::dualQuaternion);
  std::size_t compared = 0;
  for (std::size_t vertex = 0; vertex < mesh.vertexCount(); ++vertex) {
    const Skinned expected = skinByHand(mesh, vertex, parts);
    if (expected.ambiguous) continue;
    expectNear(toVector(result.positions[vertex]), expected.position, positionTolerance);
    if (result.conditioning[vertex].normalAlignment < 1e-2) continue;
    expectNear(toVector(result.normals[vertex]), expected.normal, normalTolerance);
    ++compared;
  }
  EXPECT_GT(compared, mesh.vertexCount() * 3 / 4);
}

TEST(ReferenceTwoPhase, RigidJoints) {
  RigRandom random(1);
  std::vector<JointMatrix> pose;
  for (int joint = 0; joint < 20; ++joint)
    pose.push_back(jointOf(randomRotation(random), random.vector(2)));
  OwnedMesh mesh = scatteredMesh(random, 1000, 20, 4);
  expectAsByHand(mesh, pose, 1e-13, 1e-13);
}

TEST(ReferenceTwoPhase, ScaleAndShear) {
  RigRandom random(2);
  std::vector<JointMatrix> pose;
  for (int joint = 0; joint < 20; ++joint) {
    pose.push_back(
        jointOf(randomRotation(random) * randomSymmetric(random, 0.3, 3), random.vector(2)));
  }
  OwnedMesh mesh = scatteredMesh(random, 1000, 20, 4);
  expectAsByHand(mesh, pose, 1e-12, 1e-11);
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
  expectAsByHand(mesh, pose, 1e-11, 1e-9);
}

TEST(ReferenceTwoPhase, MirroredJointsOnly) {
  RigRandom random(4);
  std::vector<JointMatrix> pose;
  for (int joint = 0; joint < 20; ++joint) {
    pose.push_back(
        jointOf(randomRotation(random) * randomSymmetric(random, -2, -0.5), random.vector(2)));
  }
  OwnedMesh mesh = scatteredMesh(random, 1000, 20, 3);
  expectAsByHand(mesh, pose, 1e-12, 1e-11);
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

TEST(ReferenceTwoPhase, Truth19_AScaleOf100IsKeptWhereRigidPartsBlend) {
  RigRandom random(6);
  std::vector<JointMatrix> rigid, scaled;
  for (int joint = 0; joint < 10; ++joint) {
    const glm::dmat3 rotation = exactRotation(random);  // so that 100 R is stored exactly
    const glm::dvec3 translation = random.vector(2);
    rigid.push_back(jointOf(rotation, translation));
    scaled.push_back(jointOf(rotation * 100.0, translation));
  }
  OwnedMesh small = scatteredMesh(random, 300, 10, 4), large = small;
  for (float& coordinate : small.positions) coordinate = std::round(coordinate * 1024) / 1024;
  for (std::size_t i = 0; i < small.positions.size(); ++i)
    large.positions[i] = 100 * small.positions[i];
  const reference::AnalyzedMesh expected = skinned(large, rigid, Method::dualQuaternion);
  const reference::AnalyzedMesh result = skinned(small, scaled, Method::dualQuaternion);
  for (std::size_t vertex = 0; vertex < 300; ++vertex) {
    if (expected.conditioning[vertex].signAmbiguous) continue;
    expectNear(toVector(result.positions[vertex]), toVector(expected.positions[vertex]), 1e-12);
    expectNear(toVector(result.normals[vertex]), toVector(expected.normals[vertex]), 1e-13);
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
      const Skinned expected = skinByHand(mesh, vertex, parts);
      if (result.conditioning[vertex].signAmbiguous) continue;
      // The third axis follows from two that float32 rounds.
      expectNear(toVector(result.positions[vertex]), expected.position, 3e-6);
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
    std::vector<JointMatrix> pose;
    for (int joint = 0; joint < 5; ++joint) {
      pose.push_back(jointOf(randomRotation(random) * randomSymmetric(random, 0.5, 2) * scale,
                             random.vector(1) * scale));
    }
    OwnedMesh mesh = scatteredMesh(random, 200, 5, 3);
    expectAsByHand(mesh, pose, 1e-12 * scale, 1e-10);
  }
}

TEST(ReferenceTwoPhase, ANaNInOneJointStaysWithItsVertices) {
  RigRandom random(10);
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), infinity, -infinity}) {
    std::vector<JointMatrix> pose;
    for (int joint = 0; joint < 5; ++joint)
      pose.push_back(jointOf(randomRotation(random), random.vector(1)));
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
