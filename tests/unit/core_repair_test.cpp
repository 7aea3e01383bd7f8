// repair: what it drops, what it keeps, and that the result stands on its own.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "dermis/mesh.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

template <typename T>
T valueAt(const AttributeView& view, std::uint32_t vertex, std::uint32_t component) {
  T value;
  std::memcpy(&value,
              static_cast<const unsigned char*>(view.data) + std::size_t{vertex} * view.stride +
                  component * sizeof(T),
              sizeof(T));
  return value;
}

using Vector = std::array<float, 3>;
constexpr Vector zero{0, 0, 0};

Vector vectorAt(const AttributeView& view, std::uint32_t vertex) {
  return {valueAt<float>(view, vertex, 0), valueAt<float>(view, vertex, 1),
          valueAt<float>(view, vertex, 2)};
}
Vector vectorAt(const std::vector<float>& values, std::uint32_t vertex) {
  return {values[vertex * 3], values[vertex * 3 + 1], values[vertex * 3 + 2]};
}

OwnedMesh goodMesh() {
  OwnedMesh mesh;
  mesh.name = "a mesh with a name that is too long for the small-string buffer";
  for (std::uint32_t vertex = 0; vertex < 6; ++vertex) {
    for (std::uint32_t i = 0; i < 3; ++i)
      mesh.positions.push_back(static_cast<float>(vertex * 10 + i));
    const auto angle = static_cast<float>(vertex);
    mesh.normals.insert(mesh.normals.end(), {0.0f, std::sin(angle), std::cos(angle)});
    mesh.joints.insert(mesh.joints.end(), {vertex, 7, 6, 9});
    mesh.weights.insert(mesh.weights.end(), {0.5f, 0.25f, 0.25f, 1e-30f});
  }
  return mesh;
}

RepairedMesh repaired(const MeshView& mesh, std::uint32_t jointCount) {
  Result<RepairedMesh> result = repair(mesh, jointCount);
  EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
  return std::move(*result);
}

TEST(Repair, AGoodMeshComesBackAsItWas) {
  OwnedMesh mesh = goodMesh();
  const RepairedMesh result = repaired(mesh.view(), 10);
  EXPECT_TRUE(result.report().findings.empty());
  const MeshView view = result.view();
  EXPECT_EQ(view.name, mesh.name);
  EXPECT_EQ(view.vertexCount, 6u);
  EXPECT_FALSE(view.tangents);
  ASSERT_EQ(view.influenceSets.size(), 1u);
  EXPECT_EQ(view.influenceSets[0].joints.type, ComponentType::uint32);
  EXPECT_EQ(view.influenceSets[0].weights.type, ComponentType::float32);
  for (std::uint32_t vertex = 0; vertex < 6; ++vertex) {
    EXPECT_EQ(vectorAt(view.positions, vertex), vectorAt(mesh.positions, vertex));
    EXPECT_EQ(vectorAt(view.normals, vertex), vectorAt(mesh.normals, vertex));
    for (std::uint32_t slot = 0; slot < 4; ++slot) {
      EXPECT_EQ(valueAt<float>(view.influenceSets[0].weights, vertex, slot),
                mesh.weights[vertex * 4 + slot]);
      EXPECT_EQ(valueAt<std::uint32_t>(view.influenceSets[0].joints, vertex, slot),
                mesh.joints[vertex * 4 + slot]);
    }
  }
}

TEST(Repair, BadInfluencesAreDroppedTheOthersStay) {
  OwnedMesh mesh = goodMesh();
  const float bad[] = {nan, infinity, -infinity, -0.5f};
  for (std::size_t vertex = 0; vertex < 4; ++vertex) mesh.weights[vertex * 4 + 1] = bad[vertex];
  mesh.joints[4 * 4 + 3] = 10;
  mesh.joints[5 * 4 + 0] = 0xffffffffu;
  const RepairedMesh result = repaired(mesh.view(), 10);
  EXPECT_EQ(result.report().find(MeshProblem::nonFiniteWeight)->count, 3u);
  EXPECT_EQ(result.report().find(MeshProblem::negativeWeight)->count, 1u);
  EXPECT_EQ(result.report().find(MeshProblem::jointOutOfRange)->count, 2u);
  const InfluenceSet set = result.view().influenceSets[0];
  for (std::uint32_t vertex = 0; vertex < 6; ++vertex) {
    const std::uint32_t dropped = vertex < 4 ? 1 : vertex == 4 ? 3 : 0;
    for (std::uint32_t slot = 0; slot < 4; ++slot) {
      EXPECT_EQ(valueAt<float>(set.weights, vertex, slot),
                slot == dropped ? 0.0f : mesh.weights[vertex * 4 + slot]);
      if (slot != dropped) {
        EXPECT_EQ(valueAt<std::uint32_t>(set.joints, vertex, slot), mesh.joints[vertex * 4 + slot]);
      }
    }
  }
  EXPECT_TRUE(validate(result.view(), 10).packable());
  EXPECT_TRUE(pack(result.view(), 10).ok());
}

TEST(Repair, JointsAsFloatsAreConverted) {
  OwnedMesh mesh = goodMesh();
  std::vector<float> joints(mesh.joints.begin(), mesh.joints.end());
  joints[1 * 4 + 2] = 0.5f;
  MeshView view = mesh.view();
  const InfluenceSet floats{attributeView(joints.data(), 6, 4), mesh.set.weights};
  view.influenceSets = {&floats, 1};
  const RepairedMesh result = repaired(view, 10);
  const InfluenceSet set = result.view().influenceSets[0];
  EXPECT_EQ(valueAt<float>(set.weights, 1, 2), 0.0f);
  EXPECT_EQ(valueAt<float>(set.weights, 1, 1), mesh.weights[1 * 4 + 1]);
  EXPECT_EQ(valueAt<std::uint32_t>(set.joints, 1, 1), mesh.joints[1 * 4 + 1]);
}

TEST(Repair, ElementsThatAreNotFiniteBecomeZeroAsAWhole) {
  OwnedMesh mesh = goodMesh();
  std::vector<float> tangents(6 * 4, 0.5f);
  mesh.positions[1 * 3 + 2] = nan;
  mesh.normals[2 * 3 + 0] = infinity;
  tangents[3 * 4 + 3] = -infinity;
  MeshView view = mesh.view();
  view.tangents = attributeView(tangents.data(), 6, 4);
  const RepairedMesh result = repaired(view, 10);
  const MeshView mended = result.view();
  EXPECT_EQ(vectorAt(mended.positions, 1), zero);
  EXPECT_EQ(vectorAt(mended.positions, 2), vectorAt(mesh.positions, 2));
  EXPECT_EQ(vectorAt(mended.normals, 2), zero);
  EXPECT_EQ(vectorAt(mended.normals, 1), vectorAt(mesh.normals, 1));
  for (std::uint32_t i = 0; i < 4; ++i) {
    EXPECT_EQ(valueAt<float>(mended.tangents, 3, i), 0.0f);
    EXPECT_EQ(valueAt<float>(mended.tangents, 4, i), 0.5f);
  }
  EXPECT_TRUE(validate(mended, 10).packable());
}

TEST(Repair, WhatOnlySomeMethodsWantIsKept) {
  OwnedMesh mesh = goodMesh();
  const std::vector<std::uint16_t> weights{0, 1, 32768, 40000, 65534, 65535};
  for (std::uint32_t vertex = 0; vertex < 6; ++vertex) {
    mesh.bulgeStrengths.push_back(static_cast<float>(vertex) / 5);
    for (std::uint32_t i = 0; i < 3; ++i)
      mesh.centersOfRotation.push_back(static_cast<float>(100 * vertex + i));
  }
  MeshView view = mesh.view();
  view.dualQuaternionWeights = {weights.data(), 6, 2, ComponentType::unorm16, 1};
  const RepairedMesh result = repaired(view, 10);
  EXPECT_TRUE(result.report().findings.empty());
  const MeshView mended = result.view();
  EXPECT_EQ(mended.dualQuaternionWeights.type, ComponentType::float32);
  for (std::uint32_t vertex = 0; vertex < 6; ++vertex) {
    EXPECT_EQ(valueAt<float>(mended.dualQuaternionWeights, vertex, 0),
              static_cast<float>(weights[vertex]) / 65535);
    EXPECT_EQ(valueAt<float>(mended.bulgeStrengths, vertex, 0), mesh.bulgeStrengths[vertex]);
    EXPECT_EQ(vectorAt(mended.centersOfRotation, vertex), vectorAt(mesh.centersOfRotation, vertex));
  }
  // What the mesh lacks it goes on lacking, with the mesh's own shares.
  view = goodMesh().view();
  OwnedMesh bare = goodMesh();
  view = bare.view();
  view.dualQuaternionWeight = 0.375f;
  view.bulgeStrength = 0.625f;
  const RepairedMesh plain = repaired(view, 10);
  EXPECT_FALSE(plain.view().centersOfRotation);
  EXPECT_FALSE(plain.view().dualQuaternionWeights);
  EXPECT_FALSE(plain.view().bulgeStrengths);
  EXPECT_EQ(plain.view().dualQuaternionWeight, 0.375f);
  EXPECT_EQ(plain.view().bulgeStrength, 0.625f);
}

TEST(Repair, SharesAreClampedCentersThatAreNotFiniteBecomeZero) {
  OwnedMesh mesh = goodMesh();
  mesh.dualQuaternionWeights = {-0.5f, 1.5f, nan, infinity, -infinity, 0.25f};
  mesh.bulgeStrengths = {0.25f, -1e-30f, 1.0000001f, nan, 3e38f, -0.0f};
  mesh.centersOfRotation.assign(18, 5.0f);
  mesh.centersOfRotation[1 * 3 + 2] = nan;
  mesh.centersOfRotation[4 * 3 + 0] = infinity;
  const RepairedMesh result = repaired(mesh.view(), 10);
  EXPECT_EQ(result.report().find(MeshProblem::nonFiniteCenter)->count, 2u);
  EXPECT_NE(result.report().find(MeshProblem::methodWeightOutOfRange), nullptr);
  const MeshView mended = result.view();
  const float weights[] = {0, 1, 0, 1, 0, 0.25f}, strengths[] = {0.25f, 0, 1, 0, 1, 0};
  for (std::uint32_t vertex = 0; vertex < 6; ++vertex) {
    EXPECT_EQ(valueAt<float>(mended.dualQuaternionWeights, vertex, 0), weights[vertex]);
    EXPECT_EQ(valueAt<float>(mended.bulgeStrengths, vertex, 0), strengths[vertex]);
    EXPECT_EQ(vectorAt(mended.centersOfRotation, vertex),
              vertex == 1 || vertex == 4 ? zero : (Vector{5, 5, 5}));
  }
  EXPECT_TRUE(validate(mended, 10).findings.empty());
  EXPECT_TRUE(pack(mended, 10)->info().hasCentersOfRotation);
  for (const auto& [bad, good] : {std::pair{-1.0f, 0.0f}, {2.0f, 1.0f}, {nan, 0.0f}}) {
    OwnedMesh whole = goodMesh();
    MeshView view = whole.view();
    view.dualQuaternionWeight = view.bulgeStrength = bad;
    const RepairedMesh clamped = repaired(view, 10);
    EXPECT_EQ(clamped.view().dualQuaternionWeight, good);
    EXPECT_EQ(clamped.view().bulgeStrength, good);
    EXPECT_TRUE(validate(clamped.view(), 10).packable());
  }
}

TEST(Repair, PositionsLoseTheirScaleAndOffset) {
  OwnedMesh mesh = goodMesh();
  std::vector<std::int16_t> stored(6 * 4, 16384);
  stored[2 * 4 + 1] = -32768;
  MeshView view = mesh.view();
  view.positions = {stored.data(), 6, 8, ComponentType::snorm16, 4};
  view.positionScale = {2, 3, 4};
  view.positionOffset = {0.5f, -0.25f, 100};
  const RepairedMesh result = repaired(view, 10);
  const MeshView mended = result.view();
  EXPECT_EQ(mended.positions.type, ComponentType::float32);
  EXPECT_EQ(mended.positions.components, 3u);
  EXPECT_EQ(mended.positionScale, (std::array<float, 3>{1, 1, 1}));
  EXPECT_EQ(mended.positionOffset, (std::array<float, 3>{0, 0, 0}));
  const double part = 16384 / 32767.0;
  EXPECT_EQ(valueAt<float>(mended.positions, 2, 0), static_cast<float>(part * 2 + 0.5));
  EXPECT_EQ(valueAt<float>(mended.positions, 2, 1), -3.25f);
  EXPECT_EQ(valueAt<float>(mended.positions, 2, 2), static_cast<float>(part * 4 + 100));
  const PackedMesh before = *pack(view, 10), after = *pack(mended, 10);
  EXPECT_TRUE(std::ranges::equal(before.bytes(), after.bytes()));
}

TEST(Repair, APositionThatOverflowsByItsScaleBecomesZero) {
  OwnedMesh mesh = goodMesh();
  mesh.positions[1 * 3 + 2] = 3e38f;
  MeshView view = mesh.view();
  view.positionScale = {2, 2, 2};
  const RepairedMesh result = repaired(view, 10);
  EXPECT_EQ(vectorAt(result.view().positions, 1), zero);
  for (float& x : mesh.positions) x *= 2;
  EXPECT_EQ(vectorAt(result.view().positions, 2), vectorAt(mesh.positions, 2));
}

TEST(Repair, AFourthComponentThatIsNotReadIsLeftOut) {
  OwnedMesh mesh = goodMesh();
  const std::vector<float> values(6 * 4, 2.0f);
  std::vector<float> withNan = values;
  withNan[4 * 4 + 3] = nan;
  MeshView view = mesh.view();
  view.positions = view.normals = attributeView(withNan.data(), 6, 4);
  const RepairedMesh result = repaired(view, 10);
  EXPECT_TRUE(result.report().packable());
  EXPECT_EQ(result.view().positions.components, 3u);
  EXPECT_EQ(valueAt<float>(result.view().positions, 4, 2), 2.0f);
  EXPECT_EQ(valueAt<float>(result.view().normals, 4, 2), 2.0f);
}

// ---- Morph targets

/// A dense target and a sparse one, with everything; and one with nothing.
struct OwnedTargets {
  std::vector<float> dense, sparse;
  std::vector<std::int16_t> shorts;
  std::vector<std::uint32_t> vertices{1, 4};
  std::vector<MorphTargetView> views{3};

  OwnedTargets() {
    for (int i = 0; i < 18; ++i) {
      dense.push_back(static_cast<float>(i) + 0.5f);
      shorts.push_back(static_cast<std::int16_t>(i * 1000));
    }
    for (int i = 0; i < 6; ++i) sparse.push_back(static_cast<float>(i) - 3.25f);
    views[0].positions = {shorts.data(), 6, 6, ComponentType::snorm16, 3};
    views[0].positionScale = {1, 2, 3};
    views[0].normals = attributeView(dense.data(), 6, 3);
    views[1].vertices = vertices;
    views[1].positions = attributeView(sparse.data(), 2, 3);
    views[1].tangents = attributeView(sparse.data(), 2, 3);
  }
  OwnedTargets(const OwnedTargets&) = delete;
  OwnedTargets& operator=(const OwnedTargets&) = delete;
};

TEST(Repair, MorphTargetsAreKept) {
  OwnedMesh mesh = goodMesh();
  const std::vector<float> tangents(6 * 4, 0.5f);
  const OwnedTargets targets;
  MeshView view = mesh.view();
  view.tangents = attributeView(tangents.data(), 6, 4);
  view.morphTargets = targets.views;
  const PackedMesh before = *pack(view, 10);
  const RepairedMesh result = repaired(view, 10);
  EXPECT_TRUE(result.report().packable());
  const MeshView mended = result.view();
  ASSERT_EQ(mended.morphTargets.size(), 3u);
  EXPECT_EQ(mended.morphTargets[0].positionScale, (std::array<float, 3>{1, 1, 1}));
  EXPECT_FALSE(mended.morphTargets[0].tangents);
  EXPECT_TRUE(std::ranges::equal(mended.morphTargets[1].vertices, targets.vertices));
  EXPECT_FALSE(mended.morphTargets[1].normals);
  EXPECT_FALSE(mended.morphTargets[2].positions);
  EXPECT_TRUE(std::ranges::equal(before.bytes(), pack(mended, 10)->bytes()));
}

TEST(Repair, DisplacementsThatAreNotFiniteBecomeZeroAsAWhole) {
  OwnedMesh mesh = goodMesh();
  OwnedTargets targets;
  targets.dense[2 * 3 + 1] = infinity;
  targets.sparse[1 * 3 + 2] = nan;
  MeshView view = mesh.view();
  view.morphTargets = targets.views;
  const RepairedMesh result = repaired(view, 10);
  EXPECT_EQ(result.report().find(MeshProblem::nonFiniteMorph)->count, 2u);
  const MeshView mended = result.view();
  EXPECT_TRUE(validate(mended, 10).findings.empty());
  EXPECT_EQ(vectorAt(mended.morphTargets[0].normals, 2), zero);
  EXPECT_EQ(vectorAt(mended.morphTargets[0].normals, 3), vectorAt(targets.dense, 3));
  // Its position is finite: it stays.
  for (std::uint32_t i = 0; i < 3; ++i)
    EXPECT_NE(valueAt<float>(mended.morphTargets[0].positions, 2, i), 0.0f);
  EXPECT_EQ(vectorAt(mended.morphTargets[1].positions, 1), zero);
  EXPECT_EQ(vectorAt(mended.morphTargets[1].tangents, 1), zero);
  EXPECT_EQ(vectorAt(mended.morphTargets[1].positions, 0), vectorAt(targets.sparse, 0));
}

TEST(Repair, MorphTargetsWhoseVerticesMakeNoSenseAreRefused) {
  OwnedMesh mesh = goodMesh();
  OwnedTargets targets;
  targets.vertices[1] = 6;
  MeshView view = mesh.view();
  view.morphTargets = targets.views;
  const Result<RepairedMesh> result = repair(view, 10);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::invalidMesh);
  EXPECT_NE(result.error().message.find("morph target 1"), std::string::npos);
}

TEST(Repair, MorphTargetsDoNotNeedTheMesh) {
  OwnedMesh mesh = goodMesh();
  auto targets = std::make_unique<OwnedTargets>();
  MeshView view = mesh.view();
  view.morphTargets = targets->views;
  const PackedMesh before = *pack(view, 10);
  RepairedMesh first = repaired(view, 10);
  targets.reset();
  const RepairedMesh moved = std::move(first);
  EXPECT_TRUE(std::ranges::equal(before.bytes(), pack(moved.view(), 10)->bytes()));
}

// ---- Influences

TEST(Repair, SetsAndFormatsBecomeOne) {
  OwnedMesh mesh = goodMesh();
  std::vector<std::uint8_t> joints8;
  std::vector<std::uint16_t> joints16, weights16;
  std::vector<std::uint8_t> weights8;
  for (std::uint32_t vertex = 0; vertex < 6; ++vertex) {
    joints8.insert(joints8.end(), {static_cast<std::uint8_t>(vertex), 8, 99});  // 99: a gap
    weights8.insert(weights8.end(), {51, 102, 99});
    joints16.push_back(7);
    weights16.push_back(26214);
  }
  const InfluenceSet sets[] = {{{joints8.data(), 6, 3, ComponentType::uint8, 2},
                                {weights8.data(), 6, 3, ComponentType::unorm8, 2}},
                               {{joints16.data(), 6, 2, ComponentType::uint16, 1},
                                {weights16.data(), 6, 2, ComponentType::unorm16, 1}}};
  MeshView view = mesh.view();
  view.influenceSets = sets;
  const RepairedMesh result = repaired(view, 9);
  const MeshView mended = result.view();
  ASSERT_EQ(mended.influenceSets.size(), 1u);
  const InfluenceSet& set = mended.influenceSets[0];
  EXPECT_EQ(set.joints.components, 3u);
  EXPECT_EQ(set.weights.components, 3u);
  for (std::uint32_t vertex = 0; vertex < 6; ++vertex) {
    EXPECT_EQ(valueAt<std::uint32_t>(set.joints, vertex, 0), vertex);
    EXPECT_EQ(valueAt<std::uint32_t>(set.joints, vertex, 1), 8u);
    EXPECT_EQ(valueAt<std::uint32_t>(set.joints, vertex, 2), 7u);
    EXPECT_EQ(valueAt<float>(set.weights, vertex, 0), 0.2f);
    EXPECT_EQ(valueAt<float>(set.weights, vertex, 1), 0.4f);
    EXPECT_EQ(valueAt<float>(set.weights, vertex, 2), 0.4f);
  }
  EXPECT_TRUE(validate(mended, 9).findings.empty());
}

TEST(Repair, AVertexWithoutGoodInfluencesIsLeftWithoutWeight) {
  OwnedMesh mesh = goodMesh();
  for (std::size_t slot = 0; slot < 4; ++slot) mesh.weights[2 * 4 + slot] = nan;
  const RepairedMesh result = repaired(mesh.view(), 10);
  const MeshReport after = validate(result.view(), 10);
  EXPECT_TRUE(after.packable());
  ASSERT_NE(after.find(MeshProblem::vertexWithoutWeight), nullptr);
  EXPECT_EQ(after.find(MeshProblem::vertexWithoutWeight)->firstVertex, 2u);
}

TEST(Repair, RefusesViewsThatMakeNoSense) {
  OwnedMesh mesh = goodMesh();
  MeshView view = mesh.view();
  view.normals.count = 5;
  const Result<RepairedMesh> result = repair(view, 10);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::invalidMesh);
  EXPECT_NE(result.error().message.find("there are 5 normals for 6 vertices"), std::string::npos);
  EXPECT_FALSE(repair(MeshView{}, 10).ok());
}

void expectSecondVertexOf(const MeshView& view) {
  ASSERT_EQ(view.influenceSets.size(), 1u);
  EXPECT_EQ(view.name, goodMesh().name);
  EXPECT_EQ(valueAt<float>(view.positions, 1, 0), 10.0f);
  EXPECT_EQ(valueAt<std::uint32_t>(view.influenceSets[0].joints, 1, 0), 1u);
  EXPECT_EQ(valueAt<float>(view.influenceSets[0].weights, 1, 1), 0.25f);
}

TEST(Repair, TheResultDoesNotNeedTheMesh) {
  std::optional<OwnedMesh> mesh = goodMesh();
  RepairedMesh result = repaired(mesh->view(), 10);
  mesh.reset();
  expectSecondVertexOf(result.view());
  const RepairedMesh moved = std::move(result);
  expectSecondVertexOf(moved.view());
}

/// Does nothing for a type that cannot be copied.
template <typename Repaired>
void expectCopiesStandOnTheirOwn(Repaired&& repairedMesh) {
  if constexpr (std::is_copy_constructible_v<Repaired>) {
    auto original = std::make_unique<Repaired>(std::move(repairedMesh));
    const Repaired copy = *original;
    const InfluenceSet& copied = copy.view().influenceSets[0];
    ASSERT_NE(copied.joints.data, original->view().influenceSets[0].joints.data);
    ASSERT_NE(copied.weights.data, original->view().influenceSets[0].weights.data);
    original.reset();
    expectSecondVertexOf(copy.view());
  }
}

// "Owns its memory": a copy must not look into what it was copied from.
TEST(Repair, ACopyStandsOnItsOwn) {
  OwnedMesh mesh = goodMesh();
  expectCopiesStandOnTheirOwn(repaired(mesh.view(), 10));
}

}  // namespace
}  // namespace dermis::test
