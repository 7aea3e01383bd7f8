// Poses of clips against poses computed by hand: which key counts, what is blended, what is added.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <list>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

#include "dermis/clips.h"
#include "dermis/verify.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

using glm::dvec3;

constexpr auto translation = ChannelPath::translation;
constexpr auto rotation = ChannelPath::rotation;
constexpr auto scale = ChannelPath::scale;
constexpr dvec3 xAxis(1, 0, 0), yAxis(0, 1, 0), zAxis(0, 0, 1);

using Floats = std::vector<float>;

/// The quaternion of a rotation about an axis, times `sign`.
Floats turned(const dvec3& axis, double degrees, double sign = 1) {
  const double half = degrees / 360 * std::numbers::pi;
  const dvec3 v = sign * std::sin(half) * axis;
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z),
          static_cast<float>(sign * std::cos(half))};
}

Floats joined(std::initializer_list<Floats> parts) {
  Floats all;
  for (const Floats& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

/// A hip at the origin, and a hand 2 above it. The second skin has the hand only.
class Rig {
 public:
  Rig() {
    skeleton.nodes = {{.name = "hip"}, {.name = "hand", .parent = 0, .translation = {0, 2, 0}}};
    skeleton.skins = {{"both", joints_, inverseBind_},
                      {"hand", std::span(joints_).last(1), std::span(inverseBind_).last(1)}};
  }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  /// Adds a clip of 4 s.
  ClipView& addClip() { return clips.emplace_back(ClipView{.duration = 4, .channels = {}}); }
  void animate(ClipView& clip, std::uint32_t node, ChannelPath path, Floats times, Floats values,
               Interpolation interpolation = Interpolation::linear) {
    const Floats& keptTimes = numbers_.emplace_back(std::move(times));
    const Floats& keptValues = numbers_.emplace_back(std::move(values));
    clip.channels.push_back({node, path, interpolation, keptTimes, keptValues});
  }
  /// Adds a clip that keeps the hand at one value.
  void addHold(ChannelPath path, Floats value) {
    animate(addClip(), 1, path, {0}, std::move(value));
  }
  /// Makes the last clip additive.
  void makeAdditive(std::uint32_t baseClip = 0xffffffffu, double baseTime = 0) {
    clips.back().additive = true;
    clips.back().baseClip = baseClip;
    clips.back().baseTime = baseTime;
  }
  void addMask(Floats factors) { masks.emplace_back(numbers_.emplace_back(std::move(factors))); }

  Result<reference::SampledPose> trySample(const std::vector<ClipLayer>& layers,
                                           std::uint32_t skin = 0) const {
    return reference::samplePose(skeleton, clips, masks, layers, skin);
  }
  /// Where a joint moves a point.
  dvec3 moved(const std::vector<ClipLayer>& layers, const dvec3& point,
              std::size_t joint = 1) const {
    const Result<reference::SampledPose> pose = trySample(layers);
    if (!pose) {
      ADD_FAILURE() << pose.error().message;
      return {};
    }
    EXPECT_TRUE(pose->bounds.empty());
    const Transform& m = pose->joints[joint];
    dvec3 result;
    for (std::size_t row = 0; row < 3; ++row) {
      result[static_cast<glm::length_t>(row)] =
          m[row][0] * point.x + m[row][1] * point.y + m[row][2] * point.z + m[row][3];
    }
    return result;
  }
  /// Where the hand is, relative to where it is at rest.
  dvec3 hand(const std::vector<ClipLayer>& layers) const {
    return moved(layers, {0, 2, 0}) - dvec3(0, 2, 0);
  }
  /// Where the hand moves the point that is `offset` from it, relative to where the hand is.
  dvec3 handTurns(const std::vector<ClipLayer>& layers, const dvec3& offset) const {
    return moved(layers, dvec3(0, 2, 0) + offset) - moved(layers, {0, 2, 0});
  }

  Skeleton skeleton;
  std::vector<ClipView> clips;
  std::vector<std::span<const float>> masks;

 private:
  std::array<std::uint32_t, 2> joints_{0, 1};
  std::array<JointMatrix, 2> inverseBind_{JointMatrix{},
                                          JointMatrix{{{1, 0, 0, 0}, {0, 1, 0, -2}, {0, 0, 1, 0}}}};
  std::list<Floats> numbers_;
};

/// A rig with one clip, in which the hand's x follows the keys.
struct SlidingHand : Rig {
  SlidingHand(Floats times, const Floats& xs, Interpolation interpolation = Interpolation::linear) {
    Floats values;
    for (const float x : xs) values.insert(values.end(), {x, 2, 0});
    animate(addClip(), 1, translation, std::move(times), std::move(values), interpolation);
  }
  double x(double time, bool hold = false) const { return hand({{.time = time, .hold = hold}}).x; }
};

const double lessThanOne = double{std::nextafter(1.0f, 0.0f)};

// ---- One clip.

TEST(ReferenceClips, TwoNodesByHand) {
  Rig rig;
  constexpr std::array<float, 1> weights{0};
  rig.skeleton.nodes[1].weights = weights;
  ClipView& clip = rig.addClip();
  rig.animate(clip, 0, rotation, {0, 1}, joined({turned(zAxis, 0), turned(zAxis, 90)}));
  rig.animate(clip, 1, translation, {0, 1}, {0, 2, 0, 4, 2, 0});
  rig.animate(clip, 1, scale, {0, 1}, {1, 1, 1, 1, 3, 1});
  rig.animate(clip, 1, ChannelPath::weights, {0}, {7});  // not a part of the pose
  // At 0.5 s the hand is at (2, 2, 0) of the hip, which is turned by 45°. It doubles y.
  const double s = std::sqrt(0.5);
  expectNear(rig.moved({{.time = 0.5}}, {0, 1, 0}, 0), {-s, s, 0}, 1e-7);
  expectNear(rig.moved({{.time = 0.5}}, {0, 3, 0}), {(2 - 4) * s, (2 + 4) * s, 0}, 1e-6);
  // The arc of a slerp is even: a third of the time is a third of the angle.
  expectNear(rig.moved({{.time = 1.0f / 3}}, {1, 0, 0}, 0), {std::sqrt(0.75), 0.5, 0}, 1e-7);

  const Result<reference::SampledPose> hand = rig.trySample({{.time = 0.5}}, 1);
  ASSERT_TRUE(hand.ok());
  ASSERT_EQ(hand->joints.size(), 1u);
  EXPECT_EQ(hand->joints[0], rig.trySample({{.time = 0.5}})->joints[1]);
}

TEST(ReferenceClips, SlerpTakesTheShorterArc) {
  Rig rig;
  rig.animate(rig.addClip(), 1, rotation, {0, 1},
              joined({turned(zAxis, 0), turned(zAxis, 90, -1)}));
  expectNear(rig.handTurns({{.time = 0.5}}, xAxis), {std::sqrt(0.5), std::sqrt(0.5), 0}, 1e-7);
}

TEST(ReferenceClips, StepsAtTheKey) {
  const SlidingHand rig({0, 1, 3}, {5, 6, 8}, Interpolation::step);
  EXPECT_EQ(rig.x(0), 5);
  EXPECT_EQ(rig.x(lessThanOne), 5);
  EXPECT_EQ(rig.x(1), 6);
  EXPECT_EQ(rig.x(2.5), 6);
  EXPECT_EQ(rig.x(3.5), 8);
}

TEST(ReferenceClips, CubicSplines) {
  // Keys 2 s apart; the tangent that leaves the first is 1, that which reaches the second -2.
  const SlidingHand rig({1, 3}, {9, 0, 1, -2, 4, 9}, Interpolation::cubicSpline);
  EXPECT_EQ(rig.x(0.5), 0);
  EXPECT_EQ(rig.x(2), 0.5 * 0 + 0.5 * 4 + 2 * 0.125 * 1 - 2 * 0.125 * -2 + 0);
  EXPECT_NEAR(rig.x(1.5), 4 * 0.15625 + 2 * 0.140625 * 1 - 2 * 0.046875 * -2, 1e-12);
  EXPECT_EQ(rig.x(3.5), 4);

  Rig turning;  // (0, 0, 1, 0.5) before it is normalized
  turning.animate(turning.addClip(), 1, rotation, {1, 3},
                  {9, 9, 9, 9, 0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 9, 9, 9, 9},
                  Interpolation::cubicSpline);
  const double angle = 2 * std::atan2(1, 0.5);
  expectNear(turning.handTurns({{.time = 2}}, xAxis), {std::cos(angle), std::sin(angle), 0}, 1e-14);
}

TEST(ReferenceClips, OfEqualTimesTheLastCounts) {
  for (const Interpolation interpolation : {Interpolation::linear, Interpolation::step}) {
    const SlidingHand rig({0, 1, 1, 1, 2}, {0, 1, 30, 5, 6}, interpolation);
    const bool linear = interpolation == Interpolation::linear;
    EXPECT_EQ(rig.x(0.5), linear ? 0.5 : 0);
    EXPECT_NEAR(rig.x(lessThanOne), linear ? 1 : 0, 1e-6);
    EXPECT_EQ(rig.x(1), 5);
    EXPECT_EQ(rig.x(1.5), linear ? 5.5 : 5);
  }
  const SlidingHand ends({1, 1, 2, 2}, {3, 4, 5, 6});
  EXPECT_EQ(ends.x(0.5), 3);
  EXPECT_EQ(ends.x(1), 4);
  EXPECT_EQ(ends.x(2), 6);
}

TEST(ReferenceClips, TimesWrapOrAreClamped) {
  SlidingHand rig({0, 4}, {0, 4});  // x is the time in the clip
  EXPECT_EQ(rig.x(0), 0);
  EXPECT_EQ(rig.x(4), 0);
  EXPECT_EQ(rig.x(5.5), 1.5);
  EXPECT_EQ(rig.x(-0.5), 3.5);
  EXPECT_EQ(rig.x(-8), 0);
  EXPECT_EQ(rig.x(-1e-12), 4);  // rounded to float32
  EXPECT_EQ(rig.x(4e9 + 1.5), 1.5);
  EXPECT_EQ(rig.x(5.5, true), 4);
  EXPECT_EQ(rig.x(-0.5, true), 0);
  EXPECT_EQ(rig.x(4, true), 4);
  rig.clips[0].wraps = false;
  EXPECT_EQ(rig.x(5.5), 4);
  EXPECT_EQ(rig.x(-0.5), 0);
  rig.clips[0].duration = 0;
  rig.clips[0].wraps = true;
  EXPECT_EQ(rig.x(3), 0);
}

TEST(ReferenceClips, TimesAndDurationsAreFloats) {
  SlidingHand rig({0, 0.1f, 1}, {0, 7, 8}, Interpolation::step);
  EXPECT_EQ(rig.x(0.1), 7);  // the double is less than the key
  EXPECT_EQ(rig.x(1 - 0x1p-40), 8);
  rig.clips[0].duration = 0.1;
  EXPECT_EQ(rig.x(9, true), 7);
}

// ---- Several clips.

TEST(ReferenceClips, WeightsAreRoundedToFloat16) {
  Rig rig;
  rig.addHold(translation, {0, 2, 0});
  rig.addHold(translation, {1, 2, 0});
  const auto share = [&rig](float first, float second) {
    return rig.hand({{.clip = 0, .weight = first}, {.clip = 1, .weight = second}}).x;
  };
  const double tenth = 0.0999755859375, three = 0.300048828125;
  EXPECT_EQ(share(0.1f, 0.3f), three / (tenth + three));
  EXPECT_EQ(share(1, 1 + 0x1p-11f), 0.5);  // halfway: the even one
  EXPECT_EQ(share(1, 1 + 0x3p-11f), (1 + 0x1p-9) / (2 + 0x1p-9));
  EXPECT_EQ(share(0x1p-24f, 0x3p-25f), 2.0 / 3);  // subnormal
  EXPECT_EQ(share(0x1p-24f, 0x1p-25f), 0);
  EXPECT_EQ(share(65504, 65519), 0.5);
}

TEST(ReferenceClips, BlendsTranslationsRotationsAndScales) {
  Rig rig;
  ClipView& clip = rig.addClip();
  rig.animate(clip, 1, translation, {0}, {3, 2, 0});
  rig.animate(clip, 1, scale, {0}, {1, 5, 1});
  rig.addHold(rotation, turned(zAxis, 90));  // has the rest's translation and scale
  const std::vector<ClipLayer> layers{{.clip = 0, .weight = 2}, {.clip = 1, .weight = 1}};
  expectNear(rig.hand(layers), {2, 0, 0}, 1e-15);
  // 2 (0, 0, 0, 1) + (0, 0, s, s)
  const double s = std::sqrt(0.5), angle = 2 * std::atan2(s, 2 + s), y = (2 * 5 + 1) / 3.0;
  expectNear(rig.handTurns(layers, yAxis), {-y * std::sin(angle), y * std::cos(angle), 0}, 1e-14);
}

TEST(ReferenceClips, RotationsJoinTheHemisphereOfTheFirst) {
  Rig rig;
  for (const double degrees : {0.0, 170.0, 300.0}) rig.addHold(rotation, turned(zAxis, degrees));
  // The third is turned over because of the first, although it is near the second.
  const auto half = [](double degrees) { return degrees / 180 * std::numbers::pi; };
  const double angle = 2 * std::atan2(std::sin(half(85)) - std::sin(half(30)),
                                      1 + std::cos(half(85)) + std::cos(half(30)));
  expectNear(rig.handTurns({{.clip = 0}, {.clip = 1}, {.clip = 2}}, xAxis),
             {std::cos(angle), std::sin(angle), 0}, 1e-6);
  // A first layer that does not count has no hemisphere.
  const double between = half(235);
  rig.addMask({1, 0});
  for (const ClipLayer& none : {ClipLayer{.clip = 0, .weight = 0}, ClipLayer{.mask = 1}}) {
    expectNear(rig.handTurns({none, {.clip = 1}, {.clip = 2}}, xAxis),
               {std::cos(between), std::sin(between), 0}, 1e-6);
  }
  rig.addHold(rotation, turned(zAxis, 90, -1));
  expectNear(rig.handTurns({{.clip = 0}, {.clip = 3}}, xAxis), {std::sqrt(0.5), std::sqrt(0.5), 0},
             1e-7);
}

TEST(ReferenceClips, MasksScaleTheWeightsOfNodes) {
  Rig rig;
  rig.addHold(translation, {0, 2, 0});
  ClipView& clip = rig.addClip();
  rig.animate(clip, 0, translation, {0}, {0, 0, 8});
  rig.animate(clip, 1, translation, {0}, {5, 2, 0});
  rig.addMask({0, 0.5f});
  rig.addMask({1, 0.25f});
  expectNear(rig.hand({{.clip = 0}, {.clip = 1, .mask = 2}}), {1, 0, 4}, 1e-15);
  // The sum of the hip is 0.
  expectNear(rig.hand({{.clip = 1, .weight = 0.1f, .mask = 1}}), {5, 0, 0}, 1e-15);
}

TEST(ReferenceClips, NodesRestWithoutWeights) {
  Rig rig;
  rig.skeleton.nodes[1].rotation = {0, 0, 3, 3};  // 90°, and not a unit quaternion
  rig.skeleton.nodes[1].scale = {2, 1, 1};
  rig.addHold(translation, {5, 5, 5});
  for (const std::vector<ClipLayer>& layers :
       {std::vector<ClipLayer>{}, {{.weight = 0}}, {{.weight = -0.0f}, {.weight = 0x1p-26f}}}) {
    expectNear(rig.hand(layers), {0, 0, 0}, 1e-15);
    expectNear(rig.handTurns(layers, xAxis), {0, 2, 0}, 1e-15);
  }
}

// ---- Clips that are added.

TEST(ReferenceClips, AddsDifferencesFromTheRest) {
  Rig rig;
  rig.skeleton.nodes[1].scale = {2, 2, 2};
  rig.addHold(translation, {1, 2, 0});
  ClipView& clip = rig.addClip();
  rig.animate(clip, 1, translation, {0}, {0, 2, 3});
  rig.animate(clip, 1, rotation, {0}, turned(zAxis, 90, -1));
  rig.animate(clip, 1, scale, {0}, {3, 2, 2});
  rig.makeAdditive();
  const auto layers = [](float weight) {
    return std::vector<ClipLayer>{{.clip = 1, .weight = weight}, {.clip = 0, .weight = 0.5f}};
  };
  // The weight of the other clip has no effect on it, nor has the order.
  expectNear(rig.hand(layers(0.25f)), {1, 0, 0.75}, 1e-15);
  expectNear(rig.hand(layers(-1)), {1, 0, -3}, 1e-15);
  // Of 90°, along the chord. The rest's scale times 1 + 0.25 (1.5 - 1).
  const double s = std::sqrt(0.5), angle = 2 * std::atan2(0.25 * s, 0.75 + 0.25 * s);
  expectNear(rig.handTurns(layers(0.25f), xAxis),
             {2.25 * std::cos(angle), 2.25 * std::sin(angle), 0}, 1e-14);
  rig.addMask({1, 0});
  expectNear(rig.hand({{.clip = 0}, {.clip = 1, .mask = 1}}), {1, 0, 0}, 1e-15);
  // Alone, it is added to the rest.
  expectNear(rig.hand({{.clip = 1}}), {0, 0, 3}, 1e-15);
}

TEST(ReferenceClips, AddsDifferencesFromAClip) {
  Rig rig;
  rig.addHold(rotation, turned(zAxis, 90));  // what it is added to
  ClipView& base = rig.addClip();
  rig.animate(base, 1, translation, {0, 2}, {0, 2, 0, 4, 2, 0});
  rig.animate(base, 1, rotation, {0, 2}, joined({turned(xAxis, 0), turned(xAxis, 90)}));
  rig.animate(base, 1, scale, {2}, {2, 0, 4});
  rig.animate(base, 0, translation, {0}, {0, 7, 0});
  ClipView& clip = rig.addClip();
  rig.animate(clip, 1, translation, {0}, {5, 2, 0});
  rig.animate(clip, 1, rotation, {0}, turned(yAxis, 90));
  rig.animate(clip, 1, scale, {0}, {3, 3, 3});
  const std::vector<ClipLayer> layers{{.clip = 0}, {.clip = 2}};
  rig.makeAdditive(1, 2);
  const auto right = [](const dvec3& axis) { return rotationAbout(axis, pi / 2); };
  const glm::dmat3 all = right(zAxis) * glm::transpose(right(xAxis)) * right(yAxis);
  // A scale of 0 in the base gives no ratio.
  expectNear(rig.handTurns(layers, {1, 1, 1}), all * dvec3(1.5, 1, 0.75), 1e-6);
  // The hip has no channel in the clip: it rests there, 7 below the base.
  expectNear(rig.hand(layers), {1, -7, 0}, 1e-15);

  rig.makeAdditive(1, 1);
  expectNear(rig.hand(layers), {3, -7, 0}, 1e-15);
  rig.makeAdditive(1, 99);  // the base's time is clamped, although the base wraps
  rig.clips[1].duration = 2;
  expectNear(rig.hand(layers), {1, -7, 0}, 1e-15);
}

TEST(ReferenceClips, AddsInTheOrderOfLayers) {
  Rig rig;
  for (const dvec3& axis : {xAxis, yAxis}) {
    rig.addHold(rotation, turned(axis, 90));
    rig.makeAdditive();
  }
  const glm::dmat3 x = rotationAbout(xAxis, pi / 2), y = rotationAbout(yAxis, pi / 2);
  expectNear(rig.handTurns({{.clip = 0}, {.clip = 1}}, {1, 2, 3}), x * y * dvec3(1, 2, 3), 1e-6);
  expectNear(rig.handTurns({{.clip = 1}, {.clip = 0}}, {1, 2, 3}), y * x * dvec3(1, 2, 3), 1e-6);
}

// ---- Morph weights.

TEST(ReferenceClips, WeightsByHand) {
  Rig rig;
  constexpr std::array<float, 2> rest{0.25f, 0.5f};
  rig.skeleton.nodes[1].weights = rest;
  constexpr auto weights = ChannelPath::weights;
  rig.animate(rig.addClip(), 1, weights, {0, 2}, {0, 1, 1, 3});
  rig.animate(rig.addClip(), 1, weights, {0, 2}, {0, 1, 1, 3}, Interpolation::step);
  // The tangents that leave the first key are (1, 0), those that reach the second (0, -2).
  rig.animate(rig.addClip(), 1, weights, {0, 2}, {9, 9, 0, 1, 1, 0, 0, -2, 1, 3, 9, 9},
              Interpolation::cubicSpline);
  rig.addClip();
  rig.animate(rig.addClip(), 1, weights, {0}, {1, 0});
  rig.makeAdditive();
  rig.animate(rig.addClip(), 1, weights, {0}, {1, 0});
  rig.makeAdditive(0, 2);
  rig.addMask({1, 0.5f});
  rig.addMask({1, 0});
  const auto sampled = [&rig](const std::vector<ClipLayer>& layers, std::uint32_t node = 1) {
    const Result<reference::SampledWeights> result =
        reference::sampleWeights(rig.skeleton, rig.clips, rig.masks, layers, node);
    EXPECT_TRUE(result.ok());
    EXPECT_TRUE(result->bounds.empty());
    return result->weights;
  };
  using Weights = std::vector<double>;
  EXPECT_EQ(sampled({{.clip = 0, .time = 0.5}}), (Weights{0.25, 1.5}));
  EXPECT_EQ(sampled({{.clip = 1, .time = 0.5}}), (Weights{0, 1}));
  EXPECT_EQ(sampled({{.clip = 2, .time = 1}}), (Weights{0.5 + 2 * 0.125, 2 + 2 * 0.25}));
  for (const std::vector<ClipLayer>& none :
       {std::vector<ClipLayer>{}, {{.clip = 3}}, {{.weight = 0}}, {{.mask = 2}}})
    EXPECT_EQ(sampled(none), (Weights{0.25, 0.5}));
  EXPECT_EQ(sampled({{.clip = 0, .time = 2}, {.clip = 1, .weight = 2, .mask = 1}}),
            (Weights{0.5, 2}));
  EXPECT_EQ(sampled({{.clip = 4, .weight = -0.5f}}), (Weights{0.25 - 0.375, 0.5 + 0.25}));
  EXPECT_EQ(sampled({{.clip = 0, .time = 2}, {.clip = 5, .weight = 2, .mask = 1}}),
            (Weights{1, 3 - 3}));
  EXPECT_TRUE(sampled({{.clip = 0}}, 0).empty());
  EXPECT_TRUE(sampled({{.clip = 0}}, 2).empty());
}

// ---- Skeletons.

TEST(ReferenceClips, ParentsAreInAnyOrderAndMayHaveMatrices) {
  Rig rig;
  rig.skeleton.nodes = {{.name = "middle",
                         .parent = 2,
                         .matrix = Transform{{{1, 2, 0, 1},  // shears
                                              {0, 1, 0, 0},
                                              {0, 0, 3, 0}}}},
                        {.name = "hand", .parent = 0, .translation = {0, 2, 0}},
                        {.name = "root", .rotation = {0, 0, 1, 1}}};
  rig.addHold(translation, {0, 4, 1});
  // The hand has (0, 4, 1), the middle makes (9, 4, 3) of it, the root turns it by 90°.
  expectNear(rig.moved({{}}, {0, 2, 0}), {-4, 9, 3}, 1e-14);
}

// It would take long to seek the channels of each node among those of all.
TEST(ReferenceClips, ManyNodesWithChannels) {
  Rig rig;
  rig.addHold(translation, {0, 4, 1});
  rig.skeleton.nodes.resize(100'000);
  ClipView& clip = rig.clips[0];
  const ChannelView hold = clip.channels[0];
  clip.channels.clear();
  for (std::uint32_t node = 1; node < rig.skeleton.nodes.size(); ++node) {
    clip.channels.push_back(hold);
    clip.channels.back().node = node;
  }
  std::ranges::reverse(clip.channels);
  expectNear(rig.hand({{}}), {0, 2, 1}, 1e-15);
}

// ---- What is refused.

void expectRefused(const Result<reference::SampledPose>& pose, const std::string& words) {
  ASSERT_FALSE(pose.ok()) << words;
  EXPECT_EQ(pose.error().code, ErrorCode::invalidArgument);
  EXPECT_NE(pose.error().message.find(words), std::string::npos) << pose.error().message;
}

TEST(ReferenceClips, RefusesLayers) {
  Rig rig;
  rig.addHold(translation, {0, 2, 0});
  rig.addMask({1, 1});
  const auto refuses = [&rig](const ClipLayer& layer, const std::string& words) {
    expectRefused(rig.trySample({{}, layer}), "layer 1: " + words);
  };
  const float infinite = std::numeric_limits<float>::infinity();
  refuses({.clip = 1}, "clip 1 does not exist");
  refuses({.mask = 2}, "mask 2 does not exist");
  refuses({.time = std::nan("")}, "the time is not finite");
  refuses({.weight = infinite}, "the weight is not finite");
  refuses({.weight = std::nanf("")}, "the weight is not finite");
  refuses({.weight = 65520}, "the weight is too large");
  refuses({.weight = -0.5f}, "the weight is negative");
  rig.makeAdditive();
  EXPECT_TRUE(rig.trySample({{.weight = -0.5f, .mask = 1}}).ok());
  refuses({.weight = -65520}, "the weight is too large");
  EXPECT_TRUE(rig.trySample(std::vector<ClipLayer>(4)).ok());
  expectRefused(rig.trySample(std::vector<ClipLayer>(5)), "5 layers");
  expectRefused(rig.trySample({}, 2), "skin 2 does not exist");
}

TEST(ReferenceClips, RefusesWhatDoesNotFit) {
  const auto refuses = [](auto change, const std::string& words) {
    Rig rig;
    rig.animate(rig.addClip(), 1, rotation, {0, 1}, Floats(24, 1), Interpolation::cubicSpline);
    rig.addMask({1, 1});
    ASSERT_TRUE(rig.trySample({{}}).ok());
    change(rig);
    expectRefused(rig.trySample({{}}), words);
  };
  static constexpr std::array<std::uint32_t, 2> beyond{0, 2};
  refuses([](Rig& rig) { rig.skeleton.skins[0].joints = beyond; }, "joint 2 is not a node");
  refuses([](Rig& rig) { rig.skeleton.skins[0].inverseBind = {}; }, "one inverse bind matrix");
  refuses([](Rig& rig) { rig.masks[0] = rig.masks[0].first(1); }, "one factor per node");
  refuses([](Rig& rig) { rig.skeleton.nodes[0].parent = 1; }, "a cycle");
  refuses([](Rig& rig) { rig.skeleton.nodes[0].parent = 0; }, "a cycle");
  const auto refusesChannel = [&refuses](auto change) {
    refuses([change](Rig& rig) { change(rig.clips[0].channels[0]); }, "clip 0: channel 0");
  };
  refusesChannel([](ChannelView& channel) { channel.node = 2; });
  refusesChannel([](ChannelView& channel) { channel.times = channel.values = {}; });
  refusesChannel([](ChannelView& channel) { channel.times = channel.times.first(1); });
  refusesChannel([](ChannelView& channel) { channel.path = translation; });
  refusesChannel([](ChannelView& channel) { channel.path = ChannelPath::weights; });
  refusesChannel([](ChannelView& channel) { channel.interpolation = Interpolation::linear; });
}

}  // namespace
}  // namespace dermis::test
