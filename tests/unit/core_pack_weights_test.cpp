// pack: pivots, and weights that sum to exactly 1.

#include "dermis/mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core_pack_meshes.h"
#include "few_cases.h"

namespace dermis::test {
namespace {

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
        mesh.positions = attributeView(position, 1, 3);
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

TEST(Pack, WeightsAreNormalized) {
  const std::vector<BlobInfluence> influences = packedInfluences({0, 1, 2}, {6.0f, 1.0f, 3.0f});
  ASSERT_EQ(influences.size(), 3u);
  EXPECT_NEAR(influences[0].weight, 0.6f, 6e-8f);
  EXPECT_NEAR(influences[1].weight, 0.3f, 3e-8f);
  EXPECT_NEAR(influences[2].weight, 0.1f, 3e-8f);
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
  EXPECT_EQ(result.info().maxInfluences, 1u);
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
    EXPECT_EQ(sum, 1);
  }
}

// ---- Sums of exactly 1

/// How the weights of a random mesh are chosen.
enum class Kind {
  uniform,
  equal,
  tiny,
  steep,
  dominant,
  bytes,
  bytesThatSum,
  shorts,
  shortsThatSum
};
constexpr Kind allKinds[] = {Kind::uniform,      Kind::equal,    Kind::tiny,
                             Kind::steep,        Kind::dominant, Kind::bytes,
                             Kind::bytesThatSum, Kind::shorts,   Kind::shortsThatSum};

bool isInteger(Kind kind) {
  return kind >= Kind::bytes;
}

float floatWeight(Kind kind, std::uint32_t slot, std::mt19937& engine) {
  const float uniform = static_cast<float>(engine() % 1000000 + 1) / 1e6f;
  switch (kind) {
    case Kind::equal:
      return 0.1f;
    case Kind::tiny:
      return slot == 0 ? uniform
                       : uniform * std::pow(10.0f, -static_cast<float>(9 + engine() % 22));
    case Kind::steep:
      return uniform * std::ldexp(1.0f, -static_cast<int>(slot));
    case Kind::dominant:
      return slot == 0 ? 1000.0f : uniform;
    default:
      return uniform;
  }
}

/// `slots` numbers that sum to `total`.
std::vector<std::uint32_t> parts(std::uint32_t total, std::uint32_t slots, std::mt19937& engine) {
  std::vector<std::uint32_t> result(slots, 0);
  for (std::uint32_t left = total; left > 0;) {
    const auto part = std::min(left, static_cast<std::uint32_t>(engine()) % (total / 2) + 1);
    result[engine() % slots] += part;
    left -= part;
  }
  return result;
}

struct WeightedMesh {
  std::vector<float> positions;
  std::vector<std::uint32_t> joints;
  std::vector<float> floats;
  std::vector<std::uint8_t> bytes;
  std::vector<std::uint16_t> shorts;
  InfluenceSet set;

  WeightedMesh(Kind kind, std::uint32_t vertices, std::uint32_t slots, std::mt19937& engine)
      : positions(std::size_t{vertices} * 3, 0.0f) {
    const bool isByte = kind == Kind::bytes || kind == Kind::bytesThatSum;
    for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
      const std::uint32_t whole = isByte ? 255 : 65535;
      const std::vector<std::uint32_t> sum = parts(whole, slots, engine);
      for (std::uint32_t slot = 0; slot < slots; ++slot) {
        joints.push_back((vertex + slot) % 1000);
        const std::uint32_t any = static_cast<std::uint32_t>(engine()) % (whole + 1);
        const bool sums = kind == Kind::bytesThatSum || kind == Kind::shortsThatSum;
        if (!isInteger(kind)) {
          floats.push_back(floatWeight(kind, slot, engine));
        } else if (isByte) {
          bytes.push_back(static_cast<std::uint8_t>(sums ? sum[slot] : any));
        } else {
          shorts.push_back(static_cast<std::uint16_t>(sums ? sum[slot] : any));
        }
      }
    }
    set.joints = viewOf(joints, ComponentType::uint32, slots);
    set.weights = !isInteger(kind) ? viewOf(floats, ComponentType::float32, slots)
                  : isByte         ? viewOf(bytes, ComponentType::unorm8, slots)
                                   : viewOf(shorts, ComponentType::unorm16, slots);
  }
  WeightedMesh(const WeightedMesh&) = delete;
  WeightedMesh& operator=(const WeightedMesh&) = delete;

  MeshView view() const {
    MeshView mesh;
    mesh.vertexCount = static_cast<std::uint32_t>(positions.size() / 3);
    mesh.positions = viewOf(positions, ComponentType::float32, 3);
    mesh.influenceSets = {&set, 1};
    return mesh;
  }
  double weight(std::size_t entry) const {
    if (!floats.empty()) return static_cast<double>(floats[entry]);
    return bytes.empty() ? shorts[entry] : bytes[entry];
  }
};

/// The sum in integers, of weights that are multiples of 2^-48; each near to the true one.
void expectExactSum(const std::vector<BlobInfluence>& influences, const WeightedMesh& mesh,
                    std::size_t firstEntry, std::uint32_t slots, double& worst) {
  double sum = 0;
  for (std::uint32_t slot = 0; slot < slots; ++slot) sum += mesh.weight(firstEntry + slot);
  ASSERT_EQ(influences.empty(), sum == 0);
  if (influences.empty()) return;
  std::int64_t total = 0;
  double kept = 0;
  for (const BlobInfluence& influence : influences) {
    const double steps = static_cast<double>(influence.weight) * 0x1p48;
    ASSERT_EQ(steps, std::floor(steps)) << "a weight that is no multiple of 2^-48";
    ASSERT_GT(steps, 0);
    total += static_cast<std::int64_t>(steps);
    std::uint32_t slot = 0;
    while (slot < slots && mesh.joints[firstEntry + slot] != influence.joint) ++slot;
    ASSERT_LT(slot, slots);
    const double exact = mesh.weight(firstEntry + slot) / sum;
    worst = std::max(worst, std::abs(static_cast<double>(influence.weight) - exact));
    kept += exact;
  }
  ASSERT_EQ(total, std::int64_t{1} << 48);
  ASSERT_GE(kept, 1 - 2 * 0x1p-24) << "more is lost than rounding may";
}

// A million vertices, unless there are few cases.
TEST(PackWeights, SumToExactlyOneEachNearToItsOwn) {
  constexpr std::uint32_t vertices = test::fewer(10000u);
  std::mt19937 engine(1);
  double worst = 0;
  std::uint32_t count = 0;
  for (const std::uint32_t slots : {1u, 2u, 3u, 4u, 5u, 6u, 7u, 8u, 12u, 33u, 64u}) {
    for (const Kind kind : allKinds) {
      SCOPED_TRACE(std::to_string(slots) + " slots, kind " +
                   std::to_string(static_cast<int>(kind)));
      const WeightedMesh mesh(kind, vertices, slots, engine);
      const Blob blob(packed(mesh.view(), 1000).bytes());
      for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
        ASSERT_NO_FATAL_FAILURE(expectExactSum(blob.influences(vertex), mesh,
                                               std::size_t{vertex} * slots, slots, worst));
      }
      count += vertices;
    }
  }
  EXPECT_GE(count, test::fewer(950000u));
  EXPECT_LE(worst, 2 * 0x1p-24);
}

// As many as there are joints, of weights that float32 does not have.
TEST(PackWeights, SumToExactlyOneHoweverManyThereAre) {
  for (const std::uint32_t count : {1000u, 4097u, 65535u, 65536u}) {
    for (const float weight : {1.0f, 0.1f, 1e-30f}) {
      std::vector<std::uint32_t> joints(count);
      for (std::uint32_t i = 0; i < count; ++i) joints[i] = i;
      std::vector<float> weights(count, weight);
      weights[count / 2] *= 1000;
      std::int64_t total = 0;
      for (const BlobInfluence& influence : packedInfluences(joints, weights)) {
        const double steps = static_cast<double>(influence.weight) * 0x1p48;
        ASSERT_EQ(steps, std::floor(steps));
        total += static_cast<std::int64_t>(steps);
      }
      EXPECT_EQ(total, std::int64_t{1} << 48) << count << " weights of " << weight;
    }
  }
}

// ---- What does not matter

/// The slots of one vertex in another order, in several sets, with empty slots between.
PackedMesh packShuffled(const std::vector<std::uint32_t>& joints, const std::vector<float>& weights,
                        std::mt19937& engine) {
  std::vector<std::size_t> order(joints.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), engine);
  std::vector<std::vector<std::uint32_t>> setJoints(1 + engine() % 3);
  std::vector<std::vector<float>> setWeights(setJoints.size());
  const auto add = [&](std::uint32_t joint, float weight) {
    const std::size_t set = engine() % setJoints.size();
    setJoints[set].push_back(joint);
    setWeights[set].push_back(weight);
  };
  for (const std::size_t slot : order) {
    add(joints[slot], weights[slot]);
    if (engine() % 3 == 0)
      add(static_cast<std::uint32_t>(engine()), engine() % 2 == 0 ? 0.0f : -0.0f);
  }
  std::vector<InfluenceSet> sets;
  for (std::size_t set = 0; set < setJoints.size(); ++set) {
    const auto slots = static_cast<std::uint32_t>(setJoints[set].size());
    if (slots == 0) continue;
    sets.push_back({viewOf(setJoints[set], ComponentType::uint32, slots),
                    viewOf(setWeights[set], ComponentType::float32, slots)});
  }
  const float position[] = {1, 2, 3};
  MeshView mesh;
  mesh.vertexCount = 1;
  mesh.positions = attributeView(position, 1, 3);
  mesh.influenceSets = sets;
  return packed(mesh, 100);
}

TEST(PackWeights, TheOrderOfSlotsAndSetsAndEmptySlotsChangeNoByte) {
  std::mt19937 engine(7);
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<std::uint32_t> joints;
    std::vector<float> weights;
    // Often several of one joint, of magnitudes so different that their sum is rounded.
    for (std::uint32_t slot = 0; slot < 1 + engine() % 12; ++slot) {
      joints.push_back(static_cast<std::uint32_t>(engine()) % 4);
      weights.push_back(std::ldexp(static_cast<float>(engine() % 0xffffffu + 1),
                                   -static_cast<int>(engine() % 60)));
    }
    const PackedMesh first = packShuffled(joints, weights, engine);
    for (int again = 0; again < 4; ++again)
      ASSERT_TRUE(sameBytes(first, packShuffled(joints, weights, engine))) << trial;
  }
}

// 1 + 2^-54 is 1 in double, 1 + 2^-54 + 2^-54 need not be: which joint is the stronger must not
// depend on what is added first.
TEST(PackWeights, NorDoesTheOrderOfWeightsThatVanishInTheirSum) {
  std::vector<std::pair<std::uint32_t, float>> slots{
      {5, 0x1p-54f}, {5, 0x1p-54f}, {2, 1.0f}, {5, 1.0f}};
  std::sort(slots.begin(), slots.end());
  std::set<std::uint32_t> pivots;
  do {
    std::vector<std::uint32_t> joints;
    std::vector<float> weights;
    for (const auto& [joint, weight] : slots) {
      joints.push_back(joint);
      weights.push_back(weight);
    }
    pivots.insert(packedInfluences(joints, weights)[0].joint);
  } while (std::next_permutation(slots.begin(), slots.end()));
  EXPECT_EQ(pivots, std::set<std::uint32_t>{5}) << "it is the stronger by 2^-53";
}

TEST(PackWeights, AWeightInPartsIsTheWholeWeight) {
  std::mt19937 engine(8);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<std::uint32_t> whole, split;
    std::vector<float> wholeWeights, splitWeights;
    for (std::uint32_t joint = 0; joint < 1 + engine() % 6; ++joint) {
      const std::uint32_t weight = static_cast<std::uint32_t>(engine() % 1000) + 2;
      const std::uint32_t part = static_cast<std::uint32_t>(engine()) % weight;
      whole.push_back(joint);
      wholeWeights.push_back(static_cast<float>(weight));
      split.insert(split.end(), {joint, joint});
      splitWeights.insert(splitWeights.end(),
                          {static_cast<float>(part), static_cast<float>(weight - part)});
    }
    EXPECT_TRUE(sameBytes(packShuffled(whole, wholeWeights, engine),
                          packShuffled(split, splitWeights, engine)));
  }
}

// More influences at one vertex cost the others nothing.
TEST(PackWeights, NoWordIsSpentOnInfluencesThatAVertexHasNot) {
  OwnedMesh mesh = slottedMesh(1, 1000, 64, 100);
  std::fill(mesh.weights.begin(), mesh.weights.end(), 0.0f);
  const std::size_t none = packed(mesh.view(), 100).bytes().size();
  for (std::uint32_t slot = 0; slot < 64; ++slot) {
    mesh.weights[500 * 64 + slot] = 1;
    mesh.joints[500 * 64 + slot] = slot;
  }
  const PackedMesh result = packed(mesh.view(), 100);
  EXPECT_EQ(result.bytes().size(), none + 64 * 8);
  EXPECT_EQ(result.info().maxInfluences, 64u);
  EXPECT_EQ(Blob(result.bytes()).influences(499).size(), 0u);
  EXPECT_EQ(Blob(result.bytes()).influences(500).size(), 64u);
}

}  // namespace
}  // namespace dermis::test
