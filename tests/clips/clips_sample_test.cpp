// Sampling: what is refused, the time of a clip, and how layers, masks and differences combine.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "clip_rig.h"
#include "dermis/verify.h"
#include "random_number.h"

namespace dermis::test {
namespace {

/// Clips of the rig below.
constexpr std::uint32_t wave = 0, reach = 1, reachOnce = 2, addReach = 3, addWave = 4;
/// Masks: factors of the hand and of all other nodes.
constexpr std::uint32_t onlyHand = 1, nothing = 2, everything = 3, mixed = 4, tiny = 5;

using Layers = std::vector<ClipLayer>;

/// The arm's clips, the second once more without wrapping, and both as differences: from the rest
/// pose, and from the other clip.
class ClipsSample : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    rig_ = std::make_unique<PackedRig>(armRig());
    std::vector<ClipView>& clips = rig_->clips;
    clips.insert(clips.end(), {clips[reach], clips[reach], clips[wave]});
    clips[reachOnce].wraps = false;
    clips[addReach].additive = clips[addWave].additive = true;
    clips[addWave].baseClip = reach;
    clips[addWave].baseTime = 0.5;
    rig_->masks = {Floats(arm::nodeCount, 0), Floats(arm::nodeCount, 0), Floats(arm::nodeCount, 1),
                   Floats(arm::nodeCount, 0.25f), Floats(arm::nodeCount, 0x0.ffp-60f)};
    rig_->masks[onlyHand - 1][arm::hand] = 1;
    rig_->masks[mixed - 1][arm::hand] = 0.75f;
    rig_->pack();
  }
  static void TearDownTestSuite() { rig_.reset(); }
  void SetUp() override { ASSERT_TRUE(rig_->bank.has_value()); }

  static const PackedRig& rig() { return *rig_; }
  static std::vector<JointMatrix> pose(const Layers& layers) { return rig_->sample(layers); }
  static void expectSame(const Layers& a, const Layers& b) {
    EXPECT_TRUE(areSame(pose(a), pose(b)));
  }
  /// Within the rounding errors of float32 matrices of about this size.
  static void expectNear(const Layers& a, const Layers& b, double tolerance = 1e-5) {
    const std::vector<JointMatrix> first = pose(a), second = pose(b);
    for (std::size_t joint = 0; joint < first.size(); ++joint)
      for (std::size_t row = 0; row < 3; ++row)
        for (std::size_t column = 0; column < 4; ++column)
          EXPECT_NEAR(first[joint].m[row][column], second[joint].m[row][column], tolerance)
              << "joint " << joint << ", row " << row << ", column " << column;
  }
  /// Fails with a message that has the text, and writes nothing.
  static void expectRefused(const Layers& layers, const std::string& text, std::uint32_t skin = 0,
                            std::size_t joints = 6) {
    JointMatrix before;
    before.m[1][2] = 77;
    std::vector<JointMatrix> written(joints, before);
    const Result<void> sampled = samplePose(*rig_->bank, layers, skin, written);
    ASSERT_FALSE(sampled.ok());
    EXPECT_EQ(sampled.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(sampled.error().message.find(text), std::string::npos) << sampled.error().message;
    EXPECT_TRUE(areSame(written, std::vector<JointMatrix>(joints, before)));
  }

 private:
  static inline std::unique_ptr<PackedRig> rig_;
};

TEST_F(ClipsSample, RefusesLayers) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr float notANumber = std::numeric_limits<float>::quiet_NaN();
  const ClipLayer good{.clip = wave, .time = 0.1};
  const auto refuse = [&](const ClipLayer& bad) {
    expectRefused({bad}, "layer 0");
    expectRefused({good, good, bad}, "layer 2");
    expectRefused({good, good, good, bad}, "layer 3");
  };
  refuse({.clip = 5});
  refuse({.clip = 0xffffffffu});
  refuse({.mask = 6});
  refuse({.mask = 0xffffffffu});
  for (const double time : {infinity, -infinity, double{notANumber}}) refuse({.time = time});
  for (const float weight : {notANumber, static_cast<float>(infinity), -1e-3f, 65520.0f, 1e30f})
    refuse({.weight = weight});
  for (const float weight : {notANumber, static_cast<float>(-infinity), -65520.0f, 65520.0f})
    refuse({.clip = addReach, .weight = weight});
  expectRefused({good, good, good, good, good}, "4");
}

TEST_F(ClipsSample, RefusesSkinsAndPoses) {
  expectRefused({}, "skin", 2);
  expectRefused({}, "skin", 0xffffffffu, 0);
  for (const std::size_t joints : {0u, 5u, 7u}) expectRefused({}, "6", 0, joints);
}

TEST_F(ClipsSample, AcceptsTheLargestWeights) {
  expectNear({{.clip = wave, .time = 0.3, .weight = 65504}}, {{.clip = wave, .time = 0.3}});
  expectNear({{.clip = wave, .time = 0.3, .weight = 65519}}, {{.clip = wave, .time = 0.3}});
  rig().check(ClipLayer{.clip = addReach, .time = 0.3, .weight = -1});
}

TEST_F(ClipsSample, OneLayerInPartsIsTheSame) {
  const Layers whole{{.clip = wave, .time = 0.37}};
  for (const Floats& weights :
       {Floats{0.5f, 0.5f}, Floats{0.25f, 0.75f}, Floats{0.125f, 0.5f, 0.375f},
        Floats{0.1f, 0.2f, 0.3f, 0.4f}, Floats{7}, Floats{0, 1, 0}, Floats{6e-8f, 6e-8f}}) {
    Layers parts;
    for (const float weight : weights)
      parts.push_back({.clip = wave, .time = 0.37, .weight = weight});
    expectNear(parts, whole);
  }
}

TEST_F(ClipsSample, WeightsCountByTheirRatio) {
  const auto blend = [](float size) {
    return Layers{{.clip = wave, .time = 0.3, .weight = size},
                  {.clip = reach, .time = 0.1, .weight = 3 * size}};
  };
  for (const float size : {0.25f, 0.5f, 2.0f, 1024.0f}) expectNear(blend(size), blend(1));
  rig().check(blend(0.3f));
}

TEST_F(ClipsSample, TheOrderOfBlendedClipsDoesNotCount) {
  const ClipLayer a{.clip = wave, .time = 0.3, .weight = 0.5f}, b{.clip = reach, .time = 0.6};
  expectNear({a, b}, {b, a});
  expectSame({a, b}, {a, b});
}

TEST_F(ClipsSample, WithoutWeightAllRests) {
  expectSame({}, {{.clip = wave, .time = 0.3, .weight = 0}});
  expectSame({}, {{.clip = wave, .time = 0.3, .mask = nothing}});
  expectSame({}, {{.clip = addReach, .time = 0.3, .weight = 0}});
  expectSame({}, {{.clip = addReach, .time = 0.3, .mask = nothing}});
  expectSame({}, {{.clip = wave, .time = 0.3, .weight = 60'000, .mask = tiny}});
  rig().check(Layers{{.clip = wave, .time = 0.3, .weight = 60'000, .mask = tiny}});
  rig().check(Layers{});
}

TEST_F(ClipsSample, MasksAreFactorsOfWeights) {
  const ClipLayer layer{.clip = wave, .time = 0.3}, other{.clip = reach, .time = 0.2};
  ClipLayer masked = layer;
  masked.mask = everything;
  expectSame({layer, other}, {masked, other});
  for (const std::uint32_t mask : {onlyHand, mixed}) {
    masked.mask = mask;
    rig().check(Layers{masked});
    rig().check(Layers{masked, other});
    rig().check(Layers{other, masked});
    rig().check(Layers{other, {.clip = addReach, .time = 0.7, .weight = 0.8f, .mask = mask}});
  }
  // Alone, a factor is no matter unless it is 0.
  masked.mask = mixed;
  expectNear({masked}, {layer});
}

TEST_F(ClipsSample, DifferencesAreAddedInTheirOrderAfterAllOthers) {
  const ClipLayer base{.clip = reach, .time = 0.3}, other{.clip = wave, .time = 0.2};
  const ClipLayer first{.clip = addReach, .time = 0.7, .weight = 0.8f};
  const ClipLayer second{.clip = addWave, .time = 0.3, .weight = -0.5f};
  expectSame({base, other, first, second}, {first, base, second, other});
  expectSame({base, other, first, second}, {first, second, base, other});
  for (const Layers& layers :
       {Layers{first}, Layers{first, second}, Layers{second, first}, Layers{first, first},
        Layers{base, first, second}, Layers{second, base, other, first}})
    rig().check(layers);
}

// The difference of a pose from another, added to the other.
TEST_F(ClipsSample, ADifferenceLeadsFromItsBaseToItsClip) {
  for (const double time : {0.0, 0.3, 0.77, 1.2}) {
    const Layers sum{{.clip = reach, .time = 0.5}, {.clip = addWave, .time = time}};
    rig().check(sum);
    expectNear(sum, {{.clip = wave, .time = time}}, 100 * rig().report.maxError);
    expectNear({{.clip = addReach, .time = time / 2}}, {{.clip = reach, .time = time / 2}},
               100 * rig().report.maxError);
  }
}

TEST_F(ClipsSample, WrapsAndClamps) {
  const double duration = double{rig().bank->clip(reach).duration};
  for (const double time : {0.0, 0.2, 0.55, 0.79}) {
    const auto at = [](std::uint32_t clip, double seconds, bool hold = false) {
      return Layers{{.clip = clip, .time = seconds, .hold = hold}};
    };
    for (const int turns : {-3, -1, 1, 1000})
      expectNear(at(reach, time + turns * duration), at(reach, time), 1e-3);
    expectSame(at(reach, time, true), at(reach, time));
    expectSame(at(reach, -1 - time, true), at(reach, 0));
    expectSame(at(reach, 1 + time, true), at(reach, duration, true));
    expectSame(at(reachOnce, time, true), at(reachOnce, time));
    expectSame(at(reachOnce, -1 - time), at(reachOnce, 0));
    expectSame(at(reachOnce, 1 + time), at(reachOnce, duration));
    expectNear(at(reachOnce, time), at(reach, time), 100 * rig().report.maxError);
    rig().check(at(reachOnce, 5));
    rig().check(at(reach, time + 7 * duration));
  }
  expectSame({{.clip = reach, .time = duration}}, {{.clip = reach, .time = 0}});
}

// A layer is sampled at the time that `clipTime` gives.
TEST_F(ClipsSample, TheTimeIsClipTime) {
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    const auto clip = below(random, rig().clips.size());
    const bool hold = chance(random, 30);
    const double time = between(random, -1e4, 1e4);
    const float inside = clipTime(rig().bank->clip(clip), time, hold);
    expectSame({{.clip = clip, .time = time, .hold = hold}},
               {{.clip = clip, .time = double{inside}, .hold = true}});
  }
}

// ---- The ends of the range of float32.

/// A joint that a clip turns, and one below it, both at the origin.
gltf::Model originRig() {
  gltf::Model model;
  model.nodes.resize(2);
  model.nodes[1].parent = 0;
  model.nodeOrder = {0, 1};
  model.skins = {{"skin", {0, 1}, std::vector<JointMatrix>(2)}};
  model.clips.push_back({"turn", 1, {}});
  for (const std::uint32_t node : {0u, 1u}) {
    model.clips[0].channels.push_back(
        channel(node, ChannelPath::rotation, {0, 1}, {0, 0, 0, 1, 0, 0, 0.6f, 0.8f}));
  }
  return model;
}

std::vector<std::array<double, 3>> boundsOf(const PackedRig& rig, const ClipLayer& layer) {
  const Result<reference::SampledPose> pose =
      reference::samplePose(rig.skeleton, rig.clips, {}, {&layer, 1}, 0, &*rig.bank);
  EXPECT_TRUE(pose.ok());
  return pose->bounds;
}

// Exporters leave such noise. A GPU may flush denormals to 0.
TEST(ClipsRange, BoundsAllowForDenormals) {
  for (const double noise : {-3.3e-42, 1e-44, 1.1e-38}) {
    PackedRig rig(originRig());
    rig.skeleton.nodes[0].translation = {0, noise, 0};
    rig.skeleton.nodes[1].scale = {noise, 1, 1};
    rig.options.maxError = 1e-4;
    ASSERT_TRUE(rig.pack());
    for (const double time : {0.0, 0.3, 0.77}) {
      rig.check(ClipLayer{.time = time});
      for (const auto& [atJoint, perDistance, shape] : boundsOf(rig, {.time = time})) {
        EXPECT_GE(atJoint, 0x1p-125);
        EXPECT_LE(atJoint, 1e-30);
        EXPECT_LE(perDistance, 1e-3);
        EXPECT_LE(shape, 1e-5) << "a turn is none";
      }
    }
  }
}

TEST(ClipsRange, NoBoundHoldsBeyondTheRange) {
  PackedRig rig(originRig());
  rig.skeleton.nodes[0].scale = rig.skeleton.nodes[1].scale = {1e20, 1e20, 1e20};
  rig.options.maxError = 1e17;
  ASSERT_TRUE(rig.pack());
  std::vector<std::array<double, 3>> bounds = boundsOf(rig, {.time = 0.3});
  for (const double bound : bounds[0]) EXPECT_TRUE(std::isfinite(bound));
  for (const double bound : bounds[1]) EXPECT_TRUE(std::isinf(bound));
  // An additive clip may reach it between its layers.
  rig.skeleton.nodes[1].scale = {1, 1, 1};
  const Floats times{0}, large{1e38f, 0, 0};
  rig.clips[0].additive = true;
  rig.clips[0].channels = {{0, ChannelPath::translation, Interpolation::linear, times, large}};
  ASSERT_TRUE(rig.pack());
  bounds = boundsOf(rig, {.weight = 30});
  for (const double bound : bounds[0]) EXPECT_TRUE(std::isinf(bound));
}

// Inside the range it must be finite, although there is no frame of the joint.
TEST(ClipsRange, AJointWithASingularInverseBindMatrixIsFinite) {
  PackedRig rig(originRig());
  std::vector<JointMatrix> inverseBind(rig.skeleton.skins[0].inverseBind.begin(),
                                       rig.skeleton.skins[0].inverseBind.end());
  inverseBind[1].m[2][2] = 0;
  rig.skeleton.skins[0].inverseBind = inverseBind;
  ASSERT_TRUE(rig.pack());
  const std::vector<std::array<double, 3>> bounds = boundsOf(rig, {.time = 0.3});
  for (const double bound : bounds[0]) EXPECT_TRUE(std::isfinite(bound));
  EXPECT_TRUE(std::isfinite(bounds[1][0]));
  EXPECT_TRUE(std::isinf(bounds[1][1]));
}

TEST(ClipTime, WrapsInDoublePrecision) {
  const ClipInfo wrapping{.duration = 0.75f, .wraps = true};
  const ClipInfo clamping{.duration = 0.75f, .wraps = false};
  for (const double turns : {-1e6, -3.0, -1.0, 0.0, 1.0, 5.0, 1e6, 1e9}) {
    for (const double time : {0.0, 0.125, 0.5, 0.625})
      EXPECT_EQ(double{clipTime(wrapping, time + turns * 0.75)}, time) << turns;
  }
  EXPECT_EQ(clipTime(wrapping, 0.75), 0);
  const std::array<std::pair<ClipInfo, bool>, 3> held{
      {{wrapping, true}, {clamping, false}, {clamping, true}}};
  for (const auto& [info, hold] : held) {
    EXPECT_EQ(clipTime(info, 0.5, hold), 0.5f);
    EXPECT_EQ(clipTime(info, 0.75, hold), 0.75f);
    EXPECT_EQ(clipTime(info, 1e300, hold), 0.75f);
    EXPECT_EQ(clipTime(info, -1e300, hold), 0);
  }
}

TEST(ClipTime, IsInsideTheClip) {
  std::mt19937 random(1);
  for (int i = 0; i < 10'000; ++i) {
    const ClipInfo info{.duration = static_cast<float>(between(random, 0, 3)),
                        .wraps = chance(random, 70)};
    const double size = std::ldexp(1.0, static_cast<int>(below(random, 90)) - 60);
    const double time = between(random, -1, 1) * size;
    const float inside = clipTime(info, time, chance(random, 20));
    EXPECT_GE(inside, 0) << time << " in " << info.duration;
    EXPECT_LE(inside, info.duration) << time;
  }
  for (const bool wraps : {false, true})
    for (const double time : {0.0, 1.0, -1.0, 1e300})
      EXPECT_EQ(clipTime({.duration = 0, .wraps = wraps}, time), 0);
}

}  // namespace
}  // namespace dermis::test
