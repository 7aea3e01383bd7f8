// pack: morph targets. The blob is read by the words of shaders/abi.h.

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <tuple>

#include "core_pack_meshes.h"
#include "dermis/mesh.h"

namespace dermis::test {
namespace {

struct PackMorphs : public ::testing::Test {
  /// A mesh with normals and tangents, with these targets.
  PackedMesh packTargets(const std::vector<MorphTargetView>& targets, bool normals = true,
                         bool tangents = true) {
    mesh = slottedMesh(1, vertices, 2, 5);
    tangentValues.assign(std::size_t{vertices} * 4, 1.0f);
    MeshView view = mesh.view();
    if (!normals) view.normals = {};
    if (tangents) view.tangents = viewOf(tangentValues, ComponentType::float32, 4);
    view.morphTargets = targets;
    PackedMesh result = packed(view, 5);
    // Whatever `pack` makes can be stored and read again.
    EXPECT_TRUE(PackedMesh::fromBytes(result.bytes()).ok());
    EXPECT_EQ(result.info().morphTargetCount, targets.size());
    return result;
  }

  std::uint32_t vertices = 500;
  OwnedMesh mesh;
  std::vector<float> tangentValues;
};

BlobDisplacement displacementOf(const OwnedTarget& target, std::uint32_t vertex) {
  BlobDisplacement result;
  for (std::uint32_t i = 0; i < 3; ++i) {
    if (!target.positions.empty()) result.position[i] = target.positions[vertex * 3 + i];
    if (!target.normals.empty()) result.normal[i] = target.normals[vertex * 3 + i];
    if (!target.tangents.empty()) result.tangent[i] = target.tangents[vertex * 3 + i];
  }
  return result;
}

/// Vertices that a dense target displaces.
std::vector<std::uint32_t> displacedBy(const OwnedTarget& target, std::uint32_t vertices) {
  std::vector<std::uint32_t> result;
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    if (!(displacementOf(target, vertex) == BlobDisplacement{})) result.push_back(vertex);
  }
  return result;
}

TEST_F(PackMorphs, EveryDisplacementIsStoredAndNoOther) {
  for (const std::uint32_t count : {1u, 63u, 64u, 65u, 128u, 1234u}) {
    vertices = count;
    for (const std::uint32_t sparsity : {1u, 3u, 40u, 900u}) {
      for (const auto& [normals, tangents] :
           {std::pair{false, false}, {true, false}, {false, true}, {true, true}}) {
        const OwnedTarget first =
            randomTarget(count + sparsity, count, sparsity, normals, tangents);
        const OwnedTarget second = randomTarget(count * 7, count, 2, normals, !tangents);
        const Blob blob(packTargets({first.view(), second.view()}).bytes());
        ASSERT_EQ(blob.morphCount(), 2u);
        for (std::uint32_t vertex = 0; vertex < count; ++vertex) {
          for (std::uint32_t target = 0; target < 2; ++target) {
            const BlobDisplacement expected = displacementOf(target == 0 ? first : second, vertex);
            const auto stored = blob.displacement(target, vertex);
            ASSERT_EQ(stored.has_value(), !(expected == BlobDisplacement{})) << vertex;
            if (stored) {
              ASSERT_EQ(*stored, expected) << vertex;
            }
          }
        }
      }
    }
  }
}

TEST_F(PackMorphs, DenseAndSparseViewsGiveTheSameBlob) {
  const OwnedTarget dense = randomTarget(3, vertices, 7, true, true);
  std::vector<std::uint32_t> some = displacedBy(dense, vertices);
  ASSERT_GT(some.size(), 20u);
  const PackedMesh expected = packTargets({dense.view()});
  EXPECT_TRUE(sameBytes(expected, packTargets({dense.sparse(some).view()})));
  // Named, but displaced by nothing.
  for (std::uint32_t vertex = 0; vertex < vertices; vertex += 3) some.push_back(vertex);
  std::sort(some.begin(), some.end());
  some.erase(std::unique(some.begin(), some.end()), some.end());
  EXPECT_TRUE(sameBytes(expected, packTargets({dense.sparse(some).view()})));
}

TEST_F(PackMorphs, WhatIsZeroCostsNothing) {
  const std::size_t without = packTargets({}).bytes().size();
  OwnedTarget zero = randomTarget(1, vertices, 1000000, true, true);
  ASSERT_TRUE(displacedBy(zero, vertices).empty());
  std::fill(zero.normals.begin(), zero.normals.end(), -0.0f);
  // A record of four words for each target.
  EXPECT_EQ(packTargets({zero.view()}).bytes().size(), without + 16);
  EXPECT_EQ(packTargets({MorphTargetView{}, zero.view()}).bytes().size(), without + 32);
  const Blob blob(packTargets({MorphTargetView{}, zero.view()}).bytes());
  for (std::uint32_t target = 0; target < 2; ++target) {
    EXPECT_EQ(blob.word(blob.morphRecord(target) + morphBlockCount), 0u);
    EXPECT_EQ(blob.displacement(target, 0), std::nullopt);
  }
}

// A record, a block and 3 floats for each attribute that is displaced anywhere.
TEST_F(PackMorphs, AttributesThatNoVertexDisplacesAreLeftOut) {
  const std::size_t without = packTargets({}).bytes().size();
  OwnedTarget target = randomTarget(1, vertices, 1000000, true, true);
  target.normals[77 * 3 + 1] = 0.5f;
  const PackedMesh result = packTargets({target.view()});
  const Blob blob(result.bytes());
  EXPECT_EQ(blob.word(blob.morphRecord(0) + morphAttributes), abi::MORPH_HAS_NORMALS);
  EXPECT_LE(result.bytes().size(), without + 4 * (4 + 4 + 3) + 12);
  EXPECT_EQ(blob.displacement(0, 77)->normal, (std::array<float, 3>{0, 0.5f, 0}));
  target.tangents[200 * 3] = 2;
  const Blob both(packTargets({target.view()}).bytes());
  EXPECT_EQ(both.word(both.morphRecord(0) + morphAttributes),
            abi::MORPH_HAS_NORMALS | abi::MORPH_HAS_TANGENTS);
}

TEST_F(PackMorphs, AttributesThatTheMeshLacksAreLeftOut) {
  const OwnedTarget all = randomTarget(5, vertices, 2, true, true);
  const OwnedTarget positions{{}, all.positions, {}, {}};
  const OwnedTarget withNormals{{}, all.positions, all.normals, {}};
  EXPECT_TRUE(sameBytes(packTargets({all.view()}, false, false),
                        packTargets({positions.view()}, false, false)));
  EXPECT_TRUE(sameBytes(packTargets({all.view()}, true, false),
                        packTargets({withNormals.view()}, true, false)));
  // Then a vertex of which only they are displaced is not displaced at all.
  OwnedTarget lone = randomTarget(1, vertices, 1000000, true, true);
  lone.tangents[9] = lone.normals[300] = 1;
  EXPECT_TRUE(sameBytes(packTargets({lone.view()}, false, false),
                        packTargets({MorphTargetView{}}, false, false)));
}

TEST_F(PackMorphs, BlocksGoFromTheFirstDisplacedVertexToTheLast) {
  OwnedTarget target = randomTarget(1, vertices, 1000000, false);
  for (const std::uint32_t vertex : {130u, 191u, 320u, 351u, 352u})
    target.positions[vertex * 3] = 1;
  const Blob blob(packTargets({target.view()}).bytes());
  const std::size_t record = blob.morphRecord(0);
  EXPECT_EQ(blob.word(record + morphFirstBlock), 2u);
  EXPECT_EQ(blob.word(record + morphBlockCount), 4u);
  EXPECT_EQ(blob.word(blob.morphRecord(0) + morphAttributes), abi::MORPH_HAS_POSITIONS);
  const std::uint32_t masks[][2] = {{1u << 2, 1u << 31}, {0, 0}, {0, 0}, {1u | 1u << 31, 1u}};
  for (std::uint32_t block = 0; block < 4; ++block) {
    EXPECT_EQ(blob.word(blob.morphBlock(0, block) + morphBlockMask), masks[block][0]);
    EXPECT_EQ(blob.word(blob.morphBlock(0, block) + morphBlockMask + 1), masks[block][1]);
  }
  // The displacements of the second such block follow those of the first.
  EXPECT_EQ(blob.word(blob.morphBlock(0, 3) + morphBlockDisplacements),
            blob.word(blob.morphBlock(0, 0) + morphBlockDisplacements) + 2 * 3);
}

template <typename Stored>
MorphTargetView typedTarget(const std::vector<Stored>& values, ComponentType type,
                            std::uint32_t components) {
  MorphTargetView target;
  target.positions = target.normals = target.tangents = viewOf(values, type, components);
  return target;
}

TEST_F(PackMorphs, DisplacementsOfEveryTypeAreRead) {
  vertices = 1;
  const std::vector<std::uint16_t> halves{0x3c00, 0xb800, 0x0001};
  const std::vector<std::int16_t> shorts{32767, -32768, 100};
  const std::vector<std::int8_t> bytes{127, -128, 100};
  const std::vector<float> floats{1.5f, -2.5f, 1e-30f};
  const std::array<float, 3> scale{2, -0.5f, 0.1f};
  const auto expectDisplacement = [&](MorphTargetView target, std::array<double, 3> values) {
    target.positionScale = scale;
    const auto stored = Blob(packTargets({target}).bytes()).displacement(0, 0);
    ASSERT_TRUE(stored.has_value());
    for (std::size_t i = 0; i < 3; ++i) {
      if (target.positions) {
        EXPECT_EQ(stored->position[i],
                  static_cast<float>(values[i] * static_cast<double>(scale[i])));
      }
      EXPECT_EQ(stored->normal[i], static_cast<float>(values[i]));
      EXPECT_EQ(stored->tangent[i], static_cast<float>(values[i]));
    }
  };
  expectDisplacement(typedTarget(halves, ComponentType::float16, 3), {1, -0.5, 0x1p-24});
  expectDisplacement(typedTarget(shorts, ComponentType::snorm16, 3), {1, -1, 100 / 32767.0});
  expectDisplacement(typedTarget(floats, ComponentType::float32, 3),
                     {1.5, -2.5, static_cast<double>(1e-30f)});
  MorphTargetView directions = typedTarget(bytes, ComponentType::snorm8, 3);
  directions.positions = {};  // these may not be bytes
  expectDisplacement(directions, {1, -1, 100 / 127.0});
}

TEST_F(PackMorphs, TargetsThatMakeNoSenseAreRefused) {
  const OwnedTarget dense = randomTarget(3, vertices, 1);
  const auto expectRefused = [&](const OwnedTarget& target, const std::string& text) {
    mesh = slottedMesh(1, vertices, 2, 5);
    MeshView view = mesh.view();
    const MorphTargetView targets[] = {dense.view(), target.view()};
    view.morphTargets = targets;
    const Result<PackedMesh> result = pack(view, 5);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::invalidMesh);
    EXPECT_NE(result.error().message.find(text), std::string::npos) << result.error().message;
    EXPECT_NE(result.error().message.find("morph target 1"), std::string::npos);
  };
  OwnedTarget target = dense.sparse({3, 4, 5});
  target.vertices[1] = 3;
  expectRefused(target, "vertex 3");
  target.vertices[1] = 4;
  target.vertices[2] = vertices;
  expectRefused(target, "vertex 500");
  target = dense;
  target.normals[7 * 3] = std::numeric_limits<float>::quiet_NaN();
  expectRefused(target, "vertex 7");
  target = dense;
  target.positions.resize(9);
  expectRefused(target, "3 position displacements");
}

}  // namespace
}  // namespace dermis::test
