// Morph targets in the reference: displacements added to the bind pose, before skinning.

#include <algorithm>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

#include "dermis/verify.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

constexpr double unitRoundoff = 1.0 / 16777216.0;  // 2^-24

/// Displacements of every vertex, or of those in `vertices`; empty arrays are absent attributes.
struct OwnedTarget {
  std::vector<std::uint32_t> vertices;
  std::vector<float> positions, normals, tangents;

  MorphTargetView view() const {
    MorphTargetView target;
    target.vertices = vertices;
    const auto attribute = [](const std::vector<float>& values) {
      return values.empty()
                 ? AttributeView{}
                 : attributeView(values.data(), static_cast<std::uint32_t>(values.size() / 3), 3);
    };
    target.positions = attribute(positions);
    target.normals = attribute(normals);
    target.tangents = attribute(tangents);
    return target;
  }
};

/// A number that float32 holds with room for exact sums and products.
float coarse(RigRandom& random) {
  return static_cast<float>(static_cast<int>(random.below(257)) - 128) / 64;
}

struct MorphTest : public ::testing::Test {
  static constexpr std::uint32_t count = 60;

  MorphTest() {
    for (int joint = 0; joint < 5; ++joint) {
      pose.push_back(jointOf(rotationAbout(random.direction(), random.between(-2, 2)) *
                                 diagonalMatrix(1, random.between(0.5, 2), 1),
                             random.vector(1)));
    }
    owned = scatteredMesh(random, count, 5, 3);
    for (float& value : owned.positions) value = coarse(random);
    for (float& value : owned.normals) value = coarse(random);
    for (std::uint32_t vertex = 0; vertex < count; ++vertex) {
      for (int i = 0; i < 3; ++i) tangents.push_back(coarse(random));
      tangents.push_back(vertex % 3 == 0 ? -1.0f : 1.0f);
    }
    // A dense target, a sparse one, one of positions alone, one of directions alone.
    targets.resize(4);
    for (OwnedTarget& target : targets) {
      for (auto* values : {&target.positions, &target.normals, &target.tangents}) {
        for (std::uint32_t i = 0; i < 3 * count; ++i) values->push_back(coarse(random));
      }
    }
    for (std::uint32_t vertex = 3; vertex < count; vertex += 7)
      targets[1].vertices.push_back(vertex);
    for (auto* values : {&targets[1].positions, &targets[1].normals, &targets[1].tangents}) {
      values->resize(3 * targets[1].vertices.size());
    }
    targets[2].normals.clear();
    targets[2].tangents.clear();
    targets[3].positions.clear();
  }

  MeshView view() {
    MeshView mesh = owned.view();
    mesh.tangents = attributeView(tangents.data(), count, 4);
    targetViews.clear();
    for (const OwnedTarget& target : targets) targetViews.push_back(target.view());
    mesh.morphTargets = targetViews;
    return mesh;
  }

  reference::AnalyzedMesh morphed(const MeshView& mesh, std::span<const MorphWeight> morphs,
                                  Method method) const {
    return skinned(mesh, pose, method, morphs);
  }

  /// The same mesh with the displacements added by hand; every sum is exact in float32.
  void displace(std::span<const MorphWeight> morphs) {
    for (const MorphWeight& morph : morphs) {
      const OwnedTarget& target = targets[morph.target];
      const auto add = [&](std::vector<float>& values, std::size_t stride,
                           const std::vector<float>& displacements) {
        for (std::size_t i = 0; i < displacements.size(); ++i) {
          const std::size_t vertex =
              target.vertices.empty() ? i / 3 : std::size_t{target.vertices[i / 3]};
          values[vertex * stride + i % 3] += morph.weight * displacements[i];
        }
      };
      add(owned.positions, 3, target.positions);
      add(owned.normals, 3, target.normals);
      add(tangents, 4, target.tangents);
    }
  }

  static void expectEqual(const reference::AnalyzedMesh& actual,
                          const reference::AnalyzedMesh& expected) {
    EXPECT_EQ(actual.positions, expected.positions);
    EXPECT_EQ(actual.normals, expected.normals);
    EXPECT_EQ(actual.tangents, expected.tangents);
  }

  RigRandom random{1};
  std::vector<JointMatrix> pose;
  OwnedMesh owned;
  std::vector<float> tangents;
  std::vector<OwnedTarget> targets;
  std::vector<MorphTargetView> targetViews;
};

TEST_F(MorphTest, SkinsWhatTheBindPoseWithDisplacementsIs) {
  const std::vector<std::vector<MorphWeight>> sets{{{0, 1.0f}},
                                                   {{1, 0.5f}},
                                                   {{2, -2.0f}},
                                                   {{3, 3.0f}},
                                                   {{0, 0.25f}, {1, -1.0f}, {2, 1.5f}, {3, 4.0f}}};
  for (const std::vector<MorphWeight>& morphs : sets) {
    for (const Method method : allMethods) {
      const reference::AnalyzedMesh result = morphed(view(), morphs, method);
      const OwnedMesh ownedBefore = owned;
      const std::vector<float> tangentsBefore = tangents;
      displace(morphs);
      const reference::AnalyzedMesh expected = morphed(view(), {}, method);
      expectEqual(result, expected);
      for (std::size_t vertex = 0; vertex < count; ++vertex) {
        const reference::Conditioning& a = result.conditioning[vertex];
        const reference::Conditioning& b = expected.conditioning[vertex];
        EXPECT_EQ(a.scale, b.scale);
        EXPECT_EQ(a.distance, b.distance);
        EXPECT_EQ(a.normalAlignment, b.normalAlignment);
        EXPECT_EQ(a.tangentAlignment, b.tangentAlignment);
      }
      owned = ownedBefore;
      tangents = tangentsBefore;
    }
  }
}

TEST_F(MorphTest, OnlyTheVerticesOfASparseTargetMove) {
  const std::array morphs{MorphWeight{1, 1.0f}};
  const reference::AnalyzedMesh before = morphed(view(), {}, Method::linear);
  const reference::AnalyzedMesh after = morphed(view(), morphs, Method::linear);
  for (std::uint32_t vertex = 0; vertex < count; ++vertex) {
    const auto& moved = targets[1].vertices;
    const bool moves = std::find(moved.begin(), moved.end(), vertex) != moved.end();
    EXPECT_EQ(after.positions[vertex] != before.positions[vertex], moves) << vertex;
    EXPECT_EQ(after.conditioning[vertex].positionRounding > 0, moves) << vertex;
  }
}

TEST_F(MorphTest, TheOrderOfWeightsDoesNotMatterInAnyBit) {
  std::vector<MorphWeight> morphs{{0, 0.1f}, {1, 0.7f}, {2, -0.3f}, {3, 1.9f}};
  const reference::AnalyzedMesh expected = morphed(view(), morphs, Method::dualQuaternion);
  const auto byTarget = [](const MorphWeight& a, const MorphWeight& b) {
    return a.target < b.target;
  };
  while (std::next_permutation(morphs.begin(), morphs.end(), byTarget)) {
    expectEqual(morphed(view(), morphs, Method::dualQuaternion), expected);
  }
}

TEST_F(MorphTest, AWeightOfZeroIsAsIfItWereNotThere) {
  const std::array some{MorphWeight{2, 0.5f}};
  const std::array more{MorphWeight{0, 0.0f}, MorphWeight{2, -0.0f}, MorphWeight{2, 0.5f},
                        MorphWeight{99, 0.0f}, MorphWeight{0, 0.0f}};
  const reference::AnalyzedMesh expected = morphed(view(), some, Method::linear);
  const reference::AnalyzedMesh result = morphed(view(), more, Method::linear);
  expectEqual(result, expected);
  for (std::size_t vertex = 0; vertex < count; ++vertex) {
    EXPECT_EQ(result.conditioning[vertex].positionRounding,
              expected.conditioning[vertex].positionRounding);
  }
}

TEST_F(MorphTest, RefusesTargetsThatAreNotThereTwiceOrWithoutANumber) {
  const auto refused = [&](std::vector<MorphWeight> morphs, std::string_view part) {
    const Result<reference::AnalyzedMesh> result =
        reference::analyze(view(), pose, Method::linear, morphs);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
  };
  refused({{4, 1.0f}}, "morph target 4 does not exist; the mesh has 4");
  refused({{0, 1.0f}, {0xffffffffu, 1.0f}}, "morph target 4294967295");
  refused({{2, 1.0f}, {1, 1.0f}, {2, 0.5f}}, "morph target 2 has two weights");
  refused({{1, std::numeric_limits<float>::quiet_NaN()}}, "not finite");
  refused({{1, -std::numeric_limits<float>::infinity()}}, "not finite");
  targets.clear();
  refused({{0, 1.0f}}, "does not exist; the mesh has 0");
}

TEST_F(MorphTest, WhatTheMeshLacksIsNotDisplaced) {
  const std::array morphs{MorphWeight{0, 1.0f}, MorphWeight{3, 1.0f}};
  MeshView bare = view();
  bare.normals = {};
  bare.tangents = {};
  const reference::AnalyzedMesh result = morphed(bare, morphs, Method::dualQuaternion);
  EXPECT_TRUE(result.normals.empty());
  EXPECT_TRUE(result.tangents.empty());
  EXPECT_EQ(result.positions, morphed(view(), morphs, Method::dualQuaternion).positions);
  EXPECT_EQ(result.conditioning[0].normalRounding, 0);
  EXPECT_EQ(result.conditioning[0].tangentRounding, 0);
}

TEST_F(MorphTest, AVertexWithoutWeightIsMorphedAllTheSame) {
  for (std::size_t slot = 0; slot < 3; ++slot) owned.weights[slot] = 0;
  const std::array morphs{MorphWeight{0, 2.0f}};
  const reference::AnalyzedMesh result = morphed(view(), morphs, Method::dualQuaternion);
  const OwnedTarget& target = targets[0];
  const auto displaced = [&](const std::vector<float>& bind, const std::vector<float>& d) {
    return glm::dvec3(bind[0], bind[1], bind[2]) + 2.0 * glm::dvec3(d[0], d[1], d[2]);
  };
  EXPECT_EQ(toVector(result.positions[0]), displaced(owned.positions, target.positions));
  expectNear(toVector(result.normals[0]), glm::normalize(displaced(owned.normals, target.normals)),
             1e-15);
  const reference::Double4& t = result.tangents[0];
  expectNear({t[0], t[1], t[2]}, glm::normalize(displaced(tangents, target.tangents)), 1e-15);
  EXPECT_EQ(t[3], -1) << "its handedness is as stored";
}

TEST_F(MorphTest, DisplacementsOfEveryFormat) {
  OwnedMesh one;
  addVertex(one, {1, 2, 3}, {});
  one.normals = {0, 0, 1};
  const float tangent[] = {1, 0, 0, 1};
  MeshView mesh = one.view();
  mesh.tangents = attributeView(tangent, 1, 4);
  mesh.positionScale = {1, 1, 1};
  const std::uint16_t halves[] = {0x3800, 0xc000, 0x3c00};  // 0.5, -2, 1
  const std::int16_t shorts[] = {32767, -32767, 0};
  const std::int8_t bytes[] = {127, 0, -128};
  MorphTargetView target;
  mesh.morphTargets = {&target, 1};
  const std::array morphs{MorphWeight{0, 2.0f}};

  target.positions = {halves, 1, 6, ComponentType::float16, 3};
  target.normals = {shorts, 1, 6, ComponentType::snorm16, 3};
  target.tangents = {bytes, 1, 3, ComponentType::snorm8, 3};
  target.positionScale = {2, 0.5f, -1};
  reference::AnalyzedMesh result = morphed(mesh, morphs, Method::linear);
  EXPECT_EQ(result.positions[0], (reference::Double3{3, 0, 1}));
  expectNear(toVector(result.normals[0]), glm::normalize(glm::dvec3(2, -2, 1)), 1e-15);
  const reference::Double4& t = result.tangents[0];
  expectNear({t[0], t[1], t[2]}, glm::normalize(glm::dvec3(3, 0, -2)), 1e-15);

  target.positions = {shorts, 1, 6, ComponentType::snorm16, 3};
  target.normals = {bytes, 1, 3, ComponentType::snorm8, 3};
  target.tangents = {halves, 1, 6, ComponentType::float16, 3};
  result = morphed(mesh, morphs, Method::linear);
  EXPECT_EQ(result.positions[0], (reference::Double3{5, 1, 3}));
  expectNear(toVector(result.normals[0]), glm::normalize(glm::dvec3(2, 0, -1)), 1e-15);
  const reference::Double4& other = result.tangents[0];
  expectNear({other[0], other[1], other[2]}, glm::normalize(glm::dvec3(2, -4, 2)), 1e-15);
}

TEST_F(MorphTest, RoundingsAreCountedForWhatIsDisplaced) {
  OwnedMesh one;
  addVertex(one, {3, 0, 4}, {});
  one.normals = {0, 0, 1};
  targets.assign(3, {});
  targets[0].positions = {0, 2, 0};
  targets[0].normals = {0, 0, -0.5f};
  targets[1].positions = {0, 0, 0};
  targets[1].normals = {0, 0, 0};
  targets[2].positions = {-6, 0, -8};
  targets[2].normals = {0, 0, 1};
  MeshView mesh = one.view();
  targetViews.clear();
  for (const OwnedTarget& target : targets) targetViews.push_back(target.view());
  mesh.morphTargets = targetViews;
  const auto conditioning = [&](std::vector<MorphWeight> morphs) {
    return morphed(mesh, morphs, Method::linear).conditioning[0];
  };
  EXPECT_EQ(conditioning({}).positionRounding, 0);
  // A displacement of nothing is no rounding: pack does not store it.
  EXPECT_EQ(conditioning({{1, 5.0f}}).positionRounding, 0);
  EXPECT_EQ(conditioning({{1, 5.0f}}).normalRounding, 0);
  EXPECT_DOUBLE_EQ(conditioning({{0, -3.0f}}).positionRounding, 2 * (5 + 6));
  EXPECT_DOUBLE_EQ(conditioning({{0, 1.0f}}).normalRounding, 2 * 1.5 / 0.5);
  EXPECT_DOUBLE_EQ(conditioning({{0, 1.0f}, {2, 0.5f}}).positionRounding, 4 * (5 + 2 + 5));
  // What cancels leaves the roundings behind.
  EXPECT_EQ(conditioning({{0, 2.0f}}).normalRounding, HUGE_VAL);
  EXPECT_DOUBLE_EQ(conditioning({{2, -0.5f}}).normalRounding, 2 * 1.5 / 0.5);
  // Displacements that are no float32 are rounded once more.
  const std::int16_t third[] = {0, 10922, 0};
  targetViews[0].positions = {third, 1, 6, ComponentType::snorm16, 3};
  mesh.morphTargets = targetViews;
  EXPECT_DOUBLE_EQ(conditioning({{0, 1.0f}}).positionRounding, 3 * (5 + 10922 / 32767.0));
}

/// As a kernel adds them: p += w d, each operation rounded, by rising targets.
std::vector<float> morphedInFloat(const std::vector<float>& bind,
                                  std::span<const OwnedTarget> targets,
                                  std::span<const MorphWeight> morphs,
                                  std::vector<float> OwnedTarget::*attribute) {
  std::vector<float> sum = bind;
  for (const MorphWeight& morph : morphs) {
    const std::vector<float>& displacements = targets[morph.target].*attribute;
    for (std::size_t i = 0; i < sum.size(); ++i) {
      const float product = morph.weight * displacements[i];
      sum[i] += product;
    }
  }
  return sum;
}

// Vertices far out whose displacements lead almost back to the origin: what is left was rounded
// where it was large, and the bound of skinning alone would not allow for it.
TEST_F(MorphTest, AFloatSumIsInsideTheBoundHoweverMuchCancels) {
  constexpr std::uint32_t many = 5000;
  OwnedMesh mesh;
  targets.assign(3, {});
  for (std::uint32_t vertex = 0; vertex < many; ++vertex) {
    const glm::dvec3 p = random.vector(100), n = random.direction();
    addVertex(mesh, p, {});
    for (int i = 0; i < 3; ++i) mesh.normals.push_back(static_cast<float>(n[i]));
    const double left = std::exp2(random.between(-12, 0));
    for (OwnedTarget& target : targets) {
      for (int i = 0; i < 3; ++i) {
        const double part = -(1 - left) / 3;
        target.positions.push_back(static_cast<float>(p[i] * part / 0.7));
        target.normals.push_back(static_cast<float>(n[i] * part / 0.7));
      }
    }
  }
  const std::array morphs{MorphWeight{0, 0.7f}, MorphWeight{1, 0.7f}, MorphWeight{2, 0.7f}};
  MeshView meshView = mesh.view();
  targetViews.clear();
  for (const OwnedTarget& target : targets) targetViews.push_back(target.view());
  meshView.morphTargets = targetViews;
  reference::AnalyzedMesh expected = morphed(meshView, morphs, Method::linear);

  const std::vector<float> positions =
      morphedInFloat(mesh.positions, targets, morphs, &OwnedTarget::positions);
  std::vector<float> normals = morphedInFloat(mesh.normals, targets, morphs, &OwnedTarget::normals);
  for (std::size_t vertex = 0; vertex < many; ++vertex) {
    float* n = &normals[3 * vertex];
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int i = 0; i < 3; ++i) n[i] /= length;
  }
  SkinnedView actual;
  actual.positions = {positions.data(), many, 12, VertexFormat::float32x3};
  actual.normals = {normals.data(), many, 12, VertexFormat::float32x3};
  const Result<Comparison> comparison = compareWithReference(expected, actual);
  ASSERT_TRUE(comparison.ok());
  EXPECT_TRUE(comparison->passed()) << comparison->failures;
  EXPECT_GT(comparison->worstPosition, 0.1);
  EXPECT_GT(comparison->worstNormal, 0.1);
  for (std::size_t vertex = 0; vertex < many; ++vertex) {
    reference::Conditioning conditioning = expected.conditioning[vertex];
    conditioning.positionRounding = conditioning.normalRounding = 0;
    expected.bounds[vertex] = boundsOf(Method::linear, conditioning);
  }
  EXPECT_GT(compareWithReference(expected, actual)->failures, many / 10);
  RecordProperty("position", std::to_string(comparison->worstPosition));
  RecordProperty("normal", std::to_string(comparison->worstNormal));
}

TEST_F(MorphTest, ALargeDisplacementIsStretchedByTheJoint) {
  OwnedMesh one;
  addVertex(one, {1, 0, 0}, {{0, 1.0f}});
  targets.assign(1, {});
  targets[0].positions = {1, 0, 0};
  MeshView mesh = one.view();
  targetViews.assign(1, targets[0].view());
  mesh.morphTargets = targetViews;
  pose = {jointOf(diagonalMatrix(2, 30, 1), {0, 7, 0})};
  const std::array morphs{MorphWeight{0, 1.0f}};
  const reference::AnalyzedMesh result = morphed(mesh, morphs, Method::linear);
  EXPECT_EQ(result.positions[0], (reference::Double3{4, 7, 0}));
  const reference::Conditioning& conditioning = result.conditioning[0];
  EXPECT_DOUBLE_EQ(conditioning.stretch, 30);
  EXPECT_DOUBLE_EQ(conditioning.scale, 7 + 30 * 2);
  EXPECT_DOUBLE_EQ(positionBound(Method::linear, conditioning),
                   6 * unitRoundoff * (7 + 30 * 2) + unitRoundoff * 30 * 2 * 2);
}

}  // namespace
}  // namespace dermis::test
