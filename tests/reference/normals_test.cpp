// Normals in the reference: inverse transpose, sign under a mirror, unit length, zero stays zero.

#include <algorithm>

#include "dermis/verify.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

/// One vertex with one normal.
OwnedMesh vertexWithNormal(const glm::dvec3& normal, std::initializer_list<RigInfluence> slots) {
  OwnedMesh mesh;
  addVertex(mesh, {0.3, -0.2, 0.9}, slots);
  for (int i = 0; i < 3; ++i) mesh.normals.push_back(static_cast<float>(normal[i]));
  return mesh;
}

TEST(ReferenceNormals, LinearTakesTheInverseTransposeOfTheBlendedMatrix) {
  RigRandom random(1);
  int compared = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const std::array pose{
        jointOf(glm::dmat3(random.vector(1), random.vector(1), random.vector(1))),
        jointOf(glm::dmat3(random.vector(1), random.vector(1), random.vector(1)))};
    OwnedMesh mesh = vertexWithNormal(random.direction(), {{0, 0.25f}, {1, 0.75f}});
    const glm::dmat3 blended = linearOf(pose[0]) * 0.25 + linearOf(pose[1]) * 0.75;
    if (std::abs(glm::determinant(blended)) < 0.02) continue;
    ++compared;
    // A tangent of the surface stays at a right angle to its normal: n' · (M x) = 0 where n · x =
    // 0.
    const reference::AnalyzedMesh result = skinned(mesh, pose, Method::linear);
    const glm::dvec3 n = bindNormal(mesh, 0), turned = toVector(result.normals[0]);
    expectNear(turned, glm::normalize(glm::transpose(glm::inverse(blended)) * n), 1e-11);
    const glm::dvec3 x = glm::cross(n, random.direction());
    EXPECT_NEAR(glm::dot(turned, blended * x), 0, 1e-14);
    // Its side: what lay before the surface lies before it still, mirrored or not.
    EXPECT_GT(glm::dot(turned, blended * n), 0);
    EXPECT_NEAR(glm::length(turned), 1, 1e-15);
  }
  EXPECT_GT(compared, 1000);
}

TEST(ReferenceNormals, AMirrorKeepsTheirSense) {
  // x ↦ −x: the wall at x = 1 that looks outwards is the wall at x = −1 that looks outwards.
  const std::array pose{jointOf(diagonalMatrix(-1, 1, 1))};
  OwnedMesh wall = vertexWithNormal({1, 0, 0}, {{0, 1.0f}});
  OwnedMesh side = vertexWithNormal({0, 1, 0}, {{0, 1.0f}});
  const std::array inversion{jointOf(glm::dmat3(-1.0))};
  for (const Method method : allMethods) {
    expectNear(toVector(skinned(wall, pose, method).normals[0]), {-1, 0, 0}, 1e-15);
    expectNear(toVector(skinned(side, pose, method).normals[0]), {0, 1, 0}, 1e-15);
    expectNear(toVector(skinned(wall, inversion, method).normals[0]), {-1, 0, 0}, 1e-15);
  }
}

TEST(ReferenceNormals, AZeroNormalStaysZero) {
  RigRandom random(4);
  const std::array pose{jointOf(glm::dmat3(random.vector(1), random.vector(1), random.vector(1))),
                        jointOf(rotationAbout(random.direction(), 1))};
  for (const Method method : allMethods) {
    OwnedMesh skinnedVertex = vertexWithNormal({0, 0, 0}, {{0, 0.5f}, {1, 0.5f}});
    OwnedMesh rigidVertex = vertexWithNormal({0, 0, 0}, {{1, 1.0f}});
    OwnedMesh freeVertex = vertexWithNormal({0, 0, 0}, {});
    for (OwnedMesh* mesh : {&skinnedVertex, &rigidVertex, &freeVertex}) {
      const reference::AnalyzedMesh result = skinned(*mesh, pose, method);
      EXPECT_EQ(result.normals[0], (reference::Double3{0, 0, 0}));
      EXPECT_EQ(result.conditioning[0].normalAlignment, 1) << "zero can be compared";
    }
  }
}

TEST(ReferenceNormals, AnyLengthComesOutAsOne) {
  RigRandom random(5);
  const std::array pose{jointOf(glm::dmat3(random.vector(1), random.vector(1), random.vector(1))),
                        jointOf(rotationAbout(random.direction(), 1))};
  for (const double length : {1e-30, 1e-6, 0.5, 3.0, 1e6, 1e30}) {
    for (const Method method : allMethods) {
      OwnedMesh mesh = vertexWithNormal(random.direction() * length, {{0, 0.5f}, {1, 0.5f}});
      OwnedMesh freeVertex = vertexWithNormal(random.direction() * length, {});
      EXPECT_NEAR(glm::length(toVector(skinned(mesh, pose, method).normals[0])), 1, 1e-15);
      EXPECT_NEAR(glm::length(toVector(skinned(freeVertex, pose, method).normals[0])), 1, 1e-15);
    }
  }
}

TEST(ReferenceNormals, AVertexWithoutWeightKeepsItsNormal) {
  const std::array pose{jointOf(rotationAbout({1, 2, 3}, 1), {1, 1, 1})};
  OwnedMesh mesh = vertexWithNormal({0, 0.6, 0.8}, {});
  for (const Method method : allMethods) {
    const reference::AnalyzedMesh result = skinned(mesh, pose, method);
    expectNear(toVector(result.normals[0]), glm::normalize(bindNormal(mesh, 0)), 1e-15);
    EXPECT_EQ(toVector(result.positions[0]), bindPosition(mesh, 0));
    EXPECT_NEAR(result.conditioning[0].scale, glm::length(bindPosition(mesh, 0)), 1e-15);
  }
}

TEST(ReferenceNormals, AMeshWithoutNormalsHasNone) {
  OwnedMesh mesh;
  addVertex(mesh, {1, 0, 0}, {{0, 1.0f}});
  const std::array pose{JointMatrix{}};
  EXPECT_TRUE(skinned(mesh, pose, Method::dualQuaternion).normals.empty());
}

TEST(ReferenceNormals, AlignmentIsTheCofactorsLengthOverTheLargestSingularValueSquared) {
  // M = diag(4, 2, 1): adjᵀ = diag(2, 4, 8).
  const std::array pose{jointOf(diagonalMatrix(4, 2, 1))};
  const struct {
    glm::dvec3 normal;
    double alignment;
  } cases[] = {{{1, 0, 0}, 2.0 / 16}, {{0, 1, 0}, 4.0 / 16}, {{0, 0, 3}, 8.0 / 16}};
  for (const auto& [normal, alignment] : cases) {
    OwnedMesh mesh = vertexWithNormal(normal, {{0, 1.0f}});
    for (const Method method : allMethods) {
      const reference::Conditioning conditioning = skinned(mesh, pose, method).conditioning[0];
      EXPECT_NEAR(conditioning.normalAlignment, alignment, 1e-15);
      EXPECT_FALSE(conditioning.normalRotatedOnly);
    }
  }
  const std::array rigid{jointOf(rotationAbout({1, 2, 3}, 1))};
  const std::array thin{jointOf(diagonalMatrix(1, 1, 1e-3))};
  OwnedMesh mesh = vertexWithNormal({0, 0, 1}, {{0, 1.0f}});
  EXPECT_NEAR(skinned(mesh, thin, Method::linear).conditioning[0].normalAlignment, 1, 1e-6);
  EXPECT_TRUE(skinned(mesh, rigid, Method::dualQuaternion).conditioning[0].normalRotatedOnly);
  EXPECT_FALSE(skinned(mesh, rigid, Method::linear).conditioning[0].normalRotatedOnly);
  EXPECT_NEAR(skinned(mesh, rigid, Method::linear).conditioning[0].normalAlignment, 1, 1e-6);
}

TEST(ReferenceNormals, AlignmentCountsWhatTheJointsCancel) {
  // M = 0.75 · 1 + 0.25 · half a turn about z = diag(0.5, 0.5, 1); adjᵀ = diag(0.5, 0.5, 0.25).
  const std::array turns{JointMatrix{}, jointOf(diagonalMatrix(-1, -1, 1)),
                         jointOf(diagonalMatrix(1, -1, -1)), jointOf(diagonalMatrix(-1, 1, -1))};
  OwnedMesh half = vertexWithNormal({0, 0, 1}, {{0, 0.75f}, {1, 0.25f}});
  EXPECT_NEAR(skinned(half, turns, Method::linear).conditioning[0].normalAlignment, 0.25, 1e-15);
  // 19/64 of no turn and 15/64 of each half turn leave M = 4/64 · 1, of joints of size 1.
  OwnedMesh little = vertexWithNormal({0, 0, 1}, {{0, 19}, {1, 15}, {2, 15}, {3, 15}});
  const double left = 4.0 / 64;
  EXPECT_NEAR(skinned(little, turns, Method::linear).conditioning[0].normalAlignment, left, 1e-15);
}

/// Linear blending by equal weights as a kernel does it: each operation rounded to float32.
std::array<float, 3> normalInFloat(std::span<const JointMatrix> pose, const float* bind) {
  glm::vec3 rows[3] = {};
  for (const JointMatrix& joint : pose) {
    for (int row = 0; row < 3; ++row) {
      const auto& entries = joint.m[row];
      rows[row] += 0.25f * glm::vec3(entries[0], entries[1], entries[2]);
    }
  }
  const glm::vec3 n(bind[0], bind[1], bind[2]);
  const glm::vec3 first = glm::cross(rows[1], rows[2]);
  glm::vec3 turned(glm::dot(first, n), glm::dot(glm::cross(rows[2], rows[0]), n),
                   glm::dot(glm::cross(rows[0], rows[1]), n));
  if (glm::dot(rows[0], first) < 0) turned = -turned;
  turned /= glm::length(turned);
  return {turned.x, turned.y, turned.z};
}

// Half turns about three axes and none, nearly: what is left of their sum is a small M whose
// entries are no more exact than those of its joints.
TEST(ReferenceNormals, AFloatKernelIsInsideTheBoundWhereJointsCancel) {
  RigRandom random(11);
  int compared = 0;
  double worst = 0;
  for (int rig = 0; rig < 4000; ++rig) {
    const glm::dmat3 base = rotationAbout(random.direction(), random.between(0, pi));
    const double apart = std::exp2(random.between(-8, 0));
    std::vector<JointMatrix> pose;
    for (const glm::dmat3& turn : {glm::dmat3(1.0), diagonalMatrix(1, -1, -1),
                                   diagonalMatrix(-1, 1, -1), diagonalMatrix(-1, -1, 1)}) {
      const glm::dmat3 astray = rotationAbout(random.direction(), apart * random.between(0, 1));
      pose.push_back(jointOf(astray * turn * base));
    }
    OwnedMesh mesh =
        vertexWithNormal(random.direction(), {{0, 1.0f}, {1, 1.0f}, {2, 1.0f}, {3, 1.0f}});
    const reference::AnalyzedMesh expected = skinned(mesh, pose, Method::linear);
    const double bound = expected.bounds[0].normal;
    if (bound < 0) continue;
    ++compared;
    const std::array<float, 3> n = normalInFloat(pose, mesh.normals.data());
    const glm::dvec3 error = glm::dvec3(n[0], n[1], n[2]) - toVector(expected.normals[0]);
    worst = std::max(worst, glm::length(error) / bound);
  }
  EXPECT_LE(worst, 1);
  EXPECT_GT(compared, 2000);
}

// Flattened along it, a normal keeps its line, but not a side that could be compared.
TEST(ReferenceNormals, AFlattenedJointLeavesTheSideOpen) {
  OwnedMesh mesh = vertexWithNormal({0, 0, 1}, {{0, 1.0f}});
  for (const double thickness : {0.0, 1e-7, -1e-7}) {
    const std::array flat{jointOf(diagonalMatrix(1, 1, thickness))};
    for (const Method method : allMethods) {
      const reference::AnalyzedMesh result = skinned(mesh, flat, method);
      EXPECT_LT(result.conditioning[0].normalAlignment, 1e-3);
      EXPECT_NEAR(std::abs(result.normals[0][2]), 1, 1e-12);
    }
  }
}

}  // namespace
}  // namespace dermis::test
