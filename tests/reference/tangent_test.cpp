// Tangents in the reference: by the map of positions, of unit length, not made orthogonal; their
// handedness by the sign of the blended determinant.

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "dermis/verify.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

/// A mesh whose vertices have tangents.
struct TangentMesh {
  OwnedMesh mesh;
  std::vector<float> tangents;

  void add(const glm::dvec3& position, const glm::dvec3& tangent, float handedness,
           std::initializer_list<RigInfluence> slots) {
    addVertex(mesh, position, slots);
    for (int i = 0; i < 3; ++i) tangents.push_back(static_cast<float>(tangent[i]));
    tangents.push_back(handedness);
  }
  MeshView view() {
    MeshView view = mesh.view();
    view.tangents = attributeView(tangents.data(), mesh.vertexCount(), 4);
    return view;
  }
  reference::AnalyzedMesh skinned(std::span<const JointMatrix> pose, Method method) {
    return test::skinned(view(), pose, method);
  }
  glm::dvec3 bind(std::size_t vertex) const {
    return {tangents[4 * vertex], tangents[4 * vertex + 1], tangents[4 * vertex + 2]};
  }
};

TangentMesh vertexWithTangent(const glm::dvec3& tangent, std::initializer_list<RigInfluence> slots,
                              float handedness = 1) {
  TangentMesh mesh;
  mesh.add({0.3, -0.2, 0.9}, tangent, handedness, slots);
  return mesh;
}

glm::dvec3 direction(const reference::Double4& tangent) {
  return {tangent[0], tangent[1], tangent[2]};
}

glm::dmat3 randomMatrix(RigRandom& random) {
  return glm::dmat3(random.vector(1), random.vector(1), random.vector(1));
}

// Two points that lie a tangent apart move to points that lie the skinned tangent apart: the map is
// affine where the weights, and the centres of rotation, are equal. In `blended` too, but there the
// directions are a mean of two unit vectors (below).
TEST(ReferenceTangents, GoAsThePointsOfASurfaceGo) {
  RigRandom random(2);
  for (const bool scales : {false, true}) {
    for (int trial = 0; trial < 300; ++trial) {
      std::vector<JointMatrix> pose;
      for (int joint = 0; joint < 3; ++joint) {
        const glm::dmat3 scale = scales ? randomMatrix(random) : glm::dmat3(1.0);
        pose.push_back(jointOf(exactRotation(random) * scale, random.vector(1)));
      }
      const glm::dvec3 t(glm::vec3(random.direction()));
      TangentMesh mesh;
      for (const glm::dvec3& p : {glm::dvec3(0.0), t}) {
        mesh.add(p, t, 1, {{0, 0.5f}, {1, 0.3f}, {2, 0.2f}});
      }
      mesh.mesh.centersOfRotation = {0.25f, -0.5f, 0.75f, 0.25f, -0.5f, 0.75f};
      for (const Method method : allMethods) {
        if (method == Method::blended) continue;
        const reference::AnalyzedMesh result = mesh.skinned(pose, method);
        const glm::dvec3 apart = toVector(result.positions[1]) - toVector(result.positions[0]);
        if (glm::length(apart) < 1e-3) continue;
        expectNear(direction(result.tangents[0]), glm::normalize(apart), 1e-11);
      }
    }
  }
}

TEST(ReferenceTangents, OfBlendedAreTheMeanOfBothMadeUnit) {
  RigRandom random(22);
  for (int trial = 0; trial < 300; ++trial) {
    const std::vector<JointMatrix> pose{
        jointOf(exactRotation(random) * randomMatrix(random), random.vector(1)),
        jointOf(exactRotation(random) * randomMatrix(random), random.vector(1))};
    TangentMesh mesh = vertexWithTangent(random.direction(), {{0, 0.375f}, {1, 0.625f}});
    const auto share = static_cast<float>(random.between(0, 1));
    mesh.mesh.dualQuaternionWeights = {share};
    const glm::dvec3 linear = direction(mesh.skinned(pose, Method::linear).tangents[0]);
    const glm::dvec3 dual = direction(mesh.skinned(pose, Method::dualQuaternion).tangents[0]);
    const glm::dvec3 mean =
        (1 - static_cast<double>(share)) * linear + static_cast<double>(share) * dual;
    if (glm::length(mean) < 1e-3) continue;
    expectNear(direction(mesh.skinned(pose, Method::blended).tangents[0]), glm::normalize(mean),
               1e-12);
  }
}

TEST(ReferenceTangents, StayInTheSurfaceButAreNotMadeOrthogonalToWhatIsNot) {
  const std::array shear{jointOf(glm::dmat3(glm::dvec3(1, 0, 0), {0.5, 1, 0}, {0, 0, 1}))};
  for (const Method method : allMethods) {
    TangentMesh mesh = vertexWithTangent({1, 0, 0}, {{0, 1.0f}});
    mesh.mesh.normals = {0, 1, 0};
    const reference::AnalyzedMesh inside = mesh.skinned(shear, method);
    EXPECT_NEAR(glm::dot(toVector(inside.normals[0]), direction(inside.tangents[0])), 0, 1e-15);
    // A tangent that leans out of its surface goes on leaning.
    mesh.tangents = {1, 1, 0, 1};
    const reference::AnalyzedMesh leaning = mesh.skinned(shear, method);
    expectNear(direction(leaning.tangents[0]), glm::normalize(glm::dvec3(1.5, 1, 0)), 1e-14);
    EXPECT_GT(glm::dot(toVector(leaning.normals[0]), direction(leaning.tangents[0])), 0.1);
  }
}

TEST(ReferenceTangents, HandednessIsOneOrMinusOneByItsSign) {
  const std::array pose{JointMatrix{}};
  for (const Method method : allMethods) {
    for (const bool weighted : {true, false}) {
      TangentMesh mesh;
      for (const float w : {1.0f, -1.0f, 0.0f, -0.0f, 0.25f, -1e-30f, 7.0f}) {
        mesh.add({1, 2, 3}, {1, 0, 0}, w, {{0, weighted ? 1.0f : 0.0f}});
      }
      std::vector<double> signs;
      for (const reference::Double4& t : mesh.skinned(pose, method).tangents) signs.push_back(t[3]);
      EXPECT_EQ(signs, (std::vector<double>{1, -1, 1, 1, 1, -1, 1}));
    }
  }
}

TEST(ReferenceTangents, AMirrorTurnsTheHandednessOver) {
  const std::array pose{jointOf(diagonalMatrix(-1, 1, 1)), jointOf(glm::dmat3(-2.0)),
                        jointOf(diagonalMatrix(-1, -1, 1)), JointMatrix{}};
  for (const Method method : allMethods) {
    for (const float handedness : {1.0f, -1.0f}) {
      TangentMesh mesh;
      for (std::uint32_t joint = 0; joint < 4; ++joint) {
        mesh.add({1, 2, 3}, {0.6, 0.8, 0}, handedness, {{joint, 1.0f}});
      }
      const reference::AnalyzedMesh result = mesh.skinned(pose, method);
      const double w = static_cast<double>(handedness);
      EXPECT_EQ(result.tangents[0][3], -w);
      EXPECT_EQ(result.tangents[1][3], -w);
      EXPECT_EQ(result.tangents[2][3], w) << "half a turn";
      EXPECT_EQ(result.tangents[3][3], w);
      expectNear(direction(result.tangents[0]), {-0.6, 0.8, 0}, 1e-7);
      expectNear(direction(result.tangents[1]), {-0.6, -0.8, 0}, 1e-7);
    }
  }
}

// The determinant is that of what is blended: of the matrices, or in two phases of their S.
TEST(ReferenceTangents, WhereMirrorsMixTheBlendDecides) {
  const std::array pose{JointMatrix{}, jointOf(glm::dmat3(-1.0))};
  for (const Method method : allMethods) {
    TangentMesh mesh;
    for (const float mirrored : {0.25f, 0.4375f, 0.5625f, 0.75f}) {
      mesh.add({1, 2, 3}, {1, 0, 0}, 1, {{0, 1 - mirrored}, {1, mirrored}});
    }
    const reference::AnalyzedMesh result = mesh.skinned(pose, method);
    EXPECT_EQ(result.tangents[0], (reference::Double4{1, 0, 0, 1}));
    EXPECT_EQ(result.tangents[1], (reference::Double4{1, 0, 0, 1}));
    EXPECT_EQ(result.tangents[2], (reference::Double4{-1, 0, 0, -1}));
    EXPECT_EQ(result.tangents[3], (reference::Double4{-1, 0, 0, -1}));
    for (const reference::Conditioning& conditioning : result.conditioning) {
      EXPECT_FALSE(conditioning.handednessAmbiguous);
    }
  }
  // Linear blending of opposite half turns mirrors: diag(-0.5, -0.5, -0.5) for equal weights of
  // half turns about all axes has det < 0, and dual quaternions only turn.
  const std::array turns{jointOf(diagonalMatrix(1, -1, -1)), jointOf(diagonalMatrix(-1, 1, -1)),
                         jointOf(diagonalMatrix(-1, -1, 1))};
  TangentMesh mesh = vertexWithTangent({1, 0, 0}, {{0, 0.3125f}, {1, 0.34375f}, {2, 0.34375f}});
  EXPECT_EQ(mesh.skinned(turns, Method::linear).tangents[0][3], -1);
  EXPECT_EQ(mesh.skinned(turns, Method::dualQuaternion).tangents[0][3], 1);
}

TEST(ReferenceTangents, OneThatVanishesKeepsItsBindDirection) {
  const std::array pose{jointOf(diagonalMatrix(0, 1, 1))};
  TangentMesh mesh = vertexWithTangent({2, 0, 0}, {{0, 1.0f}}, -1);
  for (const Method method : allMethods) {
    const reference::AnalyzedMesh result = mesh.skinned(pose, method);
    EXPECT_NEAR(std::abs(result.tangents[0][0]), 1, 1e-15);
    EXPECT_EQ(result.conditioning[0].tangentAlignment, 0);
    EXPECT_TRUE(result.conditioning[0].handednessAmbiguous);
    EXPECT_EQ(std::abs(result.tangents[0][3]), 1);
  }
  EXPECT_EQ(mesh.skinned(pose, Method::linear).tangents[0][0], 1);
}

TEST(ReferenceTangents, AZeroTangentStaysZeroAndHasItsHandedness) {
  RigRandom random(4);
  const std::array pose{jointOf(randomMatrix(random)), jointOf(glm::dmat3(-1.0))};
  for (const Method method : allMethods) {
    TangentMesh mesh;
    mesh.add({1, 2, 3}, {0, 0, 0}, -1, {{0, 0.5f}, {1, 0.5f}});
    mesh.add({1, 2, 3}, {0, 0, 0}, -1, {{1, 1.0f}});
    mesh.add({1, 2, 3}, {0, 0, 0}, -1, {});
    const reference::AnalyzedMesh result = mesh.skinned(pose, method);
    for (std::size_t vertex = 0; vertex < 3; ++vertex) {
      EXPECT_EQ(direction(result.tangents[vertex]), glm::dvec3(0.0));
      EXPECT_EQ(result.conditioning[vertex].tangentAlignment, 1) << "zero can be compared";
    }
    EXPECT_EQ(result.tangents[1][3], 1);
    EXPECT_EQ(result.tangents[2][3], -1);
  }
}

TEST(ReferenceTangents, AnyLengthComesOutAsOne) {
  RigRandom random(5);
  const std::array pose{jointOf(randomMatrix(random)),
                        jointOf(rotationAbout(random.direction(), 1))};
  for (const double length : {1e-30, 1e-6, 0.5, 3.0, 1e6, 1e30}) {
    for (const Method method : allMethods) {
      TangentMesh mesh;
      const glm::dvec3 t = random.direction() * length;
      mesh.add({1, 2, 3}, t, 1, {{0, 0.5f}, {1, 0.5f}});
      mesh.add({1, 2, 3}, t, 1, {});
      const reference::AnalyzedMesh result = mesh.skinned(pose, method);
      EXPECT_NEAR(glm::length(direction(result.tangents[0])), 1, 1e-15);
      expectNear(direction(result.tangents[1]), glm::normalize(mesh.bind(1)), 1e-15);
    }
  }
}

TEST(ReferenceTangents, AMeshWithoutTangentsHasNone) {
  OwnedMesh mesh;
  addVertex(mesh, {1, 0, 0}, {{0, 1.0f}});
  const std::array pose{JointMatrix{}};
  EXPECT_TRUE(skinned(mesh, pose, Method::linear).tangents.empty());
}

TEST(ReferenceTangents, AlignmentIsTheirLengthOverWhatTheJointsMayStretch) {
  const std::array pose{jointOf(diagonalMatrix(4, 2, 1)), jointOf(diagonalMatrix(8, 0, 0))};
  const struct {
    glm::dvec3 tangent;
    double alignment;
  } cases[] = {{{1, 0, 0}, 1}, {{0, 1, 0}, 0.5}, {{0, 0, 3}, 0.25}};
  for (const auto& [tangent, alignment] : cases) {
    TangentMesh mesh = vertexWithTangent(tangent, {{0, 1.0f}});
    for (const Method method : allMethods) {
      EXPECT_NEAR(mesh.skinned(pose, method).conditioning[0].tangentAlignment, alignment, 1e-15);
    }
  }
  // The largest singular value of the joints counts, not that of the blend: (0.5, 0.5) halves y.
  TangentMesh mesh = vertexWithTangent({0, 1, 0}, {{0, 0.5f}, {1, 0.5f}});
  EXPECT_NEAR(mesh.skinned(pose, Method::linear).conditioning[0].tangentAlignment, 1 / 8.0, 1e-15);
}

TEST(ReferenceTangents, ADeterminantNearZeroLeavesTheHandednessOpen) {
  for (const double thickness : {0.0, 1e-7, -1e-7, 9e-6, 1.1e-5, -1.1e-5, 0.1}) {
    const std::array flat{jointOf(diagonalMatrix(1, 1, thickness))};
    TangentMesh mesh = vertexWithTangent({1, 0, 0}, {{0, 1.0f}});
    for (const Method method : allMethods) {
      const reference::AnalyzedMesh result = mesh.skinned(flat, method);
      EXPECT_EQ(result.conditioning[0].handednessAmbiguous, std::abs(thickness) < 1e-5);
      if (std::abs(thickness) < 1e-5) continue;
      EXPECT_EQ(result.tangents[0][3], thickness < 0 ? -1 : 1);
    }
  }
  // Opposite turns cancel in a linear blend: of the joints' size, its determinant is nothing.
  const std::array opposite{JointMatrix{}, jointOf(diagonalMatrix(-1, -1, 1))};
  TangentMesh mesh = vertexWithTangent({0, 0, 1}, {{0, 0.5f}, {1, 0.5f}});
  EXPECT_TRUE(mesh.skinned(opposite, Method::linear).conditioning[0].handednessAmbiguous);
  EXPECT_FALSE(mesh.skinned(opposite, Method::dualQuaternion).conditioning[0].handednessAmbiguous);
}

TEST(ReferenceTangents, ANaNInOneJointStaysWithItsVertices) {
  RigRandom random(6);
  std::array pose{jointOf(randomMatrix(random)), jointOf(randomMatrix(random))};
  TangentMesh mesh;
  mesh.add({1, 2, 3}, {1, 0, 0}, 1, {{0, 1.0f}});
  mesh.add({1, 2, 3}, {1, 0, 0}, 1, {{1, 1.0f}});
  for (const Method method : allMethods) {
    const reference::AnalyzedMesh before = mesh.skinned(pose, method);
    const float kept = pose[1].m[0][0];
    pose[1].m[0][0] = std::numeric_limits<float>::quiet_NaN();
    const reference::AnalyzedMesh after = mesh.skinned(pose, method);
    EXPECT_EQ(after.tangents[0], before.tangents[0]);
    EXPECT_FALSE(isFiniteVector(after.positions[1]));
    pose[1].m[0][0] = kept;
  }
}

/// Linear blending as a kernel does it: each operation rounded to float32.
void skinTangentInFloat(std::span<const JointMatrix> pose, std::span<const float> weights,
                        const float* bind, float* tangent) {
  float sum = 0;
  for (const float weight : weights) sum += weight;
  float skinned[3];
  for (int row = 0; row < 3; ++row) {
    float entry[3] = {0, 0, 0};
    for (std::size_t joint = 0; joint < pose.size(); ++joint) {
      const float weight = weights[joint] / sum;
      for (int column = 0; column < 3; ++column)
        entry[column] += weight * pose[joint].m[row][column];
    }
    skinned[row] = entry[0] * bind[0] + entry[1] * bind[1] + entry[2] * bind[2];
  }
  const float length =
      std::sqrt(skinned[0] * skinned[0] + skinned[1] * skinned[1] + skinned[2] * skinned[2]);
  for (int i = 0; i < 3; ++i) tangent[i] = skinned[i] / length;
}

// From rigs of one mind to rotations that cancel nearly all of the tangent.
TEST(ReferenceTangents, AFloatKernelIsInsideTheBound) {
  RigRandom random(7);
  double worst = 0;
  for (int rig = 0; rig < 2000; ++rig) {
    const glm::dvec3 axis = random.direction();
    const std::array pose{jointOf(rotationAbout(axis, 0.0)),
                          jointOf(rotationAbout(random.direction(), random.between(0, pi))),
                          jointOf(rotationAbout(axis, random.between(2.5, pi)))};
    TangentMesh mesh;
    std::vector<float> expectedInFloat;
    for (int vertex = 0; vertex < 20; ++vertex) {
      const float middle = rig % 2 == 0 ? 0 : static_cast<float>(random.between(0, 1));
      const float last = vertex % 2 == 0 ? 1 : static_cast<float>(random.between(0.9, 1.1));
      const float weights[] = {1, middle, last};
      mesh.add({0, 0, 0}, random.direction(), 1, {{0, 1.0f}, {1, middle}, {2, last}});
      float tangent[4] = {0, 0, 0, 1};
      skinTangentInFloat(pose, weights, &mesh.tangents[mesh.tangents.size() - 4], tangent);
      expectedInFloat.insert(expectedInFloat.end(), tangent, tangent + 4);
    }
    reference::AnalyzedMesh expected = mesh.skinned(pose, Method::linear);
    for (std::size_t vertex = 0; vertex < 20; ++vertex) {
      // The handedness is not computed here.
      expectedInFloat[4 * vertex + 3] = static_cast<float>(expected.tangents[vertex][3]);
    }
    SkinnedView actual;
    actual.positions = {mesh.mesh.positions.data(), 20, 12, VertexFormat::float32x3};
    actual.tangents = {expectedInFloat.data(), 20, 16, VertexFormat::float32x4};
    const Result<Comparison> comparison = compareWithReference(expected, actual);
    ASSERT_TRUE(comparison.ok());
    EXPECT_TRUE(comparison->passed()) << rig << ": " << comparison->worstTangent;
    worst = std::max(worst, comparison->worstTangent);
  }
  RecordProperty("worst", std::to_string(worst));
  EXPECT_GT(worst, 0.2);
}

}  // namespace
}  // namespace dermis::test
