// What `packClips` refuses, and that its message says where.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "clip_rig.h"

namespace dermis::test {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double notANumber = std::numeric_limits<double>::quiet_NaN();

/// Of the channel: clip "wave" turns "hand" first.
constexpr const char *clipName = "wave", *nodeName = "hand";

/// Expects an error that names these.
void expectRefused(PackedRig& rig, ErrorCode code, const std::vector<std::string>& names) {
  const Result<PackedClips> packed = rig.tryToPack();
  ASSERT_FALSE(packed.ok());
  const std::string& message = packed.error().message;
  EXPECT_EQ(packed.error().code, code) << message;
  EXPECT_FALSE(message.empty());
  EXPECT_FALSE(message.ends_with('.')) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  for (const std::string& name : names)
    EXPECT_NE(message.find(name), std::string::npos) << '"' << message << "\" without " << name;
}

void expectRefused(const std::function<void(PackedRig&)>& change,
                   const std::vector<std::string>& names,
                   ErrorCode code = ErrorCode::invalidArgument) {
  PackedRig rig(armRig());
  change(rig);
  expectRefused(rig, code, names);
}

ChannelView& firstChannel(PackedRig& rig) {
  return rig.clips[0].channels[0];
}

TEST(ClipsRefused, NodesWithNumbersThatAreNotFinite) {
  for (const double bad : {infinity, -infinity, notANumber}) {
    expectRefused([=](PackedRig& rig) { rig.skeleton.nodes[arm::hand].translation[1] = bad; },
                  {nodeName});
    expectRefused([=](PackedRig& rig) { rig.skeleton.nodes[arm::hand].rotation[3] = bad; },
                  {nodeName});
    expectRefused([=](PackedRig& rig) { rig.skeleton.nodes[arm::hand].scale[2] = bad; },
                  {nodeName});
    expectRefused([=](PackedRig& rig) { (*rig.skeleton.nodes[arm::prop].matrix)[2][3] = bad; },
                  {"prop"});
  }
}

TEST(ClipsRefused, ANodeWithoutRotation) {
  expectRefused(
      [](PackedRig& rig) {
        rig.skeleton.nodes[arm::hand].rotation = {0, 0, 0, 0};
      },
      {nodeName});
}

TEST(ClipsRefused, ParentsInACycle) {
  expectRefused([](PackedRig& rig) { rig.skeleton.nodes[arm::body].parent = arm::hand; }, {});
  expectRefused([](PackedRig& rig) { rig.skeleton.nodes[arm::stand].parent = arm::stand; },
                {"stand"});
}

TEST(ClipsRefused, AnAnimatedNodeWithAMatrix) {
  expectRefused([](PackedRig& rig) { firstChannel(rig).node = arm::prop; }, {clipName, "prop"});
}

TEST(ClipsRefused, Skins) {
  expectRefused([](PackedRig& rig) { rig.skeleton.skins.clear(); }, {"skin"});
  const std::vector<std::uint32_t> joints{0, arm::nodeCount};
  expectRefused([&](PackedRig& rig) { rig.skeleton.skins[1].joints = joints; }, {"stand"});
  expectRefused(
      [](PackedRig& rig) {
        rig.skeleton.skins[1].inverseBind = rig.skeleton.skins[1].inverseBind.first(1);
      },
      {"stand"});
  for (const double bad : {infinity, notANumber}) {
    const std::vector<JointMatrix> matrices{
        {}, {{{1, 0, 0, 0}, {0, 1, 0, static_cast<float>(bad)}, {0, 0, 1, 0}}}};
    expectRefused([&](PackedRig& rig) { rig.skeleton.skins[1].inverseBind = matrices; }, {"stand"});
  }
}

TEST(ClipsRefused, ASkinOfTooManyJoints) {
  std::vector<std::uint32_t> joints(maxPoseJoints + 1, arm::hand);
  std::vector<JointMatrix> matrices(joints.size());
  const auto use = [&](PackedRig& rig) {
    rig.skeleton.skins[1].joints = joints;
    rig.skeleton.skins[1].inverseBind = matrices;
  };
  expectRefused(use, {"stand"}, ErrorCode::limitExceeded);
  joints.pop_back();
  matrices.pop_back();
  PackedRig rig(armRig());
  use(rig);
  ASSERT_TRUE(rig.pack());
  EXPECT_EQ(rig.bank->jointCount(1), maxPoseJoints);
}

TEST(ClipsRefused, Durations) {
  for (const double bad : {-1e-3, infinity, notANumber})
    expectRefused([=](PackedRig& rig) { rig.clips[1].duration = bad; }, {"reach"});
}

TEST(ClipsRefused, ChannelsThatDoNotFit) {
  expectRefused([](PackedRig& rig) { firstChannel(rig).node = arm::nodeCount; }, {clipName});
  expectRefused([](PackedRig& rig) { firstChannel(rig).times = {}; }, {clipName, nodeName});
  expectRefused([](PackedRig& rig) { firstChannel(rig).values = {}; }, {clipName, nodeName});
  expectRefused(
      [](PackedRig& rig) { firstChannel(rig).values = firstChannel(rig).values.first(15); },
      {clipName, nodeName});
  // Three times as many values, or a quarter less.
  expectRefused(
      [](PackedRig& rig) { firstChannel(rig).interpolation = Interpolation::cubicSpline; },
      {clipName, nodeName});
  expectRefused([](PackedRig& rig) { firstChannel(rig).path = ChannelPath::translation; },
                {clipName, nodeName});
  expectRefused(
      [](PackedRig& rig) { firstChannel(rig).interpolation = static_cast<Interpolation>(3); },
      {clipName, nodeName});
  expectRefused([](PackedRig& rig) { firstChannel(rig).path = static_cast<ChannelPath>(4); },
                {clipName, nodeName});
}

TEST(ClipsRefused, TwoChannelsOfOneNodeAndPath) {
  expectRefused([](PackedRig& rig) { rig.clips[0].channels.push_back(firstChannel(rig)); },
                {clipName, nodeName});
}

TEST(ClipsRefused, WeightsThatDoNotFit) {
  const Floats rest{0, 1}, times{0, 1}, values{0, 0, 1, 1}, infinite{0, HUGE_VALF};
  const ChannelView good{
      .node = arm::prop, .path = ChannelPath::weights, .times = times, .values = values};
  const auto with = [&](auto change) {
    return [&, change](PackedRig& rig) {
      rig.skeleton.nodes[arm::prop].weights = rest;
      rig.clips[0].channels.push_back(good);
      change(rig, rig.clips[0].channels.back());
    };
  };
  PackedRig rig(armRig());
  with([](PackedRig&, ChannelView&) {})(rig);
  EXPECT_TRUE(rig.pack()) << "a node with a matrix may have weights";
  expectRefused(
      with([](PackedRig& of, ChannelView&) { of.skeleton.nodes[arm::prop].weights = {}; }),
      {clipName, "prop", "no weights"});
  expectRefused(
      with([&](PackedRig& of, ChannelView&) { of.skeleton.nodes[arm::prop].weights = infinite; }),
      {"prop"});
  expectRefused(with([](PackedRig&, ChannelView& of) { of.values = of.values.first(3); }),
                {clipName, "prop"});
  expectRefused(
      with([](PackedRig&, ChannelView& of) { of.interpolation = Interpolation::cubicSpline; }),
      {clipName, "prop"});
  expectRefused(with([](PackedRig&, ChannelView& of) { of.times = {}; }), {clipName, "prop"});
  expectRefused(with([&](PackedRig&, ChannelView& of) { of.times = infinite; }),
                {clipName, "prop"});
  expectRefused(with([&](PackedRig& of, ChannelView&) { of.clips[0].channels.push_back(good); }),
                {clipName, "prop"});
  expectRefused(with([](PackedRig& of, ChannelView&) { of.options.maxWeightError = 1e-12; }),
                {clipName, "prop", "maxWeightError"}, ErrorCode::limitExceeded);
}

TEST(ClipsRefused, KeysThatDescendOrAreNotFinite) {
  const auto withTime = [](float time) {
    const Floats times{0, 0.5f, time, 1.25f};
    expectRefused([&](PackedRig& rig) { firstChannel(rig).times = times; }, {clipName, nodeName});
  };
  for (const double bad : {0.49, -1.0, 1.3, infinity, -infinity, notANumber})
    withTime(static_cast<float>(bad));
  for (const double bad : {infinity, -infinity, notANumber}) {
    PackedRig rig(armRig());
    Floats values(firstChannel(rig).values.begin(), firstChannel(rig).values.end());
    values[6] = static_cast<float>(bad);
    firstChannel(rig).values = values;
    expectRefused(rig, ErrorCode::invalidArgument, {clipName, nodeName});
  }
}

TEST(ClipsRefused, BasesOfAdditiveClips) {
  const auto base = [](PackedRig& rig, std::uint32_t clip, double time) {
    rig.clips[1].additive = true;
    rig.clips[1].baseClip = clip;
    rig.clips[1].baseTime = time;
  };
  expectRefused([&](PackedRig& rig) { base(rig, 1, 0); }, {"reach"});
  for (const double bad : {infinity, notANumber})
    expectRefused([&](PackedRig& rig) { base(rig, 0, bad); }, {"reach"});
  expectRefused(
      [&](PackedRig& rig) {
        base(rig, 0, 0);
        rig.clips[0].additive = true;
      },
      {"reach"});
  // Without such a clip it is the pose at rest.
  PackedRig rig(armRig());
  base(rig, 2, 0);
  EXPECT_TRUE(rig.pack());
}

TEST(ClipsRefused, Options) {
  for (const double bad : {-1e-3, infinity, notANumber}) {
    expectRefused([=](PackedRig& rig) { rig.options.maxError = bad; }, {"maxError"});
    expectRefused([=](PackedRig& rig) { rig.options.maxWeightError = bad; }, {"maxWeightError"});
  }
  for (const double bad : {-1e-3, 1.001, infinity, notANumber}) {
    expectRefused(
        [=](PackedRig& rig) {
          rig.masks.assign(2, Floats(arm::nodeCount, 1));
          rig.masks[1][3] = static_cast<float>(bad);
        },
        {"mask"});
  }
  for (const std::uint32_t count : {0u, arm::nodeCount - 1, arm::nodeCount + 1})
    expectRefused([=](PackedRig& rig) { rig.masks.emplace_back(count, 1.0f); }, {"mask"});
  const JointBounds bounds;
  const std::vector<const JointBounds*> meshes(3, &bounds);
  expectRefused([&](PackedRig& rig) { rig.options.meshes = meshes; }, {"mesh"});
  expectRefused([&](PackedRig& rig) { rig.options.meshes = std::span(meshes).first(1); }, {"mesh"});
}

TEST(ClipsRefused, MoreMasksThanTheMaximum) {
  PackedRig rig(armRig());
  rig.masks.assign(maxMasks, Floats(arm::nodeCount, 0.5f));
  ASSERT_TRUE(rig.pack());
  rig.masks.emplace_back(arm::nodeCount, 0.5f);
  expectRefused(rig, ErrorCode::limitExceeded, {"mask", std::to_string(maxMasks)});
}

TEST(ClipsRefused, MoreClipsThanTheMaximum) {
  PackedRig rig(armRig());
  rig.clips.resize(2);
  rig.clips.resize(maxClips, ClipView{.name = "empty", .duration = 1, .channels = {}});
  ASSERT_TRUE(rig.pack());
  rig.check(ClipLayer{.clip = maxClips - 1, .time = 0.5});
  rig.clips.push_back(rig.clips.back());
  expectRefused(rig, ErrorCode::limitExceeded, {std::to_string(maxClips)});
}

TEST(ClipsRefused, AnErrorThatCannotBeKept) {
  PackedRig rig(armRig());
  rig.clips.resize(1);
  rig.options.maxError = 1e-12;
  const Result<PackedClips> packed = rig.tryToPack();
  ASSERT_FALSE(packed.ok());
  expectRefused(rig, ErrorCode::limitExceeded, {clipName});
  const std::string& message = packed.error().message;
  EXPECT_TRUE(message.find("hand") != std::string::npos ||
              message.find("upper") != std::string::npos ||
              message.find("body") != std::string::npos)
      << message;
}

// A small file may name many nodes and clips, or have two near keys in a long clip.
TEST(ClipsRefused, ClipsThatTakeMuchMoreMemoryThanTheirSource) {
  PackedRig rig(armRig());
  rig.clips.assign(1, ClipView{.name = "short", .duration = 1, .channels = {}});
  const Floats times{0, 1}, moved{0, 0, 0, 1, 0, 0};
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const auto node = static_cast<std::uint32_t>(rig.skeleton.nodes.size());
    rig.skeleton.nodes.emplace_back();
    rig.clips[0].channels.push_back(
        {node, ChannelPath::translation, Interpolation::linear, times, moved});
  }
  rig.clips.resize(1000, ClipView{.name = "empty", .duration = 0, .channels = {}});
  expectRefused(rig, ErrorCode::limitExceeded, {"1000 clips of ", "memory"});
}

TEST(ClipsRefused, KeysThatTakeMuchMoreMemoryThanTheirSource) {
  PackedRig rig(armRig());
  rig.options.maxError = 0.01;
  const Floats times{0, 0.003f, 0.006f}, moved{0, 0, 0, 1, 0, 0, 0, 0, 0};
  rig.clips.assign(1, ClipView{.name = "long", .duration = 1600, .channels = {}});
  // Each track needs half a million keys.
  for (int i = 0; i < 12; ++i) {
    const auto node = static_cast<std::uint32_t>(rig.skeleton.nodes.size());
    rig.skeleton.nodes.emplace_back();
    rig.clips[0].channels.push_back(
        {node, ChannelPath::translation, Interpolation::step, times, moved});
  }
  expectRefused(rig, ErrorCode::limitExceeded, {"long", "memory"});
}

// Found by a fuzzer: what was packed could not be read again.
TEST(ClipsRefused, NumbersBeyondFloat32) {
  expectRefused([](PackedRig& rig) { (*rig.skeleton.nodes[arm::prop].matrix)[2][3] = 1e200; },
                {"float32"}, ErrorCode::limitExceeded);
}

// What is not clamped to a range of float32 has no integer.
TEST(ClipsRefused, KeysBeyondFloat32) {
  const Floats times{0, 0.5f, 1}, moved{3e38f, 0, 0, -3e38f, 0, 0, 3e38f, 0, 0};
  const std::vector<std::string> names{"huge", "stand", "float32"};
  for (const Interpolation interpolation : {Interpolation::linear, Interpolation::step}) {
    PackedRig rig(armRig());
    rig.clips.assign(1, ClipView{.name = "huge", .duration = 1, .channels = {}});
    rig.clips[0].channels = {{arm::stand, ChannelPath::translation, interpolation, times, moved}};
    rig.options.maxError = 1e30;
    expectRefused(rig, ErrorCode::limitExceeded, names);
    // A quotient of scales.
    const Floats first{0}, tiny{1e-42f, 1, 1}, scales{1e30f, 1, 1, 2e30f, 1, 1, 1e30f, 1, 1};
    rig.clips.push_back(rig.clips[0]);
    rig.clips[0].channels[0] = {arm::stand, ChannelPath::scale, interpolation, first, tiny};
    rig.clips[1].channels[0] = {arm::stand, ChannelPath::scale, interpolation, times, scales};
    rig.clips[1].additive = true;
    rig.clips[1].baseClip = 0;
    expectRefused(rig, ErrorCode::limitExceeded, names);
  }
  const Floats rest{0};
  const Floats weights{3e38f, -3e38f, 3e38f};
  PackedRig rig(armRig());
  rig.clips.assign(1, ClipView{.name = "huge", .duration = 1, .channels = {}});
  rig.skeleton.nodes[arm::stand].weights = rest;
  rig.options.maxWeightError = 1e30;
  rig.clips[0].channels = {
      {arm::stand, ChannelPath::weights, Interpolation::linear, times, weights}};
  expectRefused(rig, ErrorCode::limitExceeded, names);
}

}  // namespace
}  // namespace dermis::test
