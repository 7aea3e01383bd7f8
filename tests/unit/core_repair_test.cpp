// repair: what it drops, what it keeps, and that the result stands on its own.

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <type_traits>

#include "dermis/pack.h"
#include "dermis/types.h"
#include "dermis/validate.h"
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

OwnedMesh goodMesh() {
  OwnedMesh mesh;
  mesh.name = "a mesh with a name that is too long for the small-string buffer";
  for (std::uint32_t vertex = 0; vertex < 6; ++vertex) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      mesh.positions.push_back(static_cast<float>(vertex * 10 + i));
      mesh.normals.push_back(static_cast<float>(vertex * 10 + i + 3));
    }
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
    for (std::uint32_t i = 0; i < 3; ++i) {
      EXPECT_EQ(valueAt<float>(view.positions, vertex, i), mesh.positions[vertex * 3 + i]);
      EXPECT_EQ(valueAt<float>(view.normals, vertex, i), mesh.normals[vertex * 3 + i]);
    }
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
  EXPECT_EQ(result.report().find(Problem::nonFiniteWeight)->count, 3u);
  EXPECT_EQ(result.report().find(Problem::negativeWeight)->count, 1u);
  EXPECT_EQ(result.report().find(Problem::jointOutOfRange)->count, 2u);
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

TEST(Repair, ElementsThatAreNotFiniteBecomeZeroAsAWhole) {
  OwnedMesh mesh = goodMesh();
  std::vector<float> tangents(6 * 4, 0.5f);
  mesh.positions[1 * 3 + 2] = nan;
  mesh.normals[2 * 3 + 0] = infinity;
  tangents[3 * 4 + 3] = -infinity;
  MeshView view = mesh.view();
  view.tangents = floatAttribute(tangents.data(), 6, 4);
  const RepairedMesh result = repaired(view, 10);
  const MeshView mended = result.view();
  for (std::uint32_t i = 0; i < 3; ++i) {
    EXPECT_EQ(valueAt<float>(mended.positions, 1, i), 0.0f);
    EXPECT_EQ(valueAt<float>(mended.positions, 2, i), mesh.positions[2 * 3 + i]);
    EXPECT_EQ(valueAt<float>(mended.normals, 2, i), 0.0f);
    EXPECT_EQ(valueAt<float>(mended.normals, 1, i), mesh.normals[1 * 3 + i]);
  }
  for (std::uint32_t i = 0; i < 4; ++i) {
    EXPECT_EQ(valueAt<float>(mended.tangents, 3, i), 0.0f);
    EXPECT_EQ(valueAt<float>(mended.tangents, 4, i), 0.5f);
  }
  EXPECT_TRUE(validate(mended, 10).findings.empty());
}

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
  ASSERT_NE(after.find(Problem::vertexWithoutWeight), nullptr);
  EXPECT_EQ(after.find(Problem::vertexWithoutWeight)->firstVertex, 2u);
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
