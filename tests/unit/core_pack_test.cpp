// pack: what it stores for every vertex. The blob is read by the words of shaders/abi.h.

#include "dermis/mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "core_pack_meshes.h"

namespace dermis::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

/// Joint to weight, duplicates added up: what the vertex has, by the mesh.
std::map<std::uint32_t, double> weightsOf(const OwnedMesh& mesh, std::uint32_t vertex) {
  std::map<std::uint32_t, double> result;
  for (std::uint32_t slot = 0; slot < mesh.influencesPerVertex; ++slot) {
    const std::size_t entry = std::size_t{vertex} * mesh.influencesPerVertex + slot;
    if (mesh.weights[entry] != 0) {
      result[mesh.joints[entry]] += static_cast<double>(mesh.weights[entry]);
    }
  }
  return result;
}

void expectVertex(const Blob& blob, const OwnedMesh& mesh, std::uint32_t vertex) {
  for (std::uint32_t i = 0; i < 3; ++i) {
    ASSERT_EQ(blob.position(vertex, i), mesh.positions[vertex * 3 + i]);
    ASSERT_EQ(blob.normal(vertex, i), mesh.normals[vertex * 3 + i]);
  }
  const std::map<std::uint32_t, double> expected = weightsOf(mesh, vertex);
  double expectedSum = 0, strongest = 0;
  for (const auto& [joint, weight] : expected) {
    expectedSum += weight;
    strongest = std::max(strongest, weight);
  }
  const std::vector<BlobInfluence> influences = blob.influences(vertex);
  ASSERT_EQ(influences.size(), expected.size()) << vertex;
  double sum = 0;
  for (std::size_t i = 0; i < influences.size(); ++i) {
    const auto found = expected.find(influences[i].joint);
    ASSERT_NE(found, expected.end()) << vertex;
    ASSERT_NEAR(static_cast<double>(influences[i].weight), found->second / expectedSum, 1.2e-7);
    sum += static_cast<double>(influences[i].weight);
    if (i == 0) {
      // The greatest weight; the map is in order of joints, so the first such is the lowest.
      const auto pivot = std::find_if(expected.begin(), expected.end(),
                                      [&](const auto& entry) { return entry.second == strongest; });
      ASSERT_EQ(influences[0].joint, pivot->first) << vertex;
    } else if (i > 1) {
      const double before = expected.at(influences[i - 1].joint);
      ASSERT_TRUE(before > found->second ||
                  (before == found->second && influences[i - 1].joint < influences[i].joint));
    }
  }
  if (!influences.empty()) {
    ASSERT_EQ(sum, 1) << vertex;
  }
}

void expectPacked(OwnedMesh& mesh, std::uint32_t jointCount) {
  const PackedMesh result = packed(mesh.view(), jointCount);
  const Blob blob(result.bytes());
  const MeshInfo info = result.info();
  const std::uint32_t vertices = mesh.vertexCount();
  ASSERT_EQ(result.bytes().size() % packedMeshAlignment, 0u);
  ASSERT_EQ(info.byteSize, result.bytes().size());
  ASSERT_EQ(blob.word(header::magic), abi::MESH_MAGIC);
  ASSERT_EQ(blob.word(header::version), abi::MESH_VERSION);
  ASSERT_EQ(blob.word(header::wordCount), blob.size());
  ASSERT_EQ(blob.vertexCount(), vertices);
  ASSERT_EQ(result.vertexCount(), vertices);
  ASSERT_EQ(info.vertexCount, vertices);
  ASSERT_EQ(info.hasNormals, !mesh.normals.empty());
  ASSERT_FALSE(info.hasTangents);
  ASSERT_EQ(info.morphTargetCount, 0u);
  Blob sealed = blob;
  sealed.seal();
  ASSERT_EQ(sealed.word(header::checksum), blob.word(header::checksum));

  std::uint32_t required = 1;
  std::size_t most = 0, pairs = 0;
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    ASSERT_NO_FATAL_FAILURE(expectVertex(blob, mesh, vertex));
    const auto weights = weightsOf(mesh, vertex);
    if (!weights.empty()) required = std::max(required, weights.rbegin()->first + 1);
    most = std::max(most, weights.size());
    pairs += (weights.size() + 1) / 2;
  }
  EXPECT_EQ(info.requiredJoints, required);
  EXPECT_EQ(info.maxInfluences, most);
  // A header, a unit a position and one more, a unit a normal, one for two influences: no more than
  // half a unit for influences that a vertex has not.
  EXPECT_EQ(blob.size(),
            abi::MESH_HEADER_WORDS + 4 * (vertices + 1 + mesh.normals.size() / 3 + pairs));
}

class PackCounts
    : public ::testing::TestWithParam<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>> {};

TEST_P(PackCounts, StoresEveryVertexAsAbiHSays) {
  const auto [vertices, influences, joints] = GetParam();
  OwnedMesh mesh = slottedMesh(vertices * 131 + influences, vertices, influences, joints);
  expectPacked(mesh, joints);
  expectPacked(mesh, maxPoseJoints);
}

INSTANTIATE_TEST_SUITE_P(Pack, PackCounts,
                         ::testing::Combine(::testing::Values(1u, 63u, 64u, 65u, 128u, 1234u),
                                            ::testing::Values(1u, 2u, 3u, 4u, 5u, 8u, 17u),
                                            ::testing::Values(1u, 5u, 300u, 65536u)));

TEST(Pack, TheHighestJointFits) {
  OwnedMesh mesh = oneVertex({65535, 65534, 0}, {0.5f, 0.25f, 0.25f});
  const PackedMesh result = packed(mesh.view(), 65536);
  EXPECT_EQ(result.info().requiredJoints, 65536u);
  const std::vector<BlobInfluence> influences = Blob(result.bytes()).influences(0);
  ASSERT_EQ(influences.size(), 3u);
  EXPECT_EQ(influences[0].joint, 65535u);
  EXPECT_EQ(influences[1].joint, 0u);
  EXPECT_EQ(influences[2].joint, 65534u);
  EXPECT_TRUE(PackedMesh::fromBytes(result.bytes()).ok());
}

TEST(Pack, NoVertexHasWeight) {
  OwnedMesh mesh = slottedMesh(1, 100, 4, 10);
  std::fill(mesh.weights.begin(), mesh.weights.end(), 0.0f);
  expectPacked(mesh, 10);
  const PackedMesh result = packed(mesh.view(), 10);
  EXPECT_EQ(result.info().maxInfluences, 0u);
  EXPECT_EQ(result.info().requiredJoints, 1u);
  EXPECT_TRUE(PackedMesh::fromBytes(result.bytes()).ok());
}

TEST(Pack, WithoutNormals) {
  OwnedMesh mesh = slottedMesh(1, 65, 4, 10);
  const std::size_t size = packed(mesh.view(), 10).bytes().size();
  mesh.normals.clear();
  const PackedMesh result = packed(mesh.view(), 10);
  EXPECT_FALSE(result.info().hasNormals);
  EXPECT_EQ(Blob(result.bytes()).word(header::normals), 0u);
  EXPECT_NEAR(static_cast<double>(size - result.bytes().size()), 65 * 16, 16);
  EXPECT_EQ(Blob(result.bytes()).position(64, 2), mesh.positions[64 * 3 + 2]);
}

TEST(Pack, FormatsAndStridesDoNotMatter) {
  // 51 + 204 = 255: as float, byte, short; tightly packed or at odd addresses.
  const std::uint32_t count = 70;
  std::vector<unsigned char> bytes(count * 41 + 1, 0xcc);
  OwnedMesh plain;
  plain.influencesPerVertex = 2;
  for (std::uint32_t vertex = 0; vertex < count; ++vertex) {
    const float position[] = {static_cast<float>(vertex), 0.5f, -1.0f};
    const float normal[] = {0.0f, static_cast<float>(vertex), 1.0f};
    const auto small = static_cast<std::uint8_t>(vertex);
    const std::uint8_t joints[] = {small, static_cast<std::uint8_t>(vertex + 1)};
    const std::uint8_t weights[] = {small, static_cast<std::uint8_t>(255 - vertex)};
    unsigned char* element = &bytes[1 + vertex * 41];
    std::memcpy(element, position, 12);
    std::memcpy(element + 13, normal, 12);
    std::memcpy(element + 25, joints, 2);
    std::memcpy(element + 28, weights, 2);
    for (int i = 0; i < 3; ++i) {
      plain.positions.push_back(position[i]);
      plain.normals.push_back(normal[i]);
    }
    for (int i = 0; i < 2; ++i) {
      plain.joints.push_back(joints[i]);
      plain.weights.push_back(weights[i]);
    }
  }
  MeshView odd;
  odd.vertexCount = count;
  odd.positions = {&bytes[1], count, 41, ComponentType::float32, 3};
  odd.normals = {&bytes[14], count, 41, ComponentType::float32, 3};
  const InfluenceSet oddSet{{&bytes[26], count, 41, ComponentType::uint8, 2},
                            {&bytes[29], count, 41, ComponentType::unorm8, 2}};
  odd.influenceSets = {&oddSet, 1};
  const PackedMesh expected = packed(plain.view(), 100), actual = packed(odd, 100);
  EXPECT_TRUE(std::ranges::equal(expected.bytes(), actual.bytes()));

  std::vector<std::uint16_t> joints16, weights16;
  for (std::size_t i = 0; i < plain.joints.size(); ++i) {
    joints16.push_back(static_cast<std::uint16_t>(plain.joints[i]));
    weights16.push_back(static_cast<std::uint16_t>(plain.weights[i] * 257));
  }
  const InfluenceSet set16{{joints16.data(), count, 4, ComponentType::uint16, 2},
                           {weights16.data(), count, 4, ComponentType::unorm16, 2}};
  MeshView shorts = plain.view();
  shorts.influenceSets = {&set16, 1};
  EXPECT_TRUE(std::ranges::equal(expected.bytes(), packed(shorts, 100).bytes()));

  const std::vector<float> wholeFloats(plain.joints.begin(), plain.joints.end());
  const InfluenceSet floatSet{attributeView(wholeFloats.data(), count, 2), plain.set.weights};
  MeshView floats = plain.view();
  floats.influenceSets = {&floatSet, 1};
  EXPECT_TRUE(std::ranges::equal(expected.bytes(), packed(floats, 100).bytes()));
}

// ---- Types of positions, normals and tangents

/// A mesh of a few vertices that reads its attributes where a test puts them.
struct TypedMesh {
  std::vector<std::uint32_t> joints;
  std::vector<float> weights, positions;
  InfluenceSet set;
  MeshView view;

  explicit TypedMesh(std::uint32_t vertices)
      : joints(vertices, 0), weights(vertices, 1.0f), positions(std::size_t{vertices} * 3, 0.0f) {
    set.joints = viewOf(joints, ComponentType::uint32, 1);
    set.weights = viewOf(weights, ComponentType::float32, 1);
    view.vertexCount = vertices;
    view.positions = viewOf(positions, ComponentType::float32, 3);
    view.influenceSets = {&set, 1};
  }
  TypedMesh(const TypedMesh&) = delete;
  TypedMesh& operator=(const TypedMesh&) = delete;
};

/// Components of a type and what they stand for.
template <typename Stored>
struct Values {
  ComponentType type;
  std::vector<Stored> stored;
  std::vector<double> values;
};

const Values<std::uint16_t> halves{ComponentType::float16,
                                   {0x3c00, 0xc000, 0x0001, 0x03ff, 0x0400, 0x7bff, 0xfbff, 0x3555,
                                    0x8001, 0x0000, 0x4248, 0xb800},
                                   {1, -2, 0x1p-24, 1023 * 0x1p-24, 0x1p-14, 65504, -65504,
                                    1365 * 0x1p-12, -0x1p-24, 0, 3.140625, -0.5}};
const Values<std::int16_t> snorm16{
    ComponentType::snorm16,
    {32767, -32767, -32768, 0, 1, -1, 16384, 100, -100, 7, 30000, -30000},
    {1, -1, -1, 0, 1 / 32767.0, -1 / 32767.0, 16384 / 32767.0, 100 / 32767.0, -100 / 32767.0,
     7 / 32767.0, 30000 / 32767.0, -30000 / 32767.0}};
const Values<std::uint16_t> unorm16{
    ComponentType::unorm16,
    {65535, 0, 1, 32768, 65534, 2, 3, 4, 5, 6, 7, 60000},
    {1, 0, 1 / 65535.0, 32768 / 65535.0, 65534 / 65535.0, 2 / 65535.0, 3 / 65535.0, 4 / 65535.0,
     5 / 65535.0, 6 / 65535.0, 7 / 65535.0, 60000 / 65535.0}};
const Values<std::int8_t> snorm8{ComponentType::snorm8,
                                 {127, -127, -128, 0, 1, -1, 64, 100, -100, 7, 30, -30},
                                 {1, -1, -1, 0, 1 / 127.0, -1 / 127.0, 64 / 127.0, 100 / 127.0,
                                  -100 / 127.0, 7 / 127.0, 30 / 127.0, -30 / 127.0}};
const Values<float> floats{
    ComponentType::float32,
    {1, -2, 1e-30f, 3e38f, 0, 0.1f, -0.3f, 7, 8, 9, 10, 11},
    {1, -2, static_cast<double>(1e-30f), static_cast<double>(3e38f), 0, static_cast<double>(0.1f),
     static_cast<double>(-0.3f), 7, 8, 9, 10, 11}};

/// 12 components are 4 elements of 3, or 3 of 4.
template <typename Stored>
void expectPositions(const Values<Stored>& table, std::array<float, 3> scale,
                     std::array<float, 3> offset) {
  for (const std::uint32_t components : {3u, 4u}) {
    TypedMesh mesh(12 / components);
    mesh.view.positions = viewOf(table.stored, table.type, components);
    mesh.view.positionScale = scale;
    mesh.view.positionOffset = offset;
    const Blob blob(packed(mesh.view, 1).bytes());
    for (std::uint32_t vertex = 0; vertex < 12 / components; ++vertex) {
      for (std::uint32_t i = 0; i < 3; ++i) {
        const double expected =
            table.values[vertex * components + i] * static_cast<double>(scale[i]) +
            static_cast<double>(offset[i]);
        EXPECT_EQ(blob.position(vertex, i), static_cast<float>(expected)) << vertex << ", " << i;
      }
    }
  }
}

TEST(Pack, PositionsOfEveryTypeAreScaledAndMoved) {
  const std::array<float, 3> one{1, 1, 1}, none{0, 0, 0};
  const std::array<float, 3> scale{0.5f, -3, 0.01f}, offset{100, -0.25f, 1e-6f};
  for (const auto& [by, from] : {std::pair{one, none}, {scale, offset}}) {
    expectPositions(floats, by, from);
    expectPositions(halves, by, from);
    expectPositions(snorm16, by, from);
    expectPositions(unorm16, by, from);
  }
}

template <typename Stored>
void expectDirections(const Values<Stored>& table) {
  for (const std::uint32_t components : {3u, 4u}) {
    TypedMesh mesh(12 / components);
    mesh.view.normals = viewOf(table.stored, table.type, components);
    if (components == 4) mesh.view.tangents = mesh.view.normals;
    // Of positions only.
    mesh.view.positionScale = {2, 2, 2};
    mesh.view.positionOffset = {5, 5, 5};
    const PackedMesh result = packed(mesh.view, 1);
    EXPECT_EQ(result.info().hasTangents, components == 4);
    const Blob blob(result.bytes());
    for (std::uint32_t vertex = 0; vertex < 12 / components; ++vertex) {
      for (std::uint32_t i = 0; i < components; ++i) {
        const auto expected = static_cast<float>(table.values[vertex * components + i]);
        if (i < 3) {
          EXPECT_EQ(blob.normal(vertex, i), expected) << vertex << ", " << i;
        }
        if (components == 4) {
          EXPECT_EQ(blob.tangent(vertex, i), expected) << vertex << ", " << i;
        }
      }
    }
  }
}

TEST(Pack, NormalsAndTangentsOfEveryType) {
  expectDirections(floats);
  expectDirections(halves);
  expectDirections(snorm16);
  expectDirections(snorm8);
}

TEST(Pack, WithoutTangents) {
  TypedMesh mesh(4);
  EXPECT_EQ(Blob(packed(mesh.view, 1).bytes()).word(header::tangents), 0u);
  EXPECT_FALSE(packed(mesh.view, 1).info().hasTangents);
}

// What is not read may be anything.
TEST(Pack, AFourthComponentOfPositionsAndNormalsIsNotRead) {
  TypedMesh mesh(2);
  const std::vector<float> values{1, 2, 3, nan, 4, 5, 6, -nan};
  mesh.view.positions = mesh.view.normals = viewOf(values, ComponentType::float32, 4);
  const Blob blob(packed(mesh.view, 1).bytes());
  EXPECT_EQ(blob.position(1, 2), 6.0f);
  EXPECT_EQ(blob.normal(1, 0), 4.0f);
}

// ---- Influences

TEST(Pack, WhatOnlySomeMethodsWantStandsVertexByVertex) {
  for (const std::uint32_t vertices : {1u, 64u, 65u, 1234u}) {
    OwnedMesh mesh = slottedMesh(vertices, vertices, 3, 20);
    const std::size_t before = packed(mesh.view(), 20).bytes().size();
    for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
      const auto number = static_cast<float>(vertex);
      mesh.centersOfRotation.insert(mesh.centersOfRotation.end(), {number, -number, number / 2});
      mesh.dualQuaternionWeights.push_back(number / static_cast<float>(vertices));
      mesh.bulgeStrengths.push_back(1 - number / static_cast<float>(vertices));
    }
    const PackedMesh result = packed(mesh.view(), 20);
    EXPECT_TRUE(result.info().hasCentersOfRotation);
    const Blob blob(result.bytes());
    for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
      ASSERT_NO_FATAL_FAILURE(expectVertex(blob, mesh, vertex));
      for (std::uint32_t i = 0; i < 3; ++i)
        ASSERT_EQ(blob.center(vertex, i), mesh.centersOfRotation[vertex * 3 + i]);
      ASSERT_EQ(blob.dualQuaternionWeight(vertex), mesh.dualQuaternionWeights[vertex]);
      ASSERT_EQ(blob.bulgeStrength(vertex), mesh.bulgeStrengths[vertex]);
    }
    // Four words and one and one, and what fills up to 16 bytes.
    EXPECT_GE(result.bytes().size() + 16, before + 24 * std::size_t{vertices});
    EXPECT_LE(result.bytes().size(), before + 24 * std::size_t{vertices} + 16);
  }
}

TEST(Pack, SharesOfTheWholeMeshStandInTheHeader) {
  OwnedMesh mesh = slottedMesh(1, 10, 3, 20);
  const PackedMesh plain = packed(mesh.view(), 20);
  EXPECT_FALSE(plain.info().hasCentersOfRotation);
  const Blob blob(plain.bytes());
  EXPECT_EQ(blob.word(header::centers), 0u);
  EXPECT_EQ(blob.word(header::dualQuaternionWeights), 0u);
  EXPECT_EQ(blob.word(header::bulgeStrengths), 0u);
  EXPECT_EQ(blob.dualQuaternionWeight(0), 0.5f) << "as mesh.h has it";
  EXPECT_EQ(blob.bulgeStrength(0), 1.0f);
  for (const float share : {0.0f, 0.125f, 1.0f}) {
    MeshView view = mesh.view();
    view.dualQuaternionWeight = share;
    view.bulgeStrength = 1 - share;
    const PackedMesh changed = packed(view, 20);
    EXPECT_EQ(Blob(changed.bytes()).dualQuaternionWeight(9), share);
    EXPECT_EQ(Blob(changed.bytes()).bulgeStrength(9), 1 - share);
    EXPECT_EQ(changed.bytes().size(), plain.bytes().size()) << "they cost nothing";
    const Result<PackedMesh> stored = PackedMesh::fromBytes(changed.bytes());
    ASSERT_TRUE(stored.ok());
    EXPECT_EQ(Blob(stored->bytes()).dualQuaternionWeight(3), share);
  }
}

TEST(Pack, SharesOfEveryTypeAndStride) {
  OwnedMesh mesh = slottedMesh(2, 5, 3, 20);
  const std::vector<std::uint8_t> bytes{0, 9, 64, 9, 128, 9, 254, 9, 255};  // every other one
  const std::vector<std::uint16_t> shorts{0, 1, 32768, 65534, 65535};
  const std::vector<float> gapped{0, 9, 0.25f, 9, 0.5f, 9, 0.75f, 9, 1};
  const std::pair<AttributeView, std::array<float, 5>> cases[] = {
      {{bytes.data(), 5, 2, ComponentType::unorm8, 1},
       {0, 64 / 255.0f, 128 / 255.0f, 254 / 255.0f, 1}},
      {{shorts.data(), 5, 2, ComponentType::unorm16, 1},
       {0, 1 / 65535.0f, 32768 / 65535.0f, 65534 / 65535.0f, 1}},
      {{gapped.data(), 5, 8, ComponentType::float32, 1}, {0, 0.25f, 0.5f, 0.75f, 1}}};
  for (const auto& [view, expected] : cases) {
    MeshView shared = mesh.view();
    shared.dualQuaternionWeights = shared.bulgeStrengths = view;
    shared.dualQuaternionWeight = shared.bulgeStrength = nan;  // not looked at
    const PackedMesh result = packed(shared, 20);
    const Blob blob(result.bytes());
    for (std::uint32_t vertex = 0; vertex < 5; ++vertex) {
      EXPECT_EQ(blob.dualQuaternionWeight(vertex), expected[vertex]);
      EXPECT_EQ(blob.bulgeStrength(vertex), expected[vertex]);
    }
  }
}

TEST(Pack, InfluencesOfAllSetsBelongTogether) {
  const std::uint32_t joints0[] = {4, 5}, joints1[] = {6, 4};
  const float weights0[] = {0.2f, 0.1f}, weights1[] = {0.25f, 0.45f}, position[] = {0, 0, 0};
  const InfluenceSet sets[] = {
      {{joints0, 1, 8, ComponentType::uint32, 2}, attributeView(weights0, 1, 2)},
      {{joints1, 1, 8, ComponentType::uint32, 2}, attributeView(weights1, 1, 2)}};
  MeshView mesh;
  mesh.vertexCount = 1;
  mesh.positions = attributeView(position, 1, 3);
  mesh.influenceSets = sets;
  const std::vector<BlobInfluence> influences = Blob(packed(mesh, 7).bytes()).influences(0);
  ASSERT_EQ(influences.size(), 3u);
  EXPECT_EQ(influences[0].joint, 4u);
  EXPECT_NEAR(influences[0].weight, 0.65f, 1e-7f);
  EXPECT_EQ(influences[1].joint, 6u);
  EXPECT_EQ(influences[2].joint, 5u);
}

TEST(Pack, RefusesWhatValidateRefuses) {
  const auto refused = [](OwnedMesh mesh, std::uint32_t jointCount, const std::string& sentence) {
    const Result<PackedMesh> result = pack(mesh.view(), jointCount);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::invalidMesh);
    // An empty mesh is not to be mended.
    const char* hint = mesh.positions.empty() ? "" : "; repair() can fix it";
    EXPECT_EQ(result.error().message, sentence + hint);
  };
  OwnedMesh mesh = slottedMesh(1, 65, 2, 10);
  mesh.joints[64 * 2] = 31;
  mesh.weights[64 * 2] = 1;
  refused(mesh, 24, "mesh 'slotted', vertex 64: joint 31 is outside the pose of 24 joints");
  mesh.weights[64 * 2] = nan;
  refused(mesh, 24, "mesh 'slotted', vertex 64: the weight of joint 31 is not finite");
  mesh.weights[64 * 2] = -1;
  refused(mesh, 24, "mesh 'slotted', vertex 64: the weight of joint 31 is negative");
  // A tolerated problem that comes first in the mesh does not hide one that is refused.
  mesh.weights[0] = 17;
  refused(mesh, 24, "mesh 'slotted', vertex 64: the weight of joint 31 is negative");
  mesh = slottedMesh(1, 65, 2, 10);
  mesh.normals[3] = nan;
  refused(mesh, 24, "mesh 'slotted', vertex 1: the normal is not finite");
  refused(OwnedMesh{}, 24, "mesh 'random': it has no vertices");
}

TEST(Pack, RefusesPosesThatCannotBe) {
  OwnedMesh mesh = slottedMesh(1, 65, 2, 10);
  for (const std::uint32_t jointCount : {0u, 65537u, 0xffffffffu}) {
    const Result<PackedMesh> result = pack(mesh.view(), jointCount);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(result.error().message.find("mesh 'slotted'"), std::string::npos);
    EXPECT_NE(result.error().message.find(std::to_string(jointCount)), std::string::npos);
  }
}

}  // namespace
}  // namespace dermis::test
