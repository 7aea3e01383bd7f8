// What `packRig` refuses, and that no damaged bytes lead a reader astray.
#include <gtest/gtest.h>

#include <bit>
#include <cstddef>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <glm/gtc/matrix_transform.hpp>

#include "dermis/verify.h"
#include "made_rig.h"
#include "matrix_of.h"
#include "random_number.h"
#include "rig/blob.h"
#include "stored.h"

namespace dermis::test {
namespace {

constexpr float notFinite[] = {std::numeric_limits<float>::infinity(),
                               -std::numeric_limits<float>::infinity(),
                               std::numeric_limits<float>::quiet_NaN()};

template <typename T>
std::span<const T> changed(MadeRig& rig, std::span<const T> values, std::size_t at, T value) {
  std::vector<T> copy(values.begin(), values.end());
  copy[at] = value;
  return rig.keep(copy);
}

/// Joints 0 to 3 are written, in a row; 4 is a twist joint, 5 has an offset and drives, together
/// with 0, the chain 6 to 8, 9 is linear. Weight 0 is given; 1 and 2 are driven.
MadeRig allDrivers() {
  MadeRig rig;
  for (std::uint32_t joint = 0; joint < 10; ++joint)
    rig.addJoint(joint == 0 ? noRigJoint : (joint - 1) % 4,
                 glm::translate(glm::dmat4(1), glm::dvec3(joint, 0.1 * joint * joint, 0)));
  rig.writtenJoints = 4;
  rig.givenWeights = 1;
  rig.drivenWeights = 2;
  TwistDriver twist;
  twist.joint = 4;
  twist.source = 2;
  rig.twists.push_back(twist);
  CorrectiveDriver corrective;
  corrective.inputs = rig.keep(std::vector<std::uint32_t>{1, 4});
  corrective.examples = rig.keep(std::vector<std::array<float, 4>>{
      {0, 0, 0, 1}, {0, 0, 0, 1}, {1, 0, 0, 1}, {0, 1, 0, 1}, {0, 0, 1, 1}, {0, 1, 1, 1}});
  corrective.firstWeight = 1;
  corrective.weightCount = 2;
  corrective.weights = rig.keep(std::vector<float>{0, 0, 1, 0.5f, -1, 2});
  corrective.joints = rig.keep(std::vector<std::uint32_t>{5});
  std::vector<JointOffset> offsets(3);
  offsets[1].translation = {1, 2, 3};
  offsets[2].rotation = {1, 0, 0, 1};
  corrective.offsets = rig.keep(offsets);
  rig.correctives.push_back(corrective);
  ChainDriver chain;
  chain.joints = rig.keep(std::vector<std::uint32_t>{0, 3, 5});
  chain.firstDriven = 6;
  chain.segments = 4;
  rig.chains.push_back(chain);
  LinearDriver linear;
  linear.joint = 9;
  linear.weights = rig.keep(std::vector<std::uint32_t>{0, 2});
  linear.matrices = rig.keep(std::vector<JointMatrix>(2));
  rig.linears.push_back(linear);
  return rig;
}

void expectRigRefused(const std::function<void(MadeRig&)>& change,
                      const std::vector<std::string>& names,
                      ErrorCode code = ErrorCode::invalidArgument) {
  MadeRig rig = allDrivers();
  change(rig);
  const Result<PackedRig> packed = packRig(rig.view());
  ASSERT_FALSE(packed.ok()) << testing::PrintToString(names);
  const std::string& message = packed.error().message;
  EXPECT_EQ(packed.error().code, code) << message;
  EXPECT_FALSE(message.ends_with('.')) << message;
  for (const std::string& name : names)
    EXPECT_NE(message.find(name), std::string::npos) << '"' << message << "\" without " << name;
  const std::vector<JointMatrix> pose(rig.writtenJoints);
  EXPECT_FALSE(reference::evaluateRig(rig.view(), pose, std::vector<float>(rig.givenWeights)).ok());
}

TEST(RigRefused, NothingOfARigOfAllDrivers) {
  EXPECT_TRUE(packRig(allDrivers().view()).ok());
}

TEST(RigRefused, Joints) {
  for (const float bad : notFinite) {
    expectRigRefused([=](MadeRig& rig) { rig.joints[3].bind.m[2][3] = bad; }, {"joint 3"});
    expectRigRefused([=](MadeRig& rig) { rig.joints[9].bind.m[0][0] = bad; }, {"joint 9"});
  }
  expectRigRefused([](MadeRig& rig) { rig.joints[3].parent = 10; }, {"joint 10", "joint 3"});
  expectRigRefused([](MadeRig& rig) { rig.joints[0].parent = 3; }, {"cycle"});
  expectRigRefused([](MadeRig& rig) { rig.joints[2].parent = 2; }, {"joint 2", "cycle"});
  expectRigRefused([](MadeRig& rig) { rig.writtenJoints = 0; }, {"10 joints 0"});
  expectRigRefused([](MadeRig& rig) { rig.writtenJoints = 11; }, {"11"});
  expectRigRefused([](MadeRig& rig) { rig.joints.resize(maxPoseJoints + 1); },
                   {std::to_string(maxPoseJoints)}, ErrorCode::limitExceeded);
  for (const std::uint32_t joint : {1u, 2u, 5u})
    expectRigRefused([=](MadeRig& rig) { rig.joints[joint].bind.m[1][1] = 0; },
                     {"joint " + std::to_string(joint), "no inverse"});
  expectRigRefused([](MadeRig& rig) { rig.joints[5].bind.m[1][1] = 1e-39f; }, {"float32"});
}

TEST(RigRefused, WhoDrivesWhat) {
  expectRigRefused([](MadeRig& rig) { rig.twists[0].joint = 3; },
                   {"twist 0", "joint 3", "written"});
  expectRigRefused([](MadeRig& rig) { rig.twists[0].joint = 9; }, {"two drivers", "joint 9"});
  expectRigRefused([](MadeRig& rig) { rig.twists[0].joint = 10; }, {"twist 0", "joint 10"});
  expectRigRefused([](MadeRig& rig) { rig.twists.clear(); }, {"joint 4", "no driver"});
  expectRigRefused([](MadeRig& rig) { rig.chains[0].segments = 3; }, {"joint 8", "no driver"});
  expectRigRefused([](MadeRig& rig) { rig.chains[0].segments = 5; }, {"two drivers", "joint 9"});
  expectRigRefused([](MadeRig& rig) { rig.chains[0].firstDriven = 0xffffffff; }, {"chain 0"});
  expectRigRefused([](MadeRig& rig) { rig.drivenWeights = 3; }, {"3 driven weights"});
  expectRigRefused([](MadeRig& rig) { rig.drivenWeights = 1; }, {"corrective 0", "weights 1 to 2"});
  expectRigRefused([](MadeRig& rig) { rig.drivenWeights = 0xffffffff; }, {"weights"});
  expectRigRefused([](MadeRig& rig) { rig.correctives[0].firstWeight = 0; }, {"corrective 0"});
  expectRigRefused(
      [](MadeRig& rig) {
        rig.correctives.push_back(rig.correctives[0]);
        rig.correctives[1].joints = {};
        rig.correctives[1].offsets = {};
      },
      {"weight 1", "two drivers"});
  expectRigRefused(
      [](MadeRig& rig) { rig.linears[0].weights = changed(rig, rig.linears[0].weights, 1, 3u); },
      {"linear driver 0", "weight 3"});
}

TEST(RigRefused, CyclesOfDrivers) {
  expectRigRefused([](MadeRig& rig) { rig.twists[0].source = 5; }, {"twist 0", "cycle"});
  expectRigRefused([](MadeRig& rig) { rig.twists[0].source = 4; }, {"twist 0", "cycle"});
  expectRigRefused([](MadeRig& rig) { rig.joints[4].parent = 9; }, {"twist 0", "cycle"});
  expectRigRefused(
      [](MadeRig& rig) { rig.chains[0].joints = changed(rig, rig.chains[0].joints, 2, 7u); },
      {"chain 0", "cycle"});
}

TEST(RigRefused, Twists) {
  for (const float bad : notFinite) {
    expectRigRefused([=](MadeRig& rig) { rig.twists[0].axis[1] = bad; }, {"twist 0", "axis"});
    expectRigRefused([=](MadeRig& rig) { rig.twists[0].share = bad; }, {"twist 0", "share"});
  }
  expectRigRefused([](MadeRig& rig) { rig.twists[0].axis = {0, 0, 0}; }, {"twist 0", "axis"});
  expectRigRefused([](MadeRig& rig) { rig.twists[0].share = 1.01f; }, {"twist 0", "share"});
  expectRigRefused([](MadeRig& rig) { rig.twists[0].source = 10; }, {"twist 0", "joint 10"});
}

TEST(RigRefused, Correctives) {
  const auto expect = [](const std::function<void(MadeRig&, CorrectiveDriver&)>& change,
                         std::vector<std::string> names,
                         ErrorCode code = ErrorCode::invalidArgument) {
    names.push_back("corrective 0");
    expectRigRefused([&](MadeRig& rig) { change(rig, rig.correctives[0]); }, names, code);
  };
  using Driver = CorrectiveDriver;
  for (const float bad : notFinite) {
    expect([=](MadeRig&, Driver& driver) { driver.radius = bad; }, {"radius"});
    expect([=](MadeRig& rig,
               Driver& driver) { driver.weights = changed(rig, driver.weights, 3, bad); },
           {"weight"});
    expect(
        [=](MadeRig& rig, Driver& driver) {
          driver.examples = changed(rig, driver.examples, 5, {0, 0, bad, 1});
        },
        {"rotation"});
    for (int part = 0; part < 3; ++part) {
      JointOffset offset;
      if (part == 0) offset.translation[2] = bad;
      if (part == 1) offset.rotation[2] = bad;
      if (part == 2) offset.scale[2] = bad;
      expect([=](MadeRig& rig,
                 Driver& driver) { driver.offsets = changed(rig, driver.offsets, 2, offset); },
             {"offset"});
    }
  }
  expect(
      [](MadeRig& rig, Driver& driver) {
        driver.offsets = changed(rig, driver.offsets, 0, JointOffset{.rotation = {0, 0, 0, 0}});
      },
      {"offset"});
  expect(
      [](MadeRig& rig, Driver& driver) {
        driver.examples = changed(rig, driver.examples, 0, {0, 0, 0, 0});
      },
      {"rotation"});
  for (const float radius : {-1.0f, 1e-30f, 1e30f})
    expect([=](MadeRig&, Driver& driver) { driver.radius = radius; }, {"radius"});
  expect([](MadeRig&, Driver& driver) { driver.inputs = {}; }, {"input"});
  expect([](MadeRig&, Driver& driver) { driver.examples = {}; }, {"0 rotations"});
  expect([](MadeRig&, Driver& driver) { driver.examples = driver.examples.first(5); },
         {"5 rotations"});
  expect([](MadeRig&, Driver& driver) { driver.examples = driver.examples.first(4); },
         {"6 weights"});
  expect([](MadeRig&, Driver& driver) { driver.offsets = driver.offsets.first(2); }, {"2 offsets"});
  expect([](MadeRig& rig, Driver& driver) { driver.inputs = changed(rig, driver.inputs, 0, 10u); },
         {"joint 10"});
  // The same example, with the other sign; and one that is too near.
  expect(
      [](MadeRig& rig, Driver& driver) {
        driver.examples = changed(rig, driver.examples, 2, {0, 0, 0, -2});
        driver.examples = changed(rig, driver.examples, 3, {0, 0, 0, 1});
      },
      {"examples"});
  expect(
      [](MadeRig& rig, Driver& driver) {
        driver.examples = changed(rig, driver.examples, 2, {1e-6f, 0, 0, 1});
        driver.examples = changed(rig, driver.examples, 3, {0, 0, 0, 1});
      },
      {"examples"});
  expect(
      [](MadeRig& rig, Driver& driver) {
        std::vector<std::array<float, 4>> examples;
        for (std::size_t i = 0; i < 2 * (maxRigExamples + 1); ++i)
          examples.push_back(quaternionAbout({1, 0, 0}, 0.01 * static_cast<double>(i)));
        driver.examples = rig.keep(examples);
      },
      {"64"}, ErrorCode::limitExceeded);
  // One that drives nothing, beside the one that drives all.
  expectRigRefused(
      [](MadeRig& rig) {
        CorrectiveDriver& other = rig.correctives.emplace_back(rig.correctives[0]);
        other.weightCount = 0;
        other.weights = {};
        other.joints = {};
        other.offsets = {};
      },
      {"corrective 1", "nothing"});
}

TEST(RigRefused, Chains) {
  const auto expect = [](const std::function<void(MadeRig&, ChainDriver&)>& change,
                         std::vector<std::string> names) {
    names.push_back("chain 0");
    expectRigRefused([&](MadeRig& rig) { change(rig, rig.chains[0]); }, names);
  };
  using Driver = ChainDriver;
  expect([](MadeRig&, Driver& chain) { chain.joints = chain.joints.first(1); }, {"two joints"});
  expect([](MadeRig&, Driver& chain) { chain.segments = 1; }, {"segments"});
  expect([](MadeRig&, Driver& chain) { chain.segments = 0xffffffff; }, {"segments"});
  expect([](MadeRig& rig, Driver& chain) { chain.joints = changed(rig, chain.joints, 1, 10u); },
         {"joint 10"});
  expect([](MadeRig& rig, Driver&) { rig.joints[3].bind = rig.joints[0].bind; },
         {"joint 0", "joint 3", "one place"});
  expect([](MadeRig& rig, Driver& chain) { chain.joints = changed(rig, chain.joints, 2, 0u); },
         {"180", "joint 3"});
}

TEST(RigRefused, Linears) {
  for (const float bad : notFinite) {
    expectRigRefused(
        [=](MadeRig& rig) {
          JointMatrix matrix;
          matrix.m[2][3] = bad;
          rig.linears[0].matrices = changed(rig, rig.linears[0].matrices, 1, matrix);
        },
        {"linear driver 0"});
  }
  expectRigRefused([](MadeRig& rig) { rig.linears[0].weights = rig.linears[0].weights.first(1); },
                   {"linear driver 0", "1 weights", "2 matrices"});
}

TEST(RigRefused, SpansOfAnotherSize) {
  const MadeRig rig = allDrivers();
  const PackedRig packed = rig.pack();
  std::vector<JointMatrix> written(4), driven(6);
  std::vector<float> given(1), weights(3);
  EXPECT_TRUE(evaluateRig(packed, written, given, driven, weights).ok());
  const std::vector<float> before = weights;
  for (int which = 0; which < 4; ++which) {
    for (const int change : {-1, 1}) {
      const auto resized = [&](auto values, int of) {
        if (which == of)
          values.resize(static_cast<std::size_t>(static_cast<int>(values.size()) + change));
        return values;
      };
      auto driven2 = resized(driven, 2);
      auto weights2 = resized(weights, 3);
      const Result<void> done =
          evaluateRig(packed, resized(written, 0), resized(given, 1), driven2, weights2);
      ASSERT_FALSE(done.ok());
      EXPECT_EQ(done.error().code, ErrorCode::invalidArgument);
      if (which >= 2) continue;
      EXPECT_FALSE(reference::evaluateRig(rig.view(), resized(written, 0), resized(given, 1)).ok());
    }
  }
}

TEST(RigOrder, ALongRowOfDriversAndJointsTakesLittleTime) {
  MadeRig rig;
  rig.addJoint(noRigJoint, glm::dmat4(1));
  rig.writtenJoints = 1;
  for (std::uint32_t joint = 1; joint < maxPoseJoints; ++joint) {
    rig.addJoint(joint - 1, glm::dmat4(1));
    rig.linears.push_back({.joint = maxPoseJoints - joint});  // the last first
  }
  std::vector<JointMatrix> pose{jointMatrixOf(glm::translate(glm::dmat4(1), glm::dvec3(1, 2, 3)))};
  EXPECT_EQ(matrixOf(evaluated(rig.pack(), pose).joints.back().m), matrixOf(pose[0].m));
}

// ---- Stored bytes.

std::vector<std::uint32_t> wordsOf(const PackedRig& rig) {
  std::vector<std::uint32_t> words(rig.bytes().size() / 4);
  std::memcpy(words.data(), rig.bytes().data(), rig.bytes().size());
  return words;
}

Result<PackedRig> read(const std::vector<std::uint32_t>& words) {
  return PackedRig::fromBytes(std::as_bytes(std::span(words)));
}

TEST(RigBytes, AreTheRig) {
  MadeRig made = allDrivers();
  const PackedRig rig = made.pack();
  const Result<PackedRig> copy = PackedRig::fromBytes(rig.bytes());
  ASSERT_TRUE(copy.ok()) << copy.error().message;
  EXPECT_EQ(wordsOf(*copy), wordsOf(rig));
  EXPECT_EQ(copy->writtenJoints(), 4u);
  EXPECT_EQ(copy->drivenJoints(), 6u);
  EXPECT_EQ(copy->givenWeights(), 1u);
  EXPECT_EQ(copy->drivenWeights(), 2u);
  EXPECT_EQ(copy->weightsOf(), noRigJoint);
  EXPECT_FALSE(PackedRig::fromBytes(rig.bytes().first(rig.bytes().size() - 1)).ok());
  EXPECT_FALSE(PackedRig::fromBytes(rig.bytes().first(rig.bytes().size() - 4)).ok());
  EXPECT_FALSE(PackedRig::fromBytes({}).ok());
  std::vector<std::uint32_t> words = wordsOf(rig);
  words[1] = 2;
  EXPECT_EQ(read(words).error().code, ErrorCode::unsupportedVersion);
}

// Without the checksum mended it is refused; with it, it is refused or evaluated inside its arrays.
TEST(RigBytes, ADamagedWordIsFoundOrHarmless) {
  std::mt19937 random(12);
  const std::vector<std::uint32_t> good = wordsOf(allDrivers().pack());
  std::size_t accepted = 0, refused = 0;
  for (std::size_t word = 0; word < good.size(); ++word) {
    for (const std::uint32_t value :
         {0u, 1u, good[word] + 1, good[word] + 4, good[word] ^ 0x80000000u, 0x7fc00000u,
          0xffffffffu, 0xfffffffcu, static_cast<std::uint32_t>(good.size()),
          std::uint32_t(random())}) {
      if (value == good[word]) continue;
      std::vector<std::uint32_t> words = good;
      words[word] = value;
      EXPECT_FALSE(read(words).ok()) << "word " << word;
      if (word == 2) continue;  // the checksum
      words[2] = checksumOf(words);
      const Result<PackedRig> rig = read(words);
      if (!rig) {
        ++refused;
        continue;
      }
      ++accepted;
      if (std::uint64_t{rig->givenWeights()} + rig->drivenWeights() > 1u << 20) continue;
      const std::vector<JointMatrix> pose(rig->writtenJoints(), jointMatrixOf(glm::dmat4(1)));
      (void)evaluated(*rig, pose, std::vector<float>(rig->givenWeights(), 0.5f));
    }
  }
  EXPECT_GT(refused, 1000u);
  EXPECT_GT(accepted, 1000u);
}

/// The words with one of the header, or of the first corrective, changed.
std::vector<std::uint32_t> withWord(const PackedRig& rig, std::size_t word, std::uint32_t value) {
  std::vector<std::uint32_t> words = wordsOf(rig);
  words[word] = value;
  finishStored(words);
  return words;
}

// `evaluateRig` allocates memory for them, and each thread of `evaluateRigs`, too.
TEST(RigBytes, TheMostInputsAreThoseOfACorrective) {
  MadeRig made = allDrivers();
  const PackedRig rig = made.pack();
  constexpr std::size_t word = offsetof(RigHeader, mostInputs) / 4;
  EXPECT_EQ(RigBlob(rig).header.mostInputs, 2u);
  EXPECT_TRUE(read(withWord(rig, word, 2)).ok());
  for (const std::uint32_t wrong : {0u, 1u, 3u, RigBlob(rig).header.wordCount})
    EXPECT_FALSE(read(withWord(rig, word, wrong)).ok()) << wrong;
  made = MadeRig();
  made.addJoint(noRigJoint, glm::dmat4(1));
  made.writtenJoints = 1;
  EXPECT_EQ(RigBlob(made.pack()).header.mostInputs, 0u);
  EXPECT_FALSE(read(withWord(made.pack(), word, 1)).ok());
}

// A GPU may take a denormal number for 0, for which distances are not in an exponential.
TEST(RigBytes, TheFactorOfACorrectiveIsNormal) {
  const PackedRig rig = allDrivers().pack();
  const RigBlob blob(rig);
  std::size_t word = offsetof(RigCorrective, factor) / 4;
  for (std::size_t i = 0; i < blob.header.driverCount; ++i)
    if (blob.driver(i).kind == abi::RIG_CORRECTIVE) word += blob.driver(i).data;
  const auto isRead = [&](float factor) {
    return read(withWord(rig, word, std::bit_cast<std::uint32_t>(factor))).ok();
  };
  constexpr float least = std::numeric_limits<float>::min();
  for (const float good : {0.0f, -0.0f, -least, -0.5f, -1e30f}) EXPECT_TRUE(isRead(good)) << good;
  for (const float bad : {-1e-40f, 1e-40f, -0.99f * least, least, 1.0f})
    EXPECT_FALSE(isRead(bad)) << bad;
  for (const float bad : notFinite) EXPECT_FALSE(isRead(bad)) << bad;
}

/// With drivers at its end that drive nothing: chains of one node, which is the same for all.
std::vector<std::uint32_t> withIdleChains(const PackedRig& rig, std::uint32_t count) {
  std::vector<std::uint32_t> words = wordsOf(rig);
  const auto node = static_cast<std::uint32_t>(words.size());
  words.resize(words.size() + abi::RIG_NODE_WORDS);
  words[node + 1] = node;  // its joints: none
  const RigHeader header = RigBlob(rig).header;
  const auto drivers = static_cast<std::uint32_t>(words.size());
  for (std::uint32_t i = 0; i < header.driverCount * abi::RIG_DRIVER_WORDS; ++i)
    words.push_back(words[header.drivers + i]);
  for (std::uint32_t i = 0; i < count; ++i) words.insert(words.end(), {abi::RIG_CHAIN, node, 1, 0});
  words[offsetof(RigHeader, drivers) / 4] = drivers;
  words[offsetof(RigHeader, driverCount) / 4] = header.driverCount + count;
  finishStored(words);
  return words;
}

// What a rig costs is bounded by its bytes.
TEST(RigBytes, ManyDriversCannotShareTheirData) {
  const PackedRig rig = allDrivers().pack();
  EXPECT_TRUE(read(withIdleChains(rig, 1)).ok());
  EXPECT_FALSE(read(withIdleChains(rig, 1000)).ok());
}

}  // namespace
}  // namespace dermis::test
