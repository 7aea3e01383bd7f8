// Morph weights in a bank: those of models and their variants are as near to the clips as the bank
// says, and those of a small rig are what they are by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clip_rig.h"
#include "dermis/verify.h"
#include "random_number.h"
#include "scene_meshes.h"

namespace dermis::test {
namespace {

constexpr int layersPerModel = 60;

enum class Variant { same, step, cubicSpline, irregular };

/// The values of a key of a channel that is no spline.
std::span<const float> keyOf(const gltf::Channel& channel, std::size_t key) {
  return std::span(channel.values).subspan(key * channel.components, channel.components);
}

void change(gltf::Channel& channel, Variant variant, std::mt19937& random) {
  if (channel.interpolation == Interpolation::cubicSpline) return;
  gltf::Channel result = channel;
  result.values.clear();
  if (variant == Variant::irregular) result.times.clear();
  for (std::size_t key = 0; key < channel.times.size(); ++key) {
    const bool isInner = key > 0 && key + 1 < channel.times.size();
    float time = channel.times[key];
    if (variant == Variant::irregular) {
      if (isInner && chance(random, 30)) continue;
      const float room = isInner ? channel.times[key + 1] - time : 0;
      time += static_cast<float>(between(random, 0, 0.4)) * room;
      result.times.push_back(time);
    }
    for (std::size_t part = 0; part < (variant == Variant::cubicSpline ? 3u : 1u); ++part) {
      for (const float value : keyOf(channel, key)) {
        const bool isTangent = variant == Variant::cubicSpline && part != 1;
        result.values.push_back(isTangent ? static_cast<float>(between(random, -1, 1)) : value);
      }
    }
  }
  if (variant == Variant::step) result.interpolation = Interpolation::step;
  if (variant == Variant::cubicSpline) result.interpolation = Interpolation::cubicSpline;
  channel = std::move(result);
}

/// Adds a clip that does not wrap, and differences from the rest and from the first clip.
void addClips(PackedRig& rig) {
  ClipView once = rig.clips[0], fromRest = rig.clips.back(), fromFirst = rig.clips.back();
  once.wraps = false;
  fromRest.additive = fromFirst.additive = true;
  fromFirst.baseClip = 0;
  fromFirst.baseTime = 0.3 * rig.clips[0].duration;
  rig.clips.insert(rig.clips.end(), {once, fromRest, fromFirst});
}

void addMasks(PackedRig& rig, std::mt19937& random) {
  for (int mask = 0; mask < 3; ++mask) {
    Floats& factors = rig.masks.emplace_back(rig.skeleton.nodes.size());
    for (float& factor : factors)
      factor = chance(random, 30) ? 0 : static_cast<float>(between(random, 0, 1));
  }
}

TEST(ClipsWeights, OfModelsAreWithinTheirBounds) {
  double worst = 0;
  for (const Variant variant :
       {Variant::same, Variant::step, Variant::cubicSpline, Variant::irregular}) {
    SCOPED_TRACE("variant " + std::to_string(static_cast<int>(variant)));
    forEachMorphedModel(2, [&](gltf::Model model, std::uint32_t number) {
      std::mt19937 random(number);
      for (gltf::Clip& clip : model.clips) {
        for (gltf::Channel& channel : clip.channels)
          if (channel.path == ChannelPath::weights) change(channel, variant, random);
      }
      PackedRig rig(std::move(model));
      addClips(rig);
      addMasks(rig, random);
      if (!rig.pack()) return;
      for (std::uint32_t clip = 0; clip < rig.clips.size(); ++clip) {
        for (int i = 0; i <= 40; ++i) {
          const ClipLayer layer{.clip = clip, .time = rig.clips[clip].duration * i / 40};
          if (!rig.isNearJump(layer)) worst = std::max(worst, rig.checkWeights({&layer, 1}));
        }
      }
      for (int i = 0; i < layersPerModel; ++i) rig.checkWeights(randomLayers(rig, random));
    });
  }
  std::printf("the largest error is %.3f of its bound\n", worst);
}

/// A rig of which one node has four weights, and the hand two. One clip animates those of the node,
/// and nothing else.
gltf::Model faceRig(Interpolation interpolation = Interpolation::linear) {
  gltf::Model model = armRig();
  model.clips.clear();
  model.meshes.resize(2);
  model.meshes[0].morphTargetCount = 4;
  model.meshes[0].morphWeights = {0, 0, 0, 0.5f};
  model.meshes[1].morphTargetCount = 2;
  model.meshes[1].morphWeights = {0.25f, 0.75f};
  model.nodes[arm::prop].mesh = 0;
  model.nodes[arm::hand].mesh = 1;
  model.nodes[arm::hand].morphWeights = {0.125f, 0};
  gltf::Channel smile = channel(arm::prop, ChannelPath::weights, {0, 1, 2},
                                {0, 1, 0, 0, 1, 0, 0, -1, 0, 1, 0, 2}, interpolation);
  smile.components = 4;
  model.clips.push_back({"smile", 2, {std::move(smile)}});
  return model;
}

Floats sampled(const PackedRig& rig, std::span<const ClipLayer> layers, std::uint32_t node) {
  Floats weights(rig.bank->weightCount(node));
  must(sampleWeights(*rig.bank, layers, node, weights));
  return weights;
}

void expectNear(const Floats& weights, const Floats& expected, double error) {
  ASSERT_EQ(weights.size(), expected.size());
  for (std::size_t i = 0; i < weights.size(); ++i)
    EXPECT_NEAR(weights[i], expected[i], error) << "weight " << i;
}

TEST(ClipsWeights, MoveNoNode) {
  PackedRig rig(faceRig());
  ASSERT_TRUE(rig.pack());
  EXPECT_EQ(rig.bank->nodeCount(), 0u);
  EXPECT_EQ(rig.bank->weightCount(arm::prop), 4u);
  EXPECT_EQ(rig.bank->weightCount(arm::hand), 2u);
  EXPECT_EQ(rig.bank->weightCount(arm::body), 0u);
  EXPECT_EQ(rig.bank->weightCount(arm::nodeCount), 0u);
  EXPECT_GT(rig.bank->error(arm::prop).weight, 0);
  EXPECT_LT(rig.bank->error(arm::prop).weight, 1.01e-3f);
  EXPECT_EQ(rig.bank->error(arm::hand).weight, 0);
  EXPECT_EQ(rig.report.animatedTracks, 2u) << "of three weights, and of one";
}

TEST(ClipsWeights, ByHand) {
  PackedRig rig(faceRig());
  addClips(rig);
  rig.masks = {Floats(arm::nodeCount, 1), Floats(arm::nodeCount, 0)};
  rig.masks[0][arm::prop] = 0.5f;
  ASSERT_TRUE(rig.pack());
  constexpr double error = 2e-3;
  const auto prop = [&](const std::vector<ClipLayer>& layers) {
    return sampled(rig, layers, arm::prop);
  };
  EXPECT_EQ(prop({}), (Floats{0, 0, 0, 0.5f}));
  EXPECT_EQ(prop({{.time = 1, .mask = 2}}), (Floats{0, 0, 0, 0.5f}));
  EXPECT_EQ(sampled(rig, {}, arm::hand), (Floats{0.125f, 0}));
  const ClipLayer inside{.time = 1};
  EXPECT_EQ(sampled(rig, {&inside, 1}, arm::hand), (Floats{0.125f, 0}));
  const ClipLayer added{.clip = 2, .time = 1};
  EXPECT_EQ(sampled(rig, {&added, 1}, arm::hand), (Floats{0.125f, 0}));
  expectNear(prop({{.time = 0.5}}), {0.5f, 0.5f, 0, -0.5f}, error);
  expectNear(prop({{.time = 5.5}}), {0.5f, 0.5f, 0, 0.5f}, error);
  // The clip that does not wrap stays at its end.
  expectNear(prop({{.clip = 1, .time = 5.5}}), {0, 1, 0, 2}, error);
  // (0, 1, 0, 0) and half of (1, 0, 0, -1).
  expectNear(prop({{.time = 0}, {.time = 1, .mask = 1}}), {1 / 3.0f, 2 / 3.0f, 0, -1 / 3.0f},
             error);
  // Minus half of (1, 0, 0, -1) − (0, 0, 0, 0.5).
  expectNear(prop({{.clip = 2, .time = 1, .weight = -1, .mask = 1}}), {-0.5f, 0, 0, 1.25f}, error);
  // The clip at 0 s, plus (1, 0, 0, -1) − the clip at 0.6 s.
  expectNear(prop({{.clip = 3, .time = 1}, {.time = 0}}), {0.4f, 0.6f, 0, -0.4f}, error);
}

TEST(ClipsWeights, StepsAreJumps) {
  PackedRig rig(faceRig(Interpolation::step));
  ASSERT_TRUE(rig.pack());
  ClipLayer layer{.time = 0.98};
  EXPECT_EQ(sampled(rig, {&layer, 1}, arm::prop), (Floats{0, 1, 0, 0}));
  layer.time = 1.02;
  EXPECT_EQ(sampled(rig, {&layer, 1}, arm::prop), (Floats{1, 0, 0, -1}));
}

TEST(ClipsWeights, ALargerErrorTakesFewerBytes) {
  std::uint64_t before = std::numeric_limits<std::uint64_t>::max();
  for (const double error : {1e-5, 1e-3, 0.1}) {
    gltf::Model model = faceRig();
    gltf::Channel& wave = model.clips[0].channels[0];
    wave.times.clear();
    wave.values.clear();
    for (int key = 0; key < 50; ++key) {
      wave.times.push_back(static_cast<float>(key) / 25);
      for (int i = 0; i < 4; ++i) wave.values.push_back(std::sin(0.3f * static_cast<float>(key)));
    }
    PackedRig rig(std::move(model));
    rig.options.maxWeightError = error;
    ASSERT_TRUE(rig.pack());
    EXPECT_LT(rig.report.byteCount, before);
    EXPECT_LT(rig.bank->error(arm::prop).weight, 1.01 * error);
    before = rig.report.byteCount;
    for (int i = 0; i < 100; ++i) {
      const ClipLayer layer{.time = 0.0212 * i};
      rig.checkWeights({&layer, 1});
    }
  }
}

TEST(ClipsWeights, PosesAreWhatTheyAreWithout) {
  gltf::Model with = armRig();
  const gltf::Model face = faceRig();
  with.meshes = face.meshes;
  with.nodes[arm::prop].mesh = 0;
  with.clips[0].channels.push_back(face.clips[0].channels[0]);
  PackedRig rig(armRig()), rigWith(std::move(with));
  ASSERT_TRUE(rig.pack() && rigWith.pack());
  for (const double time : {0.0, 0.3, 0.9, 1.2}) {
    const ClipLayer layer{.time = time};
    EXPECT_TRUE(areSame(rig.sample(layer), rigWith.sample(layer)));
  }
}

TEST(ClipsWeights, RefusesWhatDoesNotFit) {
  PackedRig rig(faceRig());
  ASSERT_TRUE(rig.pack());
  const auto refuses = [&](std::span<const ClipLayer> layers, std::uint32_t node, std::size_t count,
                           const std::string& part) {
    Floats weights(count, 7);
    const Result<void> result = sampleWeights(*rig.bank, layers, node, weights);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(result.error().message.find("sampleWeights: "), std::string::npos);
    EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
    EXPECT_EQ(std::ranges::count(weights, 7.0f), static_cast<std::ptrdiff_t>(count));
  };
  const ClipLayer missing{.clip = 1};
  const std::vector<ClipLayer> many(maxClipLayers + 1);
  refuses({}, arm::prop, 3, "there are 3 weights, but node 4 has 4");
  refuses({}, arm::body, 1, "there are 1 weights, but node 3 has 0");
  refuses({&missing, 1}, arm::prop, 4, "layer 0: there is no clip 1");
  refuses(many, arm::prop, 4, "5 layers");
  EXPECT_TRUE(sampleWeights(*rig.bank, {}, arm::nodeCount, {}).ok());
}

// A GPU may flush denormals to 0.
TEST(ClipsWeights, BoundsAllowForTheEndsOfTheRange) {
  gltf::Model model = faceRig();
  model.clips[0].channels[0].values = {1e-44f, -3.3e-42f, 1e-38f, 0, 1e-44f, -3.3e-42f,
                                       1e-38f, 3e38f,     0,      0, 0,      3e38f};
  PackedRig rig(std::move(model));
  rig.clips.push_back(rig.clips[0]);
  rig.clips[1].additive = true;
  rig.options.maxWeightError = 1e32;
  ASSERT_TRUE(rig.pack());
  for (const std::uint32_t clip : {0u, 1u}) {
    const ClipLayer layer{.clip = clip, .time = 1, .weight = 2};
    const reference::SampledWeights weights = must(
        reference::sampleWeights(rig.skeleton, rig.clips, {}, {&layer, 1}, arm::prop, &*rig.bank));
    for (const std::size_t i : {0u, 1u, 2u}) EXPECT_GE(weights.bounds[i], 0x1p-125);
    EXPECT_TRUE(std::isinf(weights.bounds[3]));
  }
  const reference::SampledWeights rest =
      must(reference::sampleWeights(rig.skeleton, rig.clips, {}, {}, arm::prop, &*rig.bank));
  EXPECT_GE(rest.bounds[0], 0x1p-126);
  EXPECT_LE(rest.bounds[3], 1e-30);
}

// Each copy of the base takes 2 MB or more.
TEST(ClipsWeights, AdditiveClipsDoNotCopyTheirBase) {
  gltf::Model model = faceRig();
  constexpr std::size_t keys = 40'000;
  gltf::Channel& base = model.clips[0].channels[0];
  base.times.clear();
  for (std::size_t key = 0; key < keys; ++key)
    base.times.push_back(2 * static_cast<float>(key) / keys);
  base.values.assign(4 * keys, 0.5f);
  PackedRig rig(std::move(model));
  rig.clips.resize(200, {.name = "added", .duration = 1, .additive = true, .baseClip = 0});
  const std::uint64_t before = peakKilobytes();
  ASSERT_TRUE(rig.pack());
  EXPECT_LT(peakKilobytes() - before, 120'000u);
}

}  // namespace
}  // namespace dermis::test
