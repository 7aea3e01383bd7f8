// pack: what it stores for every vertex. The blob is read by the words of shaders/abi.h.

#include "dermis/pack.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "core_blob.h"
#include "dermis/types.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

/// `influences` slots a vertex, some empty, joints possibly twice.
OwnedMesh slottedMesh(std::uint32_t seed, std::uint32_t vertices, std::uint32_t influences,
                      std::uint32_t joints) {
  std::mt19937 engine(seed);
  const auto below = [&](std::uint32_t count) {
    return std::uniform_int_distribution<std::uint32_t>(0, count - 1)(engine);
  };
  OwnedMesh mesh;
  mesh.name = "slotted";
  mesh.influencesPerVertex = influences;
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    for (int i = 0; i < 3; ++i) {
      mesh.positions.push_back(static_cast<float>(below(1000)));
      mesh.normals.push_back(static_cast<float>(below(1000)));
    }
    const std::uint32_t used = below(influences + 1);
    for (std::uint32_t slot = 0; slot < influences; ++slot) {
      mesh.joints.push_back(below(joints));
      mesh.weights.push_back(below(influences) < used ? static_cast<float>(1 + below(8)) / 7.0f
                                                      : 0.0f);
    }
  }
  return mesh;
}

PackedMesh packed(const MeshView& mesh, std::uint32_t jointCount) {
  Result<PackedMesh> result = pack(mesh, jointCount);
  EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
  return std::move(*result);
}

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
    // The first takes what rounding the others leaves over.
    ASSERT_NEAR(static_cast<double>(influences[i].weight), found->second / expectedSum,
                i == 0 ? 6e-8 * static_cast<double>(influences.size()) : 3e-8);
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
    ASSERT_LE(std::abs(sum - 1), 6e-8) << vertex;
  }
  // What is left of the slots is empty, and harmless to read.
  const std::uint32_t slots = blob.slotsOfBlock(vertex / abi::BLOCK_VERTICES);
  ASSERT_LE(influences.size(), slots);
  for (std::uint32_t slot = static_cast<std::uint32_t>(influences.size()); slot < slots; ++slot) {
    ASSERT_EQ(blob.slot(vertex, slot).weight, 0.0f);
    ASSERT_LT(blob.slot(vertex, slot).joint, blob.word(abi::MESH_HEADER_REQUIRED_JOINTS));
  }
}

void expectPacked(OwnedMesh& mesh, std::uint32_t jointCount) {
  const PackedMesh result = packed(mesh.view(), jointCount);
  const Blob blob(result.bytes());
  const std::uint32_t vertices = mesh.vertexCount();
  ASSERT_EQ(result.bytes().size() % packedMeshAlignment, 0u);
  ASSERT_EQ(blob.word(abi::MESH_HEADER_MAGIC), abi::MESH_MAGIC);
  ASSERT_EQ(blob.word(abi::MESH_HEADER_VERSION), abi::MESH_VERSION);
  ASSERT_EQ(blob.word(abi::MESH_HEADER_WORDS_TOTAL), blob.size());
  ASSERT_EQ(blob.vertexCount(), vertices);
  ASSERT_EQ(result.vertexCount(), vertices);
  ASSERT_EQ(result.hasNormals(), !mesh.normals.empty());
  Blob sealed = blob;
  sealed.seal();
  ASSERT_EQ(sealed.word(abi::MESH_HEADER_CHECKSUM), blob.word(abi::MESH_HEADER_CHECKSUM));

  std::uint32_t required = 1;
  std::size_t most = 0;
  std::vector<std::size_t> mostOfBlock((vertices + 63) / 64, 0);
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    expectVertex(blob, mesh, vertex);
    const auto weights = weightsOf(mesh, vertex);
    if (!weights.empty()) required = std::max(required, weights.rbegin()->first + 1);
    most = std::max(most, weights.size());
    mostOfBlock[vertex / 64] = std::max(mostOfBlock[vertex / 64], weights.size());
  }
  EXPECT_EQ(result.requiredJoints(), required);
  EXPECT_EQ(result.maxInfluences(), most);
  // A header, attributes, a record a block, rows of weights and of pairs of joints: nothing else.
  std::size_t words = abi::MESH_HEADER_WORDS + mesh.positions.size() + mesh.normals.size();
  for (std::uint32_t block = 0; block < mostOfBlock.size(); ++block) {
    EXPECT_EQ(blob.slotsOfBlock(block), mostOfBlock[block]) << "block " << block;
    words += abi::BLOCK_WORDS + 64 * (mostOfBlock[block] + (mostOfBlock[block] + 1) / 2);
  }
  EXPECT_EQ(blob.size(), (words + 3) / 4 * 4);
}

class PackCounts
    : public ::testing::TestWithParam<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>> {};

TEST_P(PackCounts, StoresEveryVertexAsAbiHSays) {
  const auto [vertices, influences, joints] = GetParam();
  OwnedMesh mesh = slottedMesh(vertices * 131 + influences, vertices, influences, joints);
  expectPacked(mesh, joints);
  expectPacked(mesh, maxPaletteJoints);
}

INSTANTIATE_TEST_SUITE_P(Pack, PackCounts,
                         ::testing::Combine(::testing::Values(1u, 63u, 64u, 65u, 128u, 1234u),
                                            ::testing::Values(1u, 2u, 3u, 4u, 5u, 8u, 17u),
                                            ::testing::Values(1u, 5u, 300u, 65536u)));

OwnedMesh oneVertex(std::vector<std::uint32_t> joints, std::vector<float> weights) {
  OwnedMesh mesh;
  mesh.name = "one";
  mesh.positions = {1, 2, 3};
  mesh.influencesPerVertex = static_cast<std::uint32_t>(joints.size());
  mesh.joints = std::move(joints);
  mesh.weights = std::move(weights);
  return mesh;
}

std::vector<BlobInfluence> packedInfluences(std::vector<std::uint32_t> joints,
                                            std::vector<float> weights) {
  OwnedMesh mesh = oneVertex(std::move(joints), std::move(weights));
  return Blob(packed(mesh.view(), maxPaletteJoints).bytes()).influences(0);
}

TEST(Pack, TheHighestJointFits) {
  OwnedMesh mesh = oneVertex({65535, 65534, 0}, {0.5f, 0.25f, 0.25f});
  const PackedMesh result = packed(mesh.view(), 65536);
  EXPECT_EQ(result.requiredJoints(), 65536u);
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
  EXPECT_EQ(result.maxInfluences(), 0u);
  EXPECT_EQ(result.requiredJoints(), 1u);
  EXPECT_TRUE(PackedMesh::fromBytes(result.bytes()).ok());
}

TEST(Pack, WithoutNormals) {
  OwnedMesh mesh = slottedMesh(1, 65, 4, 10);
  const std::size_t size = packed(mesh.view(), 10).bytes().size();
  mesh.normals.clear();
  const PackedMesh result = packed(mesh.view(), 10);
  EXPECT_FALSE(result.hasNormals());
  EXPECT_EQ(Blob(result.bytes()).word(abi::MESH_HEADER_NORMALS), 0u);
  EXPECT_NEAR(static_cast<double>(size - result.bytes().size()), 65 * 12, 16);
  EXPECT_EQ(Blob(result.bytes()).position(64, 2), mesh.positions[64 * 3 + 2]);
}

TEST(Pack, ThePivotIsTheStrongestTheLowestJointOnATie) {
  EXPECT_EQ(packedInfluences({9, 4, 7}, {0.2f, 0.5f, 0.3f})[0].joint, 4u);
  EXPECT_EQ(packedInfluences({9, 4, 7}, {0.45f, 0.1f, 0.45f})[0].joint, 7u);
  EXPECT_EQ(packedInfluences({9, 4, 7, 5}, {0.25f, 0.25f, 0.25f, 0.25f})[0].joint, 4u);
}

TEST(Pack, DuplicatesAreAddedUpBeforeThePivotIsChosen) {
  const std::vector<BlobInfluence> influences =
      packedInfluences({9, 4, 9, 4, 2}, {0.25f, 0.125f, 0.125f, 0.125f, 0.375f});
  ASSERT_EQ(influences.size(), 3u);
  EXPECT_EQ(influences[0].joint, 2u);  // 0.375, a tie with joint 9
  EXPECT_EQ(influences[1].joint, 9u);
  EXPECT_EQ(influences[2].joint, 4u);
  EXPECT_EQ(influences[1].weight, 0.375f);
  EXPECT_EQ(influences[2].weight, 0.25f);
  EXPECT_EQ(packedInfluences({9, 4, 9}, {0.3f, 0.4f, 0.3f})[0].joint, 9u);
}

// The tie rule is about the weights as stored: 60/255 + 67/255 is 127/255, whatever double makes of
// the quotients.
TEST(Pack, WeightsOfOneJointThatAddUpToATieAreATie) {
  const std::uint8_t joints[] = {3, 3, 8};
  const float position[] = {1, 2, 3};
  for (const bool shorts : {false, true}) {
    int wrong = 0;
    for (std::uint32_t total = 2; total <= 127; ++total) {
      for (std::uint32_t part = 1; 2 * part <= total; ++part) {
        const std::uint8_t bytes[] = {static_cast<std::uint8_t>(part),
                                      static_cast<std::uint8_t>(total - part),
                                      static_cast<std::uint8_t>(total)};
        const std::uint16_t words[] = {bytes[0], bytes[1], bytes[2]};
        const InfluenceSet set{{joints, 1, 3, ComponentType::uint8, 3},
                               shorts ? AttributeView{words, 1, 6, ComponentType::unorm16, 3}
                                      : AttributeView{bytes, 1, 3, ComponentType::unorm8, 3}};
        MeshView mesh;
        mesh.vertexCount = 1;
        mesh.positions = floatAttribute(position, 1, 3);
        mesh.influenceSets = {&set, 1};
        wrong += Blob(packed(mesh, 10).bytes()).influences(0)[0].joint == 3 ? 0 : 1;
      }
    }
    EXPECT_EQ(wrong, 0) << "of 4032 sums, as " << (shorts ? "unorm16" : "unorm8");
  }
}

TEST(Pack, Truth14_SlotsOfWeightZeroLeaveNoTrace) {
  OwnedMesh plain = oneVertex({5, 6}, {0.75f, 0.25f});
  OwnedMesh padded =
      oneVertex({0xffffffffu, 5, 65535, 6, 99999}, {0.0f, 0.75f, -0.0f, 0.25f, 0.0f});
  const PackedMesh a = packed(plain.view(), 7), b = packed(padded.view(), 7);
  EXPECT_TRUE(std::ranges::equal(a.bytes(), b.bytes()));
}

TEST(Pack, WeightsAreNormalised) {
  const std::vector<BlobInfluence> influences = packedInfluences({0, 1, 2}, {6.0f, 1.0f, 3.0f});
  ASSERT_EQ(influences.size(), 3u);
  EXPECT_NEAR(influences[0].weight, 0.6f, 6e-8f);
  EXPECT_EQ(influences[1].weight, 0.3f);
  EXPECT_EQ(influences[2].weight, 0.1f);
  EXPECT_EQ(packedInfluences({3}, {1e-30f})[0].weight, 1.0f);
  EXPECT_EQ(packedInfluences({3, 4}, {3e38f, 3e38f})[0].weight, 0.5f);
}

TEST(Pack, WeightsThatVanishWhenRoundedAreDropped) {
  OwnedMesh mesh = oneVertex({1, 2}, {1e-45f, 1e30f});
  const PackedMesh result = packed(mesh.view(), 3);
  const std::vector<BlobInfluence> influences = Blob(result.bytes()).influences(0);
  ASSERT_EQ(influences.size(), 1u);
  EXPECT_EQ(influences[0].joint, 2u);
  EXPECT_EQ(influences[0].weight, 1.0f);
  EXPECT_EQ(result.maxInfluences(), 1u);
}

TEST(Pack, ManyEqualWeightsSumToOne) {
  for (const std::uint32_t count : {3u, 7u, 100u, 1000u}) {
    std::vector<std::uint32_t> joints(count);
    for (std::uint32_t i = 0; i < count; ++i) joints[i] = count - 1 - i;
    const std::vector<BlobInfluence> influences =
        packedInfluences(joints, std::vector<float>(count, 0.1f));
    ASSERT_EQ(influences.size(), count);
    double sum = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      EXPECT_EQ(influences[i].joint, i);  // by rising joint where weights tie
      EXPECT_GT(influences[i].weight, 0.0f);
      sum += static_cast<double>(influences[i].weight);
    }
    EXPECT_NEAR(sum, 1, 6e-8);
  }
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
}

TEST(Pack, InfluencesOfAllSetsBelongTogether) {
  const std::uint32_t joints0[] = {4, 5}, joints1[] = {6, 4};
  const float weights0[] = {0.2f, 0.1f}, weights1[] = {0.25f, 0.45f}, position[] = {0, 0, 0};
  const InfluenceSet sets[] = {
      {{joints0, 1, 8, ComponentType::uint32, 2}, floatAttribute(weights0, 1, 2)},
      {{joints1, 1, 8, ComponentType::uint32, 2}, floatAttribute(weights1, 1, 2)}};
  MeshView mesh;
  mesh.vertexCount = 1;
  mesh.positions = floatAttribute(position, 1, 3);
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
    EXPECT_EQ(result.error().message, sentence);
  };
  OwnedMesh mesh = slottedMesh(1, 65, 2, 10);
  mesh.joints[64 * 2] = 31;
  mesh.weights[64 * 2] = 1;
  refused(mesh, 24, "mesh 'slotted', vertex 64: joint 31 is outside the palette of 24");
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

TEST(Pack, RefusesPalettesThatCannotBe) {
  OwnedMesh mesh = slottedMesh(1, 65, 2, 10);
  for (const std::uint32_t jointCount : {0u, 65537u, 0xffffffffu}) {
    const Result<PackedMesh> result = pack(mesh.view(), jointCount);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(result.error().message.find("mesh 'slotted'"), std::string::npos);
    EXPECT_NE(result.error().message.find(std::to_string(jointCount)), std::string::npos);
  }
}

// ---- Stored blobs

TEST(PackedBlob, ComesBackFromItsBytes) {
  for (const std::uint32_t vertices : {1u, 63u, 64u, 65u, 1234u}) {
    OwnedMesh mesh = slottedMesh(vertices, vertices, 5, 40);
    const PackedMesh before = packed(mesh.view(), 40);
    const Result<PackedMesh> after = PackedMesh::fromBytes(before.bytes());
    ASSERT_TRUE(after.ok()) << after.error().message;
    EXPECT_TRUE(std::ranges::equal(after->bytes(), before.bytes()));
    EXPECT_EQ(after->vertexCount(), before.vertexCount());
    EXPECT_EQ(after->requiredJoints(), before.requiredJoints());
    EXPECT_EQ(after->maxInfluences(), before.maxInfluences());
    EXPECT_EQ(after->hasNormals(), before.hasNormals());
  }
}

TEST(PackedBlob, IsCopiedFromAnyAddress) {
  OwnedMesh mesh = slottedMesh(3, 65, 5, 40);
  const PackedMesh before = packed(mesh.view(), 40);
  std::vector<std::byte> odd(before.bytes().size() + 1);
  std::ranges::copy(before.bytes(), odd.begin() + 1);
  const Result<PackedMesh> after = PackedMesh::fromBytes(std::span(odd).subspan(1));
  ASSERT_TRUE(after.ok());
  std::ranges::fill(odd, std::byte{0});
  EXPECT_TRUE(std::ranges::equal(after->bytes(), before.bytes()));
}

struct DamagedBlob : public ::testing::Test {
  DamagedBlob() : mesh(damagedMesh()), good(packed(mesh.view(), 9)), blob(good.bytes()) {}

  /// Two blocks of three slots, joints up to 8.
  static OwnedMesh damagedMesh() {
    OwnedMesh result = slottedMesh(5, 66, 3, 9);
    for (const std::size_t vertex : {7u, 65u}) {
      for (const std::uint32_t slot : {0u, 1u, 2u}) {
        result.joints[vertex * 3 + slot] = 8 - slot;
        result.weights[vertex * 3 + slot] = 0.5f;
      }
    }
    return result;
  }

  void expectRefused(std::span<const std::byte> bytes, ErrorCode code, const std::string& what) {
    const Result<PackedMesh> result = PackedMesh::fromBytes(bytes);
    ASSERT_FALSE(result.ok()) << what;
    EXPECT_EQ(result.error().code, code) << what << ": " << result.error().message;
    EXPECT_EQ(result.error().message.find("packed mesh: "), 0u) << result.error().message;
  }

  /// Header word `index` changed, the checksum made right again.
  void expectHeaderRefused(std::uint32_t index, std::uint32_t value) {
    Blob changed = blob;
    changed.words()[index] = value;
    changed.seal();
    expectRefused(changed.bytes(), ErrorCode::invalidData,
                  "header word " + std::to_string(index) + " = " + std::to_string(value));
  }

  OwnedMesh mesh;
  PackedMesh good;
  Blob blob;
};

TEST_F(DamagedBlob, EveryTruncationIsRefused) {
  for (std::size_t size = 0; size < good.bytes().size(); ++size) {
    expectRefused(good.bytes().first(size), ErrorCode::invalidData,
                  "the first " + std::to_string(size) + " bytes");
  }
}

TEST_F(DamagedBlob, TooManyBytesAreRefused) {
  std::vector<std::byte> longer(good.bytes().begin(), good.bytes().end());
  for (int extra = 1; extra <= 32; ++extra) {
    longer.push_back(std::byte{0});
    expectRefused(longer, ErrorCode::invalidData, "longer by " + std::to_string(extra));
  }
}

TEST_F(DamagedBlob, EveryFlippedBitIsRefused) {
  std::vector<std::byte> bytes(good.bytes().begin(), good.bytes().end());
  for (std::size_t index = 0; index < bytes.size(); ++index) {
    for (int bit = 0; bit < 8; ++bit) {
      bytes[index] ^= std::byte{1} << bit;
      const Result<PackedMesh> result = PackedMesh::fromBytes(bytes);
      ASSERT_FALSE(result.ok()) << "byte " << index << ", bit " << bit;
      const bool version = index / 4 == abi::MESH_HEADER_VERSION;
      ASSERT_EQ(result.error().code,
                version ? ErrorCode::unsupportedVersion : ErrorCode::invalidData);
      bytes[index] ^= std::byte{1} << bit;
    }
  }
}

TEST_F(DamagedBlob, SwappedWordsAreRefused) {
  for (std::size_t index = abi::MESH_HEADER_CHECKSUM + 1; index + 1 < blob.size(); ++index) {
    Blob changed = blob;
    if (changed.word(index) == changed.word(index + 1)) continue;
    std::swap(changed.words()[index], changed.words()[index + 1]);
    expectRefused(changed.bytes(), ErrorCode::invalidData, "word " + std::to_string(index));
  }
}

TEST_F(DamagedBlob, AnotherVersionIsNamed) {
  for (const std::uint32_t version : {0u, 2u, 0xffffffffu}) {
    Blob changed = blob;
    changed.words()[abi::MESH_HEADER_VERSION] = version;
    changed.seal();
    const Result<PackedMesh> result = PackedMesh::fromBytes(changed.bytes());
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::unsupportedVersion);
    EXPECT_NE(result.error().message.find("version " + std::to_string(version)), std::string::npos);
  }
}

// A checksum is no proof: what a kernel would read with must be checked by itself.
TEST_F(DamagedBlob, EveryHeaderFieldIsChecked) {
  const auto size = static_cast<std::uint32_t>(blob.size());
  expectHeaderRefused(abi::MESH_HEADER_MAGIC, 0);
  for (const std::uint32_t words : {0u, size - 4, size + 4, 0xffffffffu}) {
    expectHeaderRefused(abi::MESH_HEADER_WORDS_TOTAL, words);
  }
  // 66 vertices need two blocks; a third block record, or too many positions, is not there.
  for (const std::uint32_t vertices : {0u, 100000u, 0x55555556u, 0x80000000u, 0xffffffffu}) {
    expectHeaderRefused(abi::MESH_HEADER_VERTEX_COUNT, vertices);
  }
  for (const std::uint32_t joints : {0u, 1u, good.requiredJoints() - 1, 65537u, 0xffffffffu}) {
    expectHeaderRefused(abi::MESH_HEADER_REQUIRED_JOINTS, joints);
  }
  for (const std::uint32_t influences : {0u, 1u, good.maxInfluences() - 1}) {
    expectHeaderRefused(abi::MESH_HEADER_MAX_INFLUENCES, influences);
  }
  for (const std::uint32_t offset : {0u, abi::MESH_HEADER_WORDS - 1, size - 66 * 3 + 1, size,
                                     size + 1, 0x7fffffffu, 0xffffffffu}) {
    expectHeaderRefused(abi::MESH_HEADER_POSITIONS, offset);
    if (offset != 0) expectHeaderRefused(abi::MESH_HEADER_NORMALS, offset);
  }
  for (const std::uint32_t offset :
       {0u, abi::MESH_HEADER_WORDS - 1, size - 2 * 2 + 1, size, 0xffffffffu}) {
    expectHeaderRefused(abi::MESH_HEADER_BLOCKS, offset);
  }
}

TEST_F(DamagedBlob, BlocksThatLeaveTheBlobAreRefused) {
  const auto size = static_cast<std::uint32_t>(blob.size());
  const std::size_t record = blob.word(abi::MESH_HEADER_BLOCKS);
  for (std::uint32_t block = 0; block < 2; ++block) {
    const std::size_t at = record + block * abi::BLOCK_WORDS;
    const auto expectRefusedWith = [&](std::size_t word, std::uint32_t value) {
      Blob changed = blob;
      changed.words()[at + word] = value;
      changed.seal();
      expectRefused(changed.bytes(), ErrorCode::invalidData,
                    "block " + std::to_string(block) + ", word " + std::to_string(word) + " = " +
                        std::to_string(value));
    };
    const std::uint32_t rows = 64 * (3 + 2);  // three slots: three of weights, two of joints
    for (const std::uint32_t offset :
         {0u, abi::MESH_HEADER_WORDS - 1, size - rows + 1, size, 0xffffffffu, 0xffffffc0u}) {
      expectRefusedWith(abi::BLOCK_OFFSET, offset);
    }
    for (const std::uint32_t slots : {4u, 5u, 1000u, 0x7fffffffu, 0xffffffffu}) {
      expectRefusedWith(abi::BLOCK_SLOTS, slots);
    }
  }
}

// More slots than the header says, with the header's word raised to match: still no room.
TEST_F(DamagedBlob, SlotsWhoseRowsOverflowAreRefused) {
  const std::size_t record = blob.word(abi::MESH_HEADER_BLOCKS);
  for (const std::uint32_t slots : {1000u, 0x7fffffffu, 0xaaaaaaabu, 0xfffffffeu, 0xffffffffu}) {
    Blob changed = blob;
    changed.words()[record + abi::BLOCK_SLOTS] = slots;
    changed.words()[abi::MESH_HEADER_MAX_INFLUENCES] = 0xffffffffu;
    changed.seal();
    expectRefused(changed.bytes(), ErrorCode::invalidData, std::to_string(slots) + " slots");
  }
}

TEST_F(DamagedBlob, EveryJointIndexIsChecked) {
  ASSERT_EQ(good.requiredJoints(), 9u);
  for (std::uint32_t block = 0; block < 2; ++block) {
    const std::size_t record = blob.word(abi::MESH_HEADER_BLOCKS) + block * abi::BLOCK_WORDS;
    const std::uint32_t slots = blob.word(record + abi::BLOCK_SLOTS);
    const std::size_t joints = blob.word(record + abi::BLOCK_OFFSET) + slots * 64;
    for (std::size_t pair = joints; pair < joints + (slots + 1) / 2 * 64; ++pair) {
      for (const int shift : {0, 16}) {
        Blob changed = blob;
        changed.words()[pair] = (changed.word(pair) & (0xffff0000u >> shift)) | 9u << shift;
        changed.seal();
        expectRefused(changed.bytes(), ErrorCode::invalidData, "pair " + std::to_string(pair));
      }
    }
  }
}

// Without any weight there is no joint index to compare it with.
TEST(PackedBlob, APaletteOfNoJointsIsRefused) {
  OwnedMesh mesh = slottedMesh(1, 10, 4, 10);
  std::fill(mesh.weights.begin(), mesh.weights.end(), 0.0f);
  Blob blob(packed(mesh.view(), 10).bytes());
  for (const std::uint32_t joints : {0u, 65537u}) {
    blob.words()[abi::MESH_HEADER_REQUIRED_JOINTS] = joints;
    blob.seal();
    EXPECT_FALSE(PackedMesh::fromBytes(blob.bytes()).ok()) << joints;
  }
}

TEST(PackedBlob, NoBytesAreNoMesh) {
  const Result<PackedMesh> result = PackedMesh::fromBytes({});
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::invalidData);
}

// Random headers under a right checksum: refused, or good enough that nothing leaves the blob.
TEST(PackedBlob, NoRandomHeaderReachesOutside) {
  OwnedMesh mesh = slottedMesh(11, 70, 3, 9);
  const PackedMesh good = packed(mesh.view(), 9);
  std::mt19937 engine(1);
  int accepted = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    Blob changed(good.bytes());
    const std::size_t headerEnd = abi::MESH_HEADER_WORDS;
    const std::size_t blocks = changed.word(abi::MESH_HEADER_BLOCKS);
    for (int change = 0; change < 1 + trial % 2; ++change) {
      const std::size_t choice = engine() % (headerEnd - 4 + 4);
      const std::size_t word = choice < 4 ? blocks + choice : choice;
      const std::uint32_t values[] = {static_cast<std::uint32_t>(engine()),
                                      static_cast<std::uint32_t>(engine() % changed.size()),
                                      changed.word(word) + 1,
                                      changed.word(word) - 1,
                                      0u,
                                      0xffffffffu};
      changed.words()[word] = values[engine() % 6];
    }
    changed.words()[abi::MESH_HEADER_MAGIC] = abi::MESH_MAGIC;
    changed.words()[abi::MESH_HEADER_VERSION] = abi::MESH_VERSION;
    changed.seal();
    const Result<PackedMesh> result = PackedMesh::fromBytes(changed.bytes());
    if (!result) continue;
    ++accepted;
    const Blob blob(result->bytes());  // its accessors throw where they would leave the blob
    ASSERT_NO_THROW({
      for (std::uint32_t vertex = 0; vertex < blob.vertexCount(); ++vertex) {
        blob.position(vertex, 2);
        if (result->hasNormals()) blob.normal(vertex, 2);
        ASSERT_LE(blob.slotsOfBlock(vertex / 64), result->maxInfluences());
        for (std::uint32_t slot = 0; slot < blob.slotsOfBlock(vertex / 64); ++slot) {
          ASSERT_LT(blob.slot(vertex, slot).joint, result->requiredJoints());
        }
      }
    }) << trial;
  }
  EXPECT_GT(accepted, 0);
}

}  // namespace
}  // namespace dermis::test
