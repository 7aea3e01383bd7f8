// Stored packed meshes: what fromBytes takes, and everything that it refuses.

#include "dermis/mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>

#include "core_pack_meshes.h"

namespace dermis::test {
namespace {

/// A mesh with tangents, morph targets and what only some methods want, and its blob.
struct MorphedMesh {
  OwnedMesh mesh;
  std::vector<float> tangents;
  std::vector<OwnedTarget> targets;

  MorphedMesh(OwnedMesh owned, std::uint32_t seed)
      : mesh(std::move(owned)), tangents(std::size_t{mesh.vertexCount()} * 4, 1.0f) {
    targets.push_back(randomTarget(seed, mesh.vertexCount(), 2, true, true));
    targets.push_back(randomTarget(seed + 1, mesh.vertexCount(), 10000, true, true));  // nothing
    targets.push_back(randomTarget(seed + 2, mesh.vertexCount(), 5, false, false));
    for (OwnedTarget* target : {&targets[0], &targets[2]}) target->positions.back() = 1;
    mesh.centersOfRotation.assign(mesh.positions.size(), 0.5f);
    mesh.dualQuaternionWeights.assign(mesh.vertexCount(), 0.25f);
    mesh.bulgeStrengths.assign(mesh.vertexCount(), 0.75f);
  }
  PackedMesh pack(std::uint32_t jointCount) {
    MeshView view = mesh.view();
    view.tangents = viewOf(tangents, ComponentType::float32, 4);
    std::vector<MorphTargetView> views;
    for (const OwnedTarget& target : targets) views.push_back(target.view());
    view.morphTargets = views;
    return packed(view, jointCount);
  }
};

TEST(PackedBlob, ComesBackFromItsBytes) {
  for (const std::uint32_t vertices : {1u, 63u, 64u, 65u, 1234u}) {
    for (const bool morphs : {false, true}) {
      OwnedMesh mesh = slottedMesh(vertices, vertices, 5, 40);
      const PackedMesh before = morphs ? MorphedMesh(mesh, 1).pack(40) : packed(mesh.view(), 40);
      const Result<PackedMesh> after = PackedMesh::fromBytes(before.bytes());
      ASSERT_TRUE(after.ok()) << after.error().message;
      EXPECT_TRUE(sameBytes(*after, before));
      const MeshInfo info = after->info(), expected = before.info();
      EXPECT_EQ(info.byteSize, expected.byteSize);
      EXPECT_EQ(info.vertexCount, expected.vertexCount);
      EXPECT_EQ(info.requiredJoints, expected.requiredJoints);
      EXPECT_EQ(info.maxInfluences, expected.maxInfluences);
      EXPECT_EQ(info.morphTargetCount, morphs ? 3u : 0u);
      EXPECT_EQ(info.hasNormals, true);
      EXPECT_EQ(info.hasTangents, morphs);
      EXPECT_EQ(info.hasCentersOfRotation, morphs);
    }
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
  DamagedBlob() : good(MorphedMesh(damagedMesh(), 1).pack(9)), blob(good.bytes()) {}

  /// Two blocks of vertices, joints up to 8.
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

  /// Word `index` changed, the checksum made right again.
  static Blob changed(Blob blob, std::size_t index, std::uint32_t value) {
    blob.words().at(index) = value;
    blob.seal();
    return blob;
  }
  void expectRefusedWith(std::size_t index, std::uint32_t value) {
    expectRefused(changed(blob, index, value).bytes(), ErrorCode::invalidData,
                  "word " + std::to_string(index) + " = " + std::to_string(value));
  }
  std::uint32_t size() const { return static_cast<std::uint32_t>(blob.size()); }

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
      const bool version = index / 4 == header::version;
      ASSERT_EQ(result.error().code,
                version ? ErrorCode::unsupportedVersion : ErrorCode::invalidData);
      bytes[index] ^= std::byte{1} << bit;
    }
  }
}

TEST_F(DamagedBlob, SwappedWordsAreRefused) {
  int swapped = 0;
  for (std::size_t index = header::checksum + 1; index + 1 < blob.size(); ++index) {
    Blob changed = blob;
    const std::uint32_t difference = changed.word(index) ^ changed.word(index + 1);
    // FNV carries a change upwards only: of two words that differ in high bits alone too little is
    // left of the checksum.
    if ((difference & 0xffu) == 0) continue;
    std::swap(changed.words()[index], changed.words()[index + 1]);
    ++swapped;
    expectRefused(changed.bytes(), ErrorCode::invalidData, "word " + std::to_string(index));
  }
  EXPECT_GT(swapped, 100);
}

TEST_F(DamagedBlob, AnotherVersionIsNamed) {
  ASSERT_EQ(abi::MESH_VERSION, 6u);
  for (const std::uint32_t version : {0u, 1u, 2u, 3u, 4u, 5u, 7u, 0xffffffffu}) {
    const Result<PackedMesh> result =
        PackedMesh::fromBytes(changed(blob, header::version, version).bytes());
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::unsupportedVersion);
    EXPECT_NE(result.error().message.find("version " + std::to_string(version)), std::string::npos);
  }
}

// A checksum is no proof: what a kernel would read with must be checked by itself.
TEST_F(DamagedBlob, EveryHeaderFieldIsChecked) {
  expectRefusedWith(header::magic, 0);
  for (const std::uint32_t words : {0u, size() - 4, size() + 4, 0xffffffffu})
    expectRefusedWith(header::wordCount, words);
  for (const std::uint32_t vertices : {0u, 100000u, 0x55555556u, 0x80000000u, 0xffffffffu})
    expectRefusedWith(header::vertexCount, vertices);
  for (const std::uint32_t joints : {0u, 1u, 8u, 65537u, 0xffffffffu})
    expectRefusedWith(header::requiredJoints, joints);
  for (const std::uint32_t influences : {0u, 1u, good.info().maxInfluences - 1})
    expectRefusedWith(header::maxInfluences, influences);
  for (const std::uint32_t influences : {good.info().minInfluences + 1, 5u, 0xffffffffu})
    expectRefusedWith(header::minInfluences, influences);
  // Each section's offset: in the header, too late for what it holds, behind the end.
  const std::pair<std::uint32_t, std::uint32_t> sections[] = {
      {header::positions, 67 * 4},
      {header::normals, 66 * 4},
      {header::tangents, 66 * 4},
      {header::centers, 66 * 4},
      {header::dualQuaternionWeights, 66},
      {header::bulgeStrengths, 66},
      {header::influences, 2 * blob.word(blob.firstOf(66))},
      {header::morphs, 3 * abi::MORPH_WORDS}};
  for (const auto& [header, words] : sections) {
    const std::uint32_t late = (size() - words + 4) / 4 * 4;  // many stand at multiples of 4
    for (const std::uint32_t offset : {1u, abi::MESH_HEADER_WORDS - 4, late, size(), size() + 4,
                                       0x7ffffffcu, 0xfffffffcu, 0xffffffffu}) {
      expectRefusedWith(header, offset);
    }
    ASSERT_NE(blob.word(header), 0u) << "this blob has everything";
    const bool mayBeAbsent =
        header != header::positions && header != header::influences && header != header::morphs;
    if (!mayBeAbsent) expectRefusedWith(header, 0);
  }
  // Inside the blob, but not at a multiple of four words.
  for (const std::uint32_t header : {header::positions, header::normals, header::tangents,
                                     header::centers, header::influences, header::morphs}) {
    for (const std::uint32_t by : {1u, 2u, 3u}) {
      expectRefusedWith(header, blob.word(header) + by);
      expectRefusedWith(header, blob.word(header) - by);
    }
  }
  for (const std::uint32_t targets : {size(), size() / 4, 0x40000000u, 0x40000003u, 0xffffffffu})
    expectRefusedWith(header::morphCount, targets);
}

TEST_F(DamagedBlob, WhatOnlySomeMethodsWantMayBeAbsent) {
  Blob without = blob;
  for (const std::uint32_t header :
       {header::centers, header::dualQuaternionWeights, header::bulgeStrengths}) {
    without = changed(without, header, 0);
    const Result<PackedMesh> result = PackedMesh::fromBytes(without.bytes());
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_FALSE(result->info().hasCentersOfRotation);
  }
}

// Each vertex' influences follow those before it, as many as the header says at most.
TEST_F(DamagedBlob, InfluencesOutOfOrderAreRefused) {
  const std::uint32_t total = blob.word(blob.firstOf(66));
  for (std::uint32_t vertex = 0; vertex <= 66; ++vertex) {
    expectRefusedWith(blob.firstOf(vertex), 0xffffffffu);
    expectRefusedWith(blob.firstOf(vertex), 0x80000000u);
    if (vertex < 66) expectRefusedWith(blob.firstOf(vertex), total + 1);
    if (vertex > 1 && blob.word(blob.firstOf(vertex - 1)) != 0)
      expectRefusedWith(blob.firstOf(vertex), blob.word(blob.firstOf(vertex - 1)) - 1);
  }
  const std::uint32_t last = blob.word(blob.firstOf(65)) / 2 * 2;
  expectRefusedWith(blob.firstOf(66), last + (good.info().maxInfluences + 3) / 2 * 2);
  expectRefusedWith(blob.firstOf(66), total + 1);  // the end is that of a whole unit
}

// All of them follow each other, and the last lie behind the blob's end.
TEST_F(DamagedBlob, InfluencesOutsideTheBlobAreRefused) {
  for (const std::uint32_t by : {size(), 0x7fffff00u, 0x80000000u, 0xffffff00u}) {
    Blob changed = blob;
    for (std::uint32_t vertex = 0; vertex <= 66; ++vertex)
      changed.words()[blob.firstOf(vertex)] += by;
    changed.seal();
    expectRefused(changed.bytes(), ErrorCode::invalidData, "moved by " + std::to_string(by));
  }
}

TEST_F(DamagedBlob, EveryJointIndexIsChecked) {
  ASSERT_EQ(good.info().requiredJoints, 9u);
  const std::uint32_t count = blob.word(blob.firstOf(66));
  ASSERT_GT(count, 60u);
  for (std::uint32_t influence = 0; influence < count; ++influence) {
    for (const std::uint32_t joint : {9u, 65536u, 0xffffffffu})
      expectRefusedWith(blob.influenceWord(influence) + influenceJoint, joint);
  }
}

TEST_F(DamagedBlob, MorphRecordsThatLeaveTheBlobAreRefused) {
  for (const std::uint32_t target : {0u, 2u}) {
    const std::size_t record = blob.morphRecord(target);
    ASSERT_EQ(blob.word(record + morphBlockCount), 2u);
    // 66 vertices have two blocks.
    for (const std::uint32_t first : {1u, 2u, 0x7fffffffu, 0xfffffffeu, 0xffffffffu})
      expectRefusedWith(record + morphFirstBlock, first);
    for (const std::uint32_t count : {3u, 0x55555556u, 0x80000000u, 0xffffffffu})
      expectRefusedWith(record + morphBlockCount, count);
    for (const std::uint32_t offset :
         {0u, abi::MESH_HEADER_WORDS - 4, size() - 4, size(), 0x7ffffffcu, 0xfffffffcu})
      expectRefusedWith(record + morphBlocks, offset);
    // Kernels read four words at a time.
    for (const std::uint32_t misaligned : {1u, 2u, 3u})
      expectRefusedWith(record + morphBlocks, blob.word(record + morphBlocks) + misaligned);
    for (const std::uint32_t attributes : {8u, 15u, 0x80000001u, 0xffffffffu})
      expectRefusedWith(record + morphAttributes, attributes);
  }
}

// Or else checking the targets would take time in proportion to their number times the blob's size.
TEST_F(DamagedBlob, MorphTargetsThatShareBlocksAreRefused) {
  const std::uint32_t first = blob.word(blob.morphRecord(0) + morphBlocks);
  expectRefusedWith(blob.morphRecord(2) + morphBlocks, first);
  expectRefusedWith(blob.morphRecord(2) + morphBlocks, first + abi::MORPH_BLOCK_WORDS);
}

TEST_F(DamagedBlob, DisplacementsOutsideTheBlobAreRefused) {
  for (const std::uint32_t target : {0u, 2u}) {
    const std::uint32_t words = target == 0 ? 9 : 3;
    for (std::uint32_t block = 0; block < 2; ++block) {
      const std::size_t entry = blob.morphBlock(target, block);
      std::uint32_t displaced = 0;
      for (std::uint32_t lane = 0; lane < 64 && block * 64 + lane < 66; ++lane)
        displaced += blob.displacement(target, block * 64 + lane).has_value() ? 1u : 0u;
      ASSERT_GT(displaced, 0u);
      for (const std::uint32_t offset :
           {0u, abi::MESH_HEADER_WORDS - 1, size() - displaced * words + 1, size(), 0xfffffff0u}) {
        expectRefusedWith(entry + morphBlockDisplacements, offset);
      }
      // At the very end there is room for those that there are, and for no more.
      const Blob atEnd = changed(blob, entry + morphBlockDisplacements, size() - displaced * words);
      ASSERT_TRUE(PackedMesh::fromBytes(atEnd.bytes()).ok());
      // One more in the mask, high or low.
      for (const std::uint32_t half : {0u, 1u}) {
        const std::uint32_t mask = atEnd.word(entry + half);
        if (mask == 0xffffffffu) continue;
        expectRefused(changed(atEnd, entry + half, mask | (mask + 1)).bytes(),
                      ErrorCode::invalidData, "mask " + std::to_string(half));
      }
    }
  }
}

// Without any weight there is no joint index to compare it with.
TEST(PackedBlob, APoseOfNoJointsIsRefused) {
  OwnedMesh mesh = slottedMesh(1, 10, 4, 10);
  std::fill(mesh.weights.begin(), mesh.weights.end(), 0.0f);
  Blob blob(packed(mesh.view(), 10).bytes());
  for (const std::uint32_t joints : {0u, 65537u}) {
    blob.words()[header::requiredJoints] = joints;
    blob.seal();
    EXPECT_FALSE(PackedMesh::fromBytes(blob.bytes()).ok()) << joints;
  }
}

// Without targets, no other section contradicts the number.
TEST(PackedBlob, AMeshOfNoVerticesIsRefused) {
  OwnedMesh mesh = slottedMesh(1, 10, 4, 10);
  std::fill(mesh.weights.begin(), mesh.weights.end(), 0.0f);
  Blob blob(packed(mesh.view(), 10).bytes());
  blob.words()[header::vertexCount] = 0;
  blob.seal();
  EXPECT_FALSE(PackedMesh::fromBytes(blob.bytes()).ok());
}

// Nothing else tells that they would stand askew.
TEST(PackedBlob, InfluencesBetweenUnitsAreRefused) {
  OwnedMesh mesh = slottedMesh(1, 10, 4, 10);
  std::fill(mesh.weights.begin(), mesh.weights.end(), 0.0f);
  Blob blob(packed(mesh.view(), 10).bytes());
  for (const int off : {-4, -2, -1, 0}) {
    Blob changed = blob;
    changed.words()[header::influences] += static_cast<std::uint32_t>(off);
    changed.seal();
    EXPECT_EQ(PackedMesh::fromBytes(changed.bytes()).ok(), off % 4 == 0) << off;
  }
}

TEST(PackedBlob, NoBytesAreNoMesh) {
  const Result<PackedMesh> result = PackedMesh::fromBytes({});
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::invalidData);
}

/// Reads all that a kernel might; throws where that leaves the blob. The sum keeps it from being
/// optimized away.
float readEverything(const Blob& blob, const MeshInfo& info) {
  float sum = 0;
  for (std::uint32_t vertex = 0; vertex < blob.vertexCount(); ++vertex) {
    sum += blob.position(vertex, 2);
    if (info.hasNormals) sum += blob.normal(vertex, 2);
    if (info.hasTangents) sum += blob.tangent(vertex, 3);
    for (const BlobInfluence& influence : blob.influences(vertex)) {
      sum += influence.weight;
      if (influence.joint >= info.requiredJoints) throw std::out_of_range("joint");
    }
    if (blob.influences(vertex).size() > info.maxInfluences) throw std::out_of_range("influences");
    for (std::uint32_t target = 0; target < blob.morphCount(); ++target) {
      const auto displacement = blob.displacement(target, vertex);
      if (displacement) sum += displacement->position[0];
    }
  }
  return sum;
}

// Random words under a right checksum: refused, or good enough that nothing leaves the blob.
TEST_F(DamagedBlob, NoRandomWordReachesOutside) {
  std::vector<std::size_t> targets;  // words that say where something stands, or how much of it
  for (std::size_t word = header::wordCount; word < abi::MESH_HEADER_WORDS; ++word)
    targets.push_back(word);
  for (const std::uint32_t vertex : {0u, 1u, 33u, 64u, 65u, 66u})
    targets.push_back(blob.firstOf(vertex));
  for (std::uint32_t target = 0; target < 3; ++target) {
    for (std::size_t word = 0; word < abi::MORPH_WORDS; ++word)
      targets.push_back(blob.morphRecord(target) + word);
    if (blob.word(blob.morphRecord(target) + morphBlockCount) == 0) continue;
    for (std::size_t word = 0; word < 2 * abi::MORPH_BLOCK_WORDS; ++word)
      targets.push_back(blob.morphBlock(target, 0) + word);
  }
  std::mt19937 engine(1);
  int accepted = 0;
  for (int trial = 0; trial < 50000; ++trial) {
    Blob changed = blob;
    for (int change = 0; change < 1 + trial % 3; ++change) {
      const std::size_t word =
          engine() % 4 == 0 ? engine() % changed.size() : targets[engine() % targets.size()];
      const std::uint32_t values[] = {static_cast<std::uint32_t>(engine()),
                                      static_cast<std::uint32_t>(engine() % changed.size()),
                                      changed.word(word) + 1,
                                      changed.word(word) - 1,
                                      changed.word(word) ^ 1u << engine() % 32,
                                      0u,
                                      0xffffffffu};
      changed.words()[word] = values[engine() % std::size(values)];
    }
    changed.words()[header::magic] = abi::MESH_MAGIC;
    changed.words()[header::version] = abi::MESH_VERSION;
    changed.seal();
    const Result<PackedMesh> result = PackedMesh::fromBytes(changed.bytes());
    if (!result) continue;
    ++accepted;
    const Blob read(result->bytes());
    ASSERT_NO_THROW(readEverything(read, result->info())) << trial;
  }
  EXPECT_GT(accepted, 1000);
  EXPECT_LT(accepted, 45000);
}

}  // namespace
}  // namespace dermis::test
