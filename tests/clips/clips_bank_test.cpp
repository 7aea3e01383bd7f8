// Stored banks: they come back as they were, and damaged ones are refused or safe to sample.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clip_rig.h"
#include "clips/bank.h"
#include "core_blob.h"
#include "exhaustive.h"

namespace dermis::test {
namespace {

/// Small, but with all that a bank may hold: masks, an additive clip, one that does not wrap, a
/// constant track, a jump, morph weights, and root motion.
PackedRig& smallRig() {
  static const std::unique_ptr<PackedRig> rig = [] {
    gltf::Model model = armRig();
    gltf::Clip jump{"jump", 1, {}};
    jump.channels = {channel(arm::hand, ChannelPath::rotation, {0}, {0, 0.6f, 0, 0.8f}),
                     channel(arm::body, ChannelPath::translation, {0, 0.4f}, {0, 0, 0, 1, 1, 1},
                             Interpolation::step)};
    model.clips.push_back(std::move(jump));
    model.meshes.resize(1);
    model.meshes[0].morphTargetCount = 4;
    model.meshes[0].morphWeights = {0, 0.5f, 0, 1};
    model.nodes[arm::stand].mesh = model.nodes[arm::hand].mesh = 0;
    gltf::Channel smile = channel(arm::stand, ChannelPath::weights, {0, 0.3f, 1.25f},
                                  {0, 0.5f, 0, 1, 1, 0.5f, 0, 0, 0.25f, 0.5f, 0, 2});
    smile.components = 4;
    model.clips[0].channels.push_back(smile);
    auto made = std::make_unique<PackedRig>(std::move(model));
    made->clips[1].additive = true;
    made->clips[1].baseClip = 0;
    made->clips[2].wraps = false;
    made->masks = {Floats(arm::nodeCount, 0.5f), Floats(arm::nodeCount, 0)};
    made->masks[1][arm::hand] = 1;
    made->options.maxError = 1e-2;
    made->options.rootMotion = {.node = arm::body, .upAxis = 1};
    if (!made->pack()) made->bank.reset();
    return made;
  }();
  return *rig;
}

class ClipsBank : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(smallRig().bank.has_value()); }
  const PackedClips& bank() const { return *smallRig().bank; }
  Blob blob() const { return Blob(bank().bytes()); }
};

void expectRefused(std::span<const std::byte> bytes, ErrorCode code = ErrorCode::invalidData) {
  const Result<PackedClips> result = PackedClips::fromBytes(bytes);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, code) << result.error().message;
  EXPECT_FALSE(result.error().message.empty());
}

/// Results are as long as they have to be, so that sanitizers see what is written behind them.
void sampleAllWeights(const PackedClips& bank, std::span<const ClipLayer> layers) {
  for (std::uint32_t node = 0; node < arm::nodeCount; ++node) {
    ASSERT_LE(bank.weightCount(node), bank.bytes().size());
    std::vector<float> weights(bank.weightCount(node));
    EXPECT_TRUE(sampleWeights(bank, layers, node, weights).ok());
  }
}

void samplePoses(const PackedClips& bank) {
  ASSERT_LE(bank.clipCount(), maxClips);
  ASSERT_LE(bank.maskCount(), maxMasks);
  const std::uint32_t lastClip = bank.clipCount() - 1;
  for (std::uint32_t skin = 0; skin < bank.skinCount(); ++skin) {
    ASSERT_LE(bank.jointCount(skin), maxPoseJoints);
    std::vector<JointMatrix> pose(bank.jointCount(skin));
    EXPECT_TRUE(samplePose(bank, {}, skin, pose).ok());
    for (std::uint32_t clip = 0; clip < bank.clipCount(); ++clip) {
      const double duration = double{bank.clip(clip).duration};
      ASSERT_TRUE(duration >= 0 && std::isfinite(duration));
      EXPECT_TRUE(rootMotion(bank, clip, 0.3 * duration, 2.6 * duration).ok());
      for (const double time : {0.0, 0.4 * duration, duration, 1.7 * duration, -1e30}) {
        const std::uint32_t mask = (clip + (time > 0 ? 1 : 0)) % (bank.maskCount() + 1);
        const std::array<ClipLayer, 3> layers{
            ClipLayer{.clip = clip, .time = time, .mask = mask},
            ClipLayer{.clip = lastClip, .time = time, .weight = 2},
            ClipLayer{.clip = clip, .time = time, .hold = true}};
        EXPECT_TRUE(samplePose(bank, layers, skin, pose).ok());
        sampleAllWeights(bank, layers);
      }
    }
  }
  sampleAllWeights(bank, {});
  for (std::uint32_t node = 0; node < arm::nodeCount + 2; ++node) (void)bank.error(node);
}

TEST_F(ClipsBank, ComesBackAsItWas) {
  const Result<PackedClips> result = PackedClips::fromBytes(bank().bytes());
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_TRUE(std::ranges::equal(result->bytes(), bank().bytes()));
  EXPECT_EQ(result->nodeCount(), bank().nodeCount());
  EXPECT_EQ(result->skinCount(), 2u);
  EXPECT_EQ(result->clipCount(), 3u);
  EXPECT_EQ(result->maskCount(), 2u);
  for (std::uint32_t skin = 0; skin < 3; ++skin)
    EXPECT_EQ(result->jointCount(skin), bank().jointCount(skin));
  for (std::uint32_t clip = 0; clip < 4; ++clip) {
    const ClipInfo info = result->clip(clip);
    EXPECT_EQ(info.duration, bank().clip(clip).duration);
    EXPECT_EQ(info.wraps, clip < 2);
    EXPECT_EQ(info.additive, clip == 1);
  }
  EXPECT_EQ(result->clip(3).duration, 0);
  for (std::uint32_t node = 0; node <= arm::nodeCount; ++node) {
    EXPECT_EQ(result->error(node).translation, bank().error(node).translation);
    EXPECT_EQ(result->error(node).rotation, bank().error(node).rotation);
    EXPECT_EQ(result->error(node).scale, bank().error(node).scale);
    EXPECT_EQ(result->error(node).weight, bank().error(node).weight);
    const bool isMorphed = node == arm::stand || node == arm::hand;
    EXPECT_EQ(result->weightCount(node), isMorphed ? 4u : 0u);
    EXPECT_EQ(std::ranges::count(result->morphedNodes(), node), isMorphed ? 1 : 0);
  }
  const std::array<ClipLayer, 2> layers{ClipLayer{.clip = 0, .time = 0.7, .mask = 2},
                                        ClipLayer{.clip = 1, .time = 0.2, .weight = 0.5f}};
  std::vector<JointMatrix> pose(result->jointCount(0));
  ASSERT_TRUE(samplePose(*result, layers, 0, pose).ok());
  EXPECT_TRUE(areSame(pose, smallRig().sample(layers)));
}

// Inside a file, a bank may begin at any byte.
TEST_F(ClipsBank, IsReadFromAnyAddress) {
  std::vector<std::byte> file(bank().bytes().size() + 3);
  for (std::size_t offset = 0; offset < 4; ++offset) {
    std::memcpy(file.data() + offset, bank().bytes().data(), bank().bytes().size());
    const Result<PackedClips> result =
        PackedClips::fromBytes(std::span(file).subspan(offset, bank().bytes().size()));
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_TRUE(std::ranges::equal(result->bytes(), bank().bytes()));
  }
}

TEST_F(ClipsBank, TruncatedOrLongerIsRefused) {
  std::vector<std::byte> bytes(bank().bytes().begin(), bank().bytes().end());
  for (std::size_t size = 0; size < bytes.size(); ++size)
    expectRefused(std::span(bytes).first(size));
  for (int more = 0; more < 8; ++more) {
    bytes.push_back({});
    expectRefused(bytes);
  }
}

// The checksum is right, and the header has the new length.
TEST_F(ClipsBank, TruncatedOnPurposeIsRefusedOrSafe) {
  for (std::size_t size = header::wordCount + 1; size < blob().size(); ++size) {
    Blob shorter = blob();
    shorter.words().resize(size);
    shorter.words()[header::wordCount] = static_cast<std::uint32_t>(size);
    shorter.seal();
    const Result<PackedClips> result = PackedClips::fromBytes(shorter.bytes());
    if (result) samplePoses(*result);
  }
}

TEST_F(ClipsBank, OtherVersionsAndOtherBlobsAreRefused) {
  for (const std::uint32_t version : {0u, blob().word(header::version) + 1, 0xffffffffu}) {
    Blob other = blob();
    other.words()[header::version] = version;
    expectRefused(other.bytes(), ErrorCode::unsupportedVersion);
    other.seal();
    expectRefused(other.bytes(), ErrorCode::unsupportedVersion);
  }
  Blob other = blob();
  other.words()[header::magic] = abi::MESH_MAGIC;
  other.seal();
  expectRefused(other.bytes());
}

TEST_F(ClipsBank, EachDamagedWordIsNoticed) {
  for (std::size_t word = 0; word < blob().size(); ++word) {
    if (word == header::version) continue;
    for (const std::uint32_t bits : {1u, 0x80000000u, 0x00010000u, 0xffffffffu}) {
      Blob damaged = blob();
      damaged.words()[word] ^= bits;
      expectRefused(damaged.bytes());
    }
  }
}

// What attackers do: the checksum is right.
TEST_F(ClipsBank, EachChangedWordIsRefusedOrSafe) {
  const std::size_t words = blob().size();
  int accepted = 0, refused = 0;
  for (std::size_t word = header::wordCount; word < words; ++word) {
    const std::uint32_t value = blob().word(word), size = static_cast<std::uint32_t>(words);
    for (const std::uint32_t changed :
         {value ^ 1, value ^ 0x80000000u, ~value, value + 1, value - 1, value + 16, value * 2, 0u,
          1u, size - 1, size, 0x7f800000u, 0x7fc00000u, 0x7f7fffffu, 0x3fffffffu, 0xffffffffu}) {
      if (changed == value) continue;
      SCOPED_TRACE("word " + std::to_string(word) + ": " + std::to_string(changed));
      Blob other = blob();
      other.words()[word] = changed;
      other.seal();
      const Result<PackedClips> result = PackedClips::fromBytes(other.bytes());
      ++(result ? accepted : refused);
      if (result) samplePoses(*result);
      if (HasFatalFailure()) return;
    }
  }
  EXPECT_GT(accepted, 0);
  EXPECT_GT(refused, 0);
}

TEST_F(ClipsBank, RandomChangesAreRefusedOrSafe) {
  std::mt19937 random(1);
  const int trials = isExhaustive ? 200'000 : 5'000;
  for (int trial = 0; trial < trials; ++trial) {
    Blob other = blob();
    for (int change = 0; change < 1 + trial % 4; ++change) {
      const std::size_t word =
          header::wordCount + random() % (trial % 2 == 0 ? 64 : other.size() - header::wordCount);
      const std::array<std::uint32_t, 6> values{static_cast<std::uint32_t>(random()),
                                                static_cast<std::uint32_t>(random() % other.size()),
                                                other.word(word) ^ 1u << random() % 32,
                                                other.word(random() % other.size()),
                                                0,
                                                0xffffffffu};
      other.words()[word] = values[random() % values.size()];
    }
    other.seal();
    const Result<PackedClips> result = PackedClips::fromBytes(other.bytes());
    if (result) samplePoses(*result);
    ASSERT_FALSE(HasFatalFailure()) << trial;
  }
}

/// With so many skins, all of which have the joints of skin 0.
Blob withSameSkins(const PackedClips& bank, std::uint32_t count) {
  Blob blob(bank.bytes());
  const BankHeader header = ClipBank(bank).header;
  const auto skins = static_cast<std::uint32_t>(blob.size());
  for (std::uint32_t i = 0; i < count * (sizeof(BankSkin) / 4); ++i)
    blob.words().push_back(blob.word(header.skins + i % (sizeof(BankSkin) / 4)));
  blob.words()[offsetof(BankHeader, skins) / 4] = skins;
  blob.words()[offsetof(BankHeader, skinCount) / 4] = count;
  blob.words()[header::wordCount] = static_cast<std::uint32_t>(blob.size());
  blob.seal();
  return blob;
}

// What a bank costs is bounded by its bytes.
TEST_F(ClipsBank, ManySkinsCannotShareTheirJoints) {
  EXPECT_TRUE(PackedClips::fromBytes(withSameSkins(bank(), 1).bytes()).ok());
  expectRefused(withSameSkins(bank(), 1000).bytes());
}

TEST_F(ClipsBank, MasksAreFrom0To1) {
  const std::uint32_t masks = ClipBank(bank()).header.masks;
  for (const float factor : {-1.0f, 1.5f, 1e30f, std::nanf("")}) {
    Blob other = blob();
    other.words()[masks] = std::bit_cast<std::uint32_t>(factor);
    other.seal();
    expectRefused(other.bytes());
  }
}

/// A bank with another rotation as 4 words from this one on.
Blob withRotation(const PackedClips& bank, std::size_t word, const std::array<float, 4>& rotation) {
  Blob blob(bank.bytes());
  for (std::size_t i = 0; i < 4; ++i)
    blob.words()[word + i] = std::bit_cast<std::uint32_t>(rotation[i]);
  blob.seal();
  return blob;
}

// `rigidSkins` looks at scales only.
TEST_F(ClipsBank, RotationsHaveUnitLength) {
  const ClipBank words(bank());
  std::vector<std::size_t> places;  // at rest, and constant ones of clips
  for (std::size_t i = 0; i < words.header.nodeCount; ++i)
    places.push_back(words.header.nodes + i * ClipBank::wordsOf<BankNode> +
                     offsetof(BankNode, rotation) / 4);
  for (std::size_t clip = 0; clip < words.header.clipCount; ++clip) {
    for (std::size_t node = 0; node < words.header.nodeCount; ++node) {
      const std::uint32_t word = words.words[words.clip(clip).tracks + 3 * node + 1];
      if (static_cast<TrackKind>(word >> 30) == TrackKind::constant)
        places.push_back(word & 0x3fffffff);
    }
  }
  EXPECT_GT(places.size(), words.header.nodeCount);
  constexpr float infinite = std::numeric_limits<float>::infinity();
  for (const std::size_t place : places) {
    SCOPED_TRACE(place);
    using Rotation = std::array<float, 4>;
    for (const Rotation& good : {Rotation{0, 0, 0, -1}, Rotation{0.6f, 0, 0.8f, 0},
                                 Rotation{0, 1.000004f, 0, 0}, Rotation{0.5f, 0.5f, -0.5f, 0.5f}})
      EXPECT_TRUE(PackedClips::fromBytes(withRotation(bank(), place, good).bytes()).ok());
    for (const Rotation& bad :
         {Rotation{2, 0, 0, 0}, Rotation{0, 0, 0, 0}, Rotation{0, 0, 1e-22f, 0},
          Rotation{0, 0.9999f, 0, 0}, Rotation{0, 0, 0, 1.0001f}, Rotation{0, 0, 0, 1e30f},
          Rotation{infinite, 0, 0, 0}, Rotation{0, 0, 0, std::nanf("")}})
      expectRefused(withRotation(bank(), place, bad).bytes());
  }
}

// Whatever the length of a skeleton's rotation, the bank that it is packed into can be read.
TEST_F(ClipsBank, RotationsOfSkeletonsGetUnitLength) {
  for (const double length : {1e-320, 1e-161, 1e-155, 1e-30, 1e30, 1e150, 1e200}) {
    SCOPED_TRACE(length);
    PackedRig rig(armRig());
    rig.skeleton.nodes[arm::body].rotation = {0, 0.36 * length, 0.48 * length, 0.8 * length};
    const Result<PackedClips> packed = rig.tryToPack();
    ASSERT_TRUE(packed.ok()) << packed.error().message;
    const Result<PackedClips> copy = PackedClips::fromBytes(packed->bytes());
    EXPECT_TRUE(copy.ok()) << copy.error().message;
    const ClipBank words(*packed);
    for (std::size_t i = 0; i < words.header.nodeCount; ++i) {
      double square = 0;
      for (const float number : words.node(i).rotation) square += double{number} * double{number};
      EXPECT_NEAR(square, 1, 1e-6);
    }
  }
}

}  // namespace
}  // namespace dermis::test
