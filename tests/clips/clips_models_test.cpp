// All models with skins and clips: poses of their banks, and of those of their variants, are as
// near to the clips as the bank says. Every instruction set samples the same bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clip_rig.h"
#include "clip_variants.h"
#include "clips/sample.h"
#include "cpu/clip_plan.h"
#include "dermis/cpu.h"
#include "exhaustive.h"
#include "few_cases.h"
#include "random_number.h"
#include "scene_meshes.h"
#include "test_data.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t maxClipsOfModel = isExhaustive ? 1000 : fewer(3u, 3u);
constexpr std::uint32_t timesPerClip = isExhaustive ? 400 : fewer(12u, 3u);
constexpr std::uint32_t layersPerModel = isExhaustive ? 400 : fewer(12u, 3u);

/// Calls with each model, and its number. At most `maxClipsOfModel` of its clips are kept.
void forEachModel(const std::function<void(gltf::Model, std::uint32_t)>& call) {
  forEachAnimatedModel(maxClipsOfModel, call);
}

/// Times at which much may go wrong: at keys, as near to them as possible, at the ends, and beyond.
std::vector<double> timesOf(const ClipView& clip, std::mt19937& random) {
  std::vector<double> times{0, clip.duration, -0.1, clip.duration + 0.1};
  for (std::uint32_t i = 0; i < timesPerClip; ++i) {
    times.push_back(clip.duration * between(random, -0.5, 1.5));
    if (clip.channels.empty()) continue;
    const ChannelView& channel = clip.channels[below(random, clip.channels.size())];
    const float key = channel.times[below(random, channel.times.size())];
    const float sides[] = {key, std::nextafter(key, -1.0f), std::nextafter(key, HUGE_VALF),
                           key - 1e-4f, key + 1e-4f};
    times.push_back(double{sides[i % std::size(sides)]});
  }
  return times;
}

/// Whether the clips have keys that a bank can hardly have by chance.
bool hasInexactKeys(const PackedRig& rig) {
  return std::ranges::any_of(rig.clips, [](const ClipView& clip) {
    return std::ranges::any_of(clip.channels, [](const ChannelView& channel) {
      return channel.path == ChannelPath::rotation && channel.times.size() > 10 &&
             channel.interpolation == Interpolation::linear;
    });
  });
}

/// Samples with each instruction set.
class CpuPoses {
 public:
  explicit CpuPoses(const PackedClips& bank) : bank_(bank), plan_(bank) { scratch_.prepare(plan_); }
  ~CpuPoses() { must(cpu::setTarget({})); }

  /// Whether the poses are the bits of `samplePose`.
  void check(std::span<const ClipLayer> layers) {
    std::vector<JointMatrix> expected, pose;
    for (std::uint32_t skin = 0; skin < bank_.skinCount(); ++skin) {
      pose.resize(bank_.jointCount(skin));
      must(samplePose(bank_, layers, skin, pose));
      expected.insert(expected.end(), pose.begin(), pose.end());
    }
    const PackedLayers packed = must(packLayers(bank_, layers, ""));
    for (const std::string_view target : cpu::targetNames()) {
      must(cpu::setTarget(target));
      std::vector<JointMatrix> poses(expected.size());
      cpu::dispatchSampling(plan_, packed, scratch_, poses);
      ASSERT_TRUE(areSame(poses, expected)) << target;
    }
  }

 private:
  const PackedClips& bank_;
  cpu::ClipPlan plan_;
  cpu::ClipScratch scratch_;
};

/// The first layer has no weight on one of the nodes, so the second one is the first there. Its
/// rotation and the third one are more than 180 degrees apart, but neither is from the first one.
TEST(CpuPoses, RotationsAreInTheHemisphereOfTheFirstLayerWithWeight) {
  Skeleton skeleton;
  skeleton.nodes = {{.translation = {0, 1, 0}}, {.parent = 0, .translation = {0, 1, 0}}};
  constexpr std::array<std::uint32_t, 2> joints{0, 1};
  const std::array<JointMatrix, 2> inverseBind{};
  skeleton.skins = {{"skin", joints, inverseBind}};
  constexpr std::array<float, 1> times{0};
  constexpr std::array<float, 4> small{0.1f, 0, 0, 1}, left{0, 0, 0.766f, 0.643f},
      right{0, 0, -0.766f, 0.643f};
  std::vector<ClipView> clips;
  for (const std::array<float, 4>* const turn : {&small, &left, &right}) {
    ClipView& clip = clips.emplace_back();
    clip.duration = 1;
    for (std::uint32_t node = 0; node < 2; ++node)
      clip.channels.push_back(
          {.node = node, .path = ChannelPath::rotation, .times = times, .values = *turn});
  }
  constexpr std::array<float, 2> factors{1, 0};
  const std::array<std::span<const float>, 1> masks{factors};
  const PackedClips bank = must(packClips(skeleton, clips, {.masks = masks}));
  const std::array<ClipLayer, 3> layers{ClipLayer{.clip = 0, .mask = 1}, ClipLayer{.clip = 1},
                                        ClipLayer{.clip = 2, .weight = 0.5f}};
  CpuPoses(bank).check(layers);
}

/// Each of the model's clips alone. Returns the largest error divided by its bound.
double checkEachClip(const PackedRig& rig, std::mt19937& random) {
  double worst = 0;
  CpuPoses cpu(*rig.bank);
  for (std::uint32_t clip = 0; clip < rig.model.clips.size(); ++clip) {
    SCOPED_TRACE("clip " + std::to_string(clip));
    for (const double time : timesOf(rig.clips[clip], random)) {
      SCOPED_TRACE("at " + std::to_string(time));
      const bool isInside = time >= 0 && time < rig.clips[clip].duration;
      for (const bool hold : {false, true}) {
        const ClipLayer layer{.clip = clip, .time = time, .hold = hold};
        cpu.check({&layer, 1});
        if ((hold && isInside) || rig.isNearJump(layer)) continue;
        worst = std::max(worst, rig.check(layer));
      }
      if (::testing::Test::HasFailure()) return worst;
    }
  }
  return worst;
}

/// Adds clips that do not wrap, and differences from the rest pose and from the first clip's start.
/// Packs them with masks.
bool packWithLayers(PackedRig& rig, std::mt19937& random) {
  ClipView once = rig.clips[0], fromRest = rig.clips.back(), fromFirst = rig.clips.back();
  once.wraps = false;
  fromRest.additive = fromFirst.additive = true;
  fromFirst.baseClip = 0;
  rig.clips.insert(rig.clips.end(), {once, fromRest, fromFirst});
  for (int mask = 0; mask < 3; ++mask) {
    Floats& factors = rig.masks.emplace_back(rig.skeleton.nodes.size());
    for (float& factor : factors)
      factor = static_cast<float>(chance(random, 30)   ? 0
                                  : chance(random, 30) ? 1
                                                       : between(random, 0, 1));
  }
  return rig.pack();
}

/// Random layers of all of these.
void checkLayers(const PackedRig& rig, std::mt19937& random) {
  CpuPoses cpu(*rig.bank);
  for (std::uint32_t i = 0; i < layersPerModel; ++i) {
    const std::vector<ClipLayer> layers = randomLayers(rig, random);
    std::string text;
    for (const ClipLayer& layer : layers) {
      text += " (clip " + std::to_string(layer.clip) + " at " + std::to_string(layer.time) + " x " +
              std::to_string(layer.weight) + ", mask " + std::to_string(layer.mask) + ")";
    }
    SCOPED_TRACE("layers" + text);
    cpu.check(layers);
    rig.check(layers);
    if (::testing::Test::HasFailure()) return;
  }
}

TEST(ClipsModels, EachClipIsWithinItsBound) {
  double worst = 0;
  std::uint64_t bytes = 0;
  forEachModel([&](gltf::Model model, std::uint32_t) {
    std::mt19937 random(1);
    PackedRig rig(std::move(model));
    if (!rig.pack()) return;
    EXPECT_TRUE(rig.report.worstError > 0 || !hasInexactKeys(rig));
    worst = std::max(worst, checkEachClip(rig, random));
    bytes += rig.report.byteCount;
  });
  std::printf("%llu bytes; the largest error is %.3f of its bound\n",
              static_cast<unsigned long long>(bytes), worst);
  EXPECT_GT(worst, 0);
}

/// How far the columns of a joint matrix are from an orthonormal basis.
double stretchOf(const JointMatrix& joint) {
  double worst = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double product = i == j ? -1 : 0;
      for (const auto& row : joint.m) product += double{row[i]} * double{row[j]};
      worst = std::max(worst, std::abs(product));
    }
  }
  return worst;
}

TEST(ClipsModels, JointsOfSkinsThatAreCalledRigidNeverScale) {
  std::uint32_t rigid = 0, missed = 0, skins = 0;
  forEachModel([&](gltf::Model model, std::uint32_t) {
    std::mt19937 random(3);
    PackedRig rig(std::move(model));
    if (!rig.pack()) return;
    for (std::uint32_t skin = 0; skin < rig.skeleton.skins.size(); ++skin) {
      ++skins;
      double worst = 0;
      for (std::uint32_t i = 0; i < layersPerModel; ++i) {
        for (const JointMatrix& joint : rig.sample(randomLayers(rig, random), skin))
          worst = std::max(worst, stretchOf(joint));
      }
      if (rigidSkins(*rig.bank)[skin]) {
        ++rigid;
        EXPECT_LT(worst, 1e-5) << "skin " << skin;
      } else if (worst < 1e-6) {
        ++missed;
      }
    }
  });
  std::printf("%u of %u skins are called rigid, and %u might be\n", rigid, skins, missed);
  EXPECT_TRUE(missed <= skins / 20 || hasFewCases);
  EXPECT_GT(rigid, 0u);
  EXPECT_TRUE(rigid < skins || !testDataFolder() || hasFewCases);
}

// The skin has one node, which first only turns. Then a clip scales it, too.
TEST(ClipsRigid, ASkinWithAnAnimatedScaleIsNotCalledRigid) {
  const std::array<std::uint32_t, 1> joints{0};
  const std::array<JointMatrix, 1> inverseBind{};
  const Skeleton skeleton{{SkeletonNode{}}, {{"skin", joints, inverseBind}}};
  const std::array times{0.0f, 1.0f};
  const std::array turns{0.0f, 0.0f, 0.0f, 1.0f, 1.0f, 0.0f, 0.0f, 0.0f};
  const std::array scales{1.0f, 1.0f, 1.0f, 1.0f, 2.0f, 1.0f};
  std::vector<ChannelView> channels{
      {0, ChannelPath::rotation, Interpolation::linear, times, turns}};
  for (const bool scalesToo : {false, true}) {
    if (scalesToo)
      channels.push_back({0, ChannelPath::scale, Interpolation::linear, times, scales});
    const std::array clips{ClipView{.name = "clip", .duration = 1, .channels = channels}};
    const Result<PackedClips> bank = packClips(skeleton, clips);
    ASSERT_TRUE(bank.ok()) << bank.error().message;
    EXPECT_EQ(rigidSkins(*bank)[0], !scalesToo);
  }
}

TEST(ClipsModels, LayersAreWithinTheirBounds) {
  forEachModel([](gltf::Model model, std::uint32_t) {
    std::mt19937 random(2);
    PackedRig rig(std::move(model));
    if (packWithLayers(rig, random)) checkLayers(rig, random);
  });
}

/// All variants, or in turn a model gets one of them.
TEST(ClipsVariants, AreWithinTheirBounds) {
  forEachModel([](const gltf::Model& model, std::uint32_t number) {
    for (const ClipVariant variant : clipVariants) {
      const auto of = static_cast<std::uint32_t>(variant);
      const bool isChosen = hasFewCases ? number == of % 2 : number % 12 == of;
      if (!isExhaustive && !isChosen) continue;
      SCOPED_TRACE(clipVariantName(variant));
      std::mt19937 random(number);
      PackedRig rig(withVariant(model, variant, number));
      if (!packWithLayers(rig, random)) continue;
      checkEachClip(rig, random);
      checkLayers(rig, random);
    }
  });
}

}  // namespace
}  // namespace dermis::test
