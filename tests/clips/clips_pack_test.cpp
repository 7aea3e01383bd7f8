// What `packClips` makes of hand-made skeletons: constant tracks, nodes at rest, jumps, its report.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "clip_rig.h"
#include "random_number.h"

namespace dermis::test {
namespace {

/// A rig with one clip of one channel.
gltf::Model rigWith(double duration, gltf::Channel moved) {
  gltf::Model model = armRig();
  model.clips.clear();
  model.clips.push_back({"only", duration, {std::move(moved)}});
  return model;
}

/// At 100 random times, and at both ends.
void checkClips(const PackedRig& rig) {
  std::mt19937 random(1);
  for (std::uint32_t clip = 0; clip < rig.clips.size(); ++clip) {
    const double duration = rig.clips[clip].duration;
    rig.check(ClipLayer{.clip = clip});
    rig.check(ClipLayer{.clip = clip, .time = duration, .hold = true});
    for (int i = 0; i < 100; ++i) {
      const ClipLayer layer{.clip = clip, .time = duration * between(random, -1, 2)};
      if (!rig.isNearJump(layer)) rig.check(layer);
    }
  }
}

TEST(ClipsPack, KeepsTheError) {
  PackedRig rig(armRig());
  ASSERT_TRUE(rig.pack());
  EXPECT_GT(rig.report.worstError, 0);
  checkClips(rig);
}

/// Joints 1 apart, which all turn by 24 degrees a frame about one axis.
gltf::Model turningChain(std::uint32_t joints, std::uint32_t frames) {
  gltf::Model model;
  model.nodes.resize(joints);
  model.skins = {{"skin", {}, std::vector<JointMatrix>(joints)}};
  model.clips.push_back({"turn", frames / 30.0, {}});
  Floats times, rotations;
  for (std::uint32_t frame = 0; frame <= frames; ++frame) {
    const double half = 12 * std::numbers::pi / 180 * frame;
    times.push_back(static_cast<float>(frame / 30.0));
    for (const double x : {0.0, 0.0, std::sin(half), std::cos(half)})
      rotations.push_back(static_cast<float>(x));
  }
  for (std::uint32_t joint = 0; joint < joints; ++joint) {
    if (joint > 0) {
      model.nodes[joint].parent = joint - 1;
      model.nodes[joint].translation = {1, 0, 0};
    }
    model.nodeOrder.push_back(joint);
    model.skins[0].joints.push_back(joint);
    model.clips[0].channels.push_back(channel(joint, ChannelPath::rotation, times, rotations));
  }
  return model;
}

/// The largest distance, over all joints, of a point 1 away along an axis from where the clip has
/// it.
double errorAt(const PackedRig& rig, double seconds) {
  const double time = double{clipTime(rig.bank->clip(0), seconds, true)};
  const std::vector<JointMatrix> pose = rig.sample(ClipLayer{.time = time, .hold = true});
  const std::vector<Transform> exact = gltf::nodeGlobals(rig.model, 0, time);
  double worst = 0;
  for (std::size_t joint = 0; joint < pose.size(); ++joint) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const double side : {-1.0, 1.0}) {
        std::array<double, 3> off{};
        for (std::size_t row = 0; row < 3; ++row) {
          const auto& stored = pose[joint].m[row];
          off[row] = double{stored[3]} - exact[joint][row][3] +
                     side * (double{stored[axis]} - exact[joint][row][axis]);
        }
        worst = std::max(worst, std::hypot(off[0], off[1], off[2]));
      }
    }
  }
  return worst;
}

// Small errors of fast rotations add up along a chain, and are 0 halfway between two keys.
TEST(ClipsPack, KeepsTheErrorOfChainsBetweenKeys) {
  for (const auto& [joints, frames] : {std::pair(4u, 30u), std::pair(30u, 10u)}) {
    SCOPED_TRACE(joints);
    PackedRig rig(turningChain(joints, frames));
    ASSERT_TRUE(rig.pack());
    std::mt19937 random(1);
    double worst = 0;
    for (int i = 0; i < 2000; ++i)
      worst = std::max(worst, errorAt(rig, between(random, 0, rig.clips[0].duration)));
    EXPECT_LE(worst, rig.report.maxError);
    EXPECT_LE(worst, 1.03 * rig.report.worstError);
  }
}

TEST(ClipsPack, ReportsWhatItMade) {
  PackedRig rig(armRig());
  ASSERT_TRUE(rig.pack());
  EXPECT_GE(rig.report.animatedTracks, 7u) << "channels of both clips";
  EXPECT_GE(rig.report.keyCount, 2 * rig.report.animatedTracks);
  EXPECT_GT(rig.report.slowestRate, 0);
  EXPECT_LT(rig.report.slowestRate, rig.report.fastestRate) << "some tracks need fewer keys";
  const auto has = [&](const char* text) {
    return rig.report.worst.find(text) != std::string::npos;
  };
  EXPECT_TRUE(has("wave") || has("reach")) << rig.report.worst;
  EXPECT_TRUE(has("hand") || has("upper") || has("body") || has("prop")) << rig.report.worst;
  EXPECT_TRUE(has(" at ")) << rig.report.worst;
}

TEST(ClipsPack, AFailureLeavesTheReport) {
  PackedRig rig(armRig());
  rig.report.byteCount = 77;
  rig.report.worst = "before";
  rig.clips[0].duration = -1;
  EXPECT_FALSE(rig.tryToPack().ok());
  EXPECT_EQ(rig.report.byteCount, 77u);
  EXPECT_EQ(rig.report.worst, "before");
}

TEST(ClipsPack, NeedsNoReport) {
  PackedRig rig(armRig());
  ASSERT_TRUE(rig.pack());
  const Result<PackedClips> again = packClips(rig.skeleton, rig.clips);
  ASSERT_TRUE(again.ok());
  EXPECT_TRUE(std::ranges::equal(again->bytes(), rig.bank->bytes())) << "the same bits each time";
}

TEST(ClipsPack, ALargerErrorTakesFewerBytes) {
  std::uint64_t before = ~std::uint64_t{0};
  for (const double error : {1e-5, 1e-4, 1e-3, 1e-2}) {
    PackedRig rig(armRig());
    rig.options.maxError = error;
    ASSERT_TRUE(rig.pack());
    EXPECT_EQ(rig.report.maxError, error);
    EXPECT_LE(rig.report.byteCount, before);
    before = rig.report.byteCount;
    checkClips(rig);
  }
}

TEST(ClipsPack, TheDefaultErrorFollowsTheExtent) {
  gltf::Model large = armRig();
  for (gltf::Node& node : large.nodes) {
    for (double& length : node.translation) length *= 8;
    if (node.matrix) {
      for (std::size_t i = 12; i < 15; ++i) (*node.matrix)[i] *= 8;
    }
  }
  PackedRig rig(armRig()), largeRig(std::move(large));
  ASSERT_TRUE(rig.pack() && largeRig.pack());
  EXPECT_NEAR(largeRig.report.maxError, 8 * rig.report.maxError, 1e-9);
  EXPECT_GT(rig.report.maxError, 2e-5 * rig.extent());
  EXPECT_LT(rig.report.maxError, 2e-4 * rig.extent());
}

TEST(ClipsPack, AChannelOfEqualKeysIsConstant) {
  PackedRig rig(rigWith(
      1, channel(arm::body, ChannelPath::translation, {0, 0.3f, 1}, {1, 2, 3, 1, 2, 3, 1, 2, 3})));
  ASSERT_TRUE(rig.pack());
  EXPECT_EQ(rig.report.animatedTracks, 0u);
  EXPECT_EQ(rig.report.keyCount, 0u);
  EXPECT_GE(rig.report.constantTracks, 1u);
  checkClips(rig);
}

// q and -q are the same rotation.
TEST(ClipsPack, RotationsOfOtherSignsAreConstant) {
  PackedRig rig(rigWith(1, channel(arm::hand, ChannelPath::rotation, {0, 0.5f, 1},
                                   {0.6f, 0, 0, 0.8f, -0.6f, 0, 0, -0.8f, 1.2f, 0, 0, 1.6f})));
  ASSERT_TRUE(rig.pack());
  EXPECT_EQ(rig.report.animatedTracks, 0u);
  checkClips(rig);
}

// Between keys a rotation needs unit length: a bank of longer ones is the same.
TEST(ClipsPack, RotationsMayHaveAnyLength) {
  const Floats times{0, 0.4f, 1};
  PackedRig rig(rigWith(1, channel(arm::hand, ChannelPath::rotation, times,
                                   {0, 0, 0, 1, 0.6f, 0, 0, 0.8f, 0, 1, 0, 0})));
  PackedRig longer(rigWith(1, channel(arm::hand, ChannelPath::rotation, times,
                                      {0, 0, 0, 2, 3, 0, 0, 4, 0, 0.25f, 0, 0})));
  ASSERT_TRUE(rig.pack() && longer.pack());
  EXPECT_TRUE(std::ranges::equal(rig.bank->bytes(), longer.bank->bytes()));
  checkClips(longer);
}

TEST(ClipsPack, MeshesThatReachFartherNeedFinerRotations) {
  const auto bytesWith = [](float length) {
    const std::array<float, 3> position{0, length, 0};
    const std::uint8_t joint = 0;
    const float weight = 1;
    const InfluenceSet influences{{&joint, 1, 1, ComponentType::uint8, 1},
                                  {&weight, 1, 4, ComponentType::float32, 1}};
    MeshView mesh;
    mesh.vertexCount = 1;
    mesh.positions = {position.data(), 1, 12, ComponentType::float32, 3};
    mesh.influenceSets = {&influences, 1};
    const Result<JointBounds> bounds = jointBounds(mesh, 1);
    PackedRig rig(armRig());
    // The joint that turns is the first of the skin.
    const std::array<std::uint32_t, 1> joints{arm::hand};
    const std::array<JointMatrix, 1> inverseBind;
    rig.skeleton.skins = {{"one", joints, inverseBind}};
    const std::array<const JointBounds*, 1> meshes{&*bounds};
    rig.options.meshes = meshes;
    rig.options.maxError = 1e-3;
    EXPECT_TRUE(rig.pack());
    return rig.report.byteCount;
  };
  EXPECT_GT(bytesWith(30), bytesWith(0.1f));
}

TEST(ClipsPack, FoldsWhatNoClipMoves) {
  PackedRig rig(armRig());
  ASSERT_TRUE(rig.pack());
  EXPECT_EQ(rig.bank->nodeCount(), 3u);
  EXPECT_EQ(rig.bank->jointCount(0), 6u);
  EXPECT_EQ(rig.bank->jointCount(1), 2u);
  EXPECT_EQ(rig.bank->jointCount(2), 0u);
  const auto isExact = [&](std::uint32_t node) {
    const ClipError error = rig.bank->error(node);
    return error.translation == 0 && error.rotation == 0 && error.scale == 0;
  };
  for (const std::uint32_t node : {arm::root, arm::prop, arm::shoulder, arm::collar, arm::stand})
    EXPECT_TRUE(isExact(node)) << node;
  EXPECT_TRUE(isExact(arm::nodeCount)) << "there is none";
  for (const std::uint32_t node : {arm::hand, arm::upper, arm::body})
    EXPECT_FALSE(isExact(node)) << node;
}

TEST(ClipsPack, WithoutClipsAllNodesRest) {
  gltf::Model model = armRig();
  model.clips.clear();
  PackedRig rig(std::move(model));
  ASSERT_TRUE(rig.pack());
  EXPECT_EQ(rig.bank->nodeCount(), 0u);
  rig.check(std::span<const ClipLayer>());
}

TEST(ClipsPack, NodesAreInAnyOrder) {
  const gltf::Model model = armRig();
  std::mt19937 random(1);
  for (int order = 0; order < 10; ++order) {
    std::vector<std::uint32_t> places(model.nodes.size());  // of the old nodes
    for (std::uint32_t i = 0; i < places.size(); ++i) places[i] = i;
    for (std::size_t i = places.size(); i > 1; --i)
      std::swap(places[i - 1], places[below(random, i)]);
    gltf::Model other = model;
    const auto move = [&](std::uint32_t& node) {
      if (node != noIndex) node = places[node];
    };
    for (std::size_t i = 0; i < places.size(); ++i) other.nodes[places[i]] = model.nodes[i];
    for (gltf::Node& node : other.nodes) move(node.parent);
    for (std::uint32_t& node : other.nodeOrder) move(node);
    for (gltf::Skin& skin : other.skins) std::ranges::for_each(skin.joints, move);
    for (gltf::Clip& clip : other.clips)
      for (gltf::Channel& channel : clip.channels) move(channel.node);
    PackedRig rig(std::move(other));
    ASSERT_TRUE(rig.pack());
    checkClips(rig);
  }
}

TEST(ClipsPack, AClipOfDurationZero) {
  for (const Floats& times : {Floats{0}, Floats{0.5f}, Floats{0, 0}, Floats{-1, 1}}) {
    Floats values{0.1f, 0.2f, 0.3f};
    if (times.size() == 2) values.insert(values.end(), {1.1f, 1.2f, 1.3f});
    PackedRig rig(rigWith(0, channel(arm::body, ChannelPath::translation, times, values)));
    ASSERT_TRUE(rig.pack());
    EXPECT_EQ(rig.bank->clip(0).duration, 0);
    for (const double time : {0.0, 1.0, -3.5})
      for (const bool hold : {false, true}) rig.check(ClipLayer{.time = time, .hold = hold});
  }
}

TEST(ClipsPack, KeysOutsideOfTheClip) {
  PackedRig rig(rigWith(1, channel(arm::body, ChannelPath::translation, {-0.7f, 0.4f, 1.9f},
                                   {0, 0, 0, 0, 1, 0, 1, 0, 0})));
  ASSERT_TRUE(rig.pack());
  checkClips(rig);
}

// The clip's end is not its beginning: between them is no time.
TEST(ClipsPack, ASeamStaysOne) {
  PackedRig rig(
      rigWith(1, channel(arm::body, ChannelPath::translation, {0, 1}, {0, 0, 0, 1, 0, 0})));
  ASSERT_TRUE(rig.pack());
  for (const double time : {0.0, 1e-7, 1e-4, 0.9999, 0.9999999, 1.0, 1.0001, -1e-4, 2.0})
    rig.check(ClipLayer{.time = time});
}

TEST(ClipsPack, AJumpStaysOne) {
  for (const float at : {0.1f, 0.31234f, 0.5f, 0.98765f}) {
    PackedRig rig(rigWith(1, channel(arm::body, ChannelPath::translation, {0, at, at, 1},
                                     {0, 0, 0, 0, 0, 0, 1, 2, 3, 1, 2, 3})));
    ASSERT_TRUE(rig.pack());
    EXPECT_LT(rig.report.keyCount, 50u);
    // Rounded to 1/256 of an interval, which is no longer than the clip.
    for (const double off : {1.0 / 250, 0.01, 0.1}) {
      for (const double time : {double{at} - off, double{at} + off})
        if (time > 0 && time < 1) rig.check(ClipLayer{.time = time});
    }
    checkClips(rig);
  }
}

// Around a jump a bank has no slope. It keeps the error, or says where it cannot.
TEST(ClipsPack, AJumpInMotionIsExactOrRefused) {
  PackedRig rig(rigWith(1, channel(arm::body, ChannelPath::translation, {0, 0.41f, 0.41f, 1},
                                   {0, 0, 0, 1, 0, 0, 5, 0, 0, 6, 0, 0})));
  if (const Result<PackedClips> packed = rig.tryToPack(); !packed) {
    EXPECT_EQ(packed.error().code, ErrorCode::limitExceeded);
    EXPECT_NE(packed.error().message.find("only"), std::string::npos) << packed.error().message;
    EXPECT_NE(packed.error().message.find("body"), std::string::npos) << packed.error().message;
    return;
  }
  ASSERT_TRUE(rig.pack());
  checkClips(rig);
}

// If each node were measured from all those above it, this would take minutes.
TEST(ClipsPack, ALongChain) {
  gltf::Model model;
  model.nodes.resize(10'000);
  model.clips.push_back({"sway", 0.125, {}});
  for (std::uint32_t node = 0; node < model.nodes.size(); ++node) {
    if (node > 0) model.nodes[node].parent = node - 1;
    model.nodeOrder.push_back(node);
    model.clips[0].channels.push_back(channel(node, ChannelPath::translation, {0}, {0, 1, 0}));
  }
  model.skins = {{"skin", {0, 100}, std::vector<JointMatrix>(2)}};
  PackedRig rig(std::move(model));
  ASSERT_TRUE(rig.pack());
  rig.check(ClipLayer{.time = 0.1});
}

}  // namespace
}  // namespace dermis::test
