// Root motion: what is taken out of clips and what remains are together what the clips were, and
// both are what the reference says.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "clip_rig.h"
#include "dermis/verify.h"
#include "few_cases.h"
#include "matrix_of.h"
#include "random_number.h"
#include "scene_meshes.h"

namespace dermis::test {
namespace {

using glm::dmat4;
using glm::dquat;
using glm::dvec3;
using glm::dvec4;

constexpr double pi = std::numbers::pi;

dmat4 matrixOf(const RootMotion& motion, std::uint32_t upAxis) {
  dvec3 axis(0);
  axis[static_cast<int>(upAxis)] = 1;
  dmat4 matrix(glm::mat3_cast(glm::angleAxis(motion.turn, axis)));
  const auto& [x, y, z] = motion.displacement;
  matrix[3] = {x, y, z, 1};
  return matrix;
}

void expectNear(const RootMotion& motion, const dvec3& displacement, double turn, double error) {
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(motion.displacement[static_cast<std::size_t>(i)], displacement[i], error) << i;
  EXPECT_NEAR(motion.turn, turn, error);
}

RootMotion motionOf(const PackedRig& rig, std::uint32_t clip, double from, double to,
                    bool hold = false) {
  return must(rootMotion(*rig.bank, clip, from, to, hold));
}

bool isCarried(const PackedRig& rig, std::uint32_t node) {
  for (; node < rig.skeleton.nodes.size(); node = rig.skeleton.nodes[node].parent)
    if (node == rig.options.rootMotion->node) return true;
  return false;
}

/// Checks at a time that motion and pose are together the pose of the clip, and that the motion is
/// that of the reference.
void checkMotion(const PackedRig& rig, const ClipLayer& layer) {
  const RootMotionOptions& options = *rig.options.rootMotion;
  const ClipInfo info = rig.bank->clip(layer.clip);
  const double loops = info.wraps && !layer.hold && info.duration > 0
                           ? std::floor(layer.time / double{info.duration})
                           : 0;
  const double start = loops * double{info.duration};
  const dmat4 motion =
      matrixOf(motionOf(rig, layer.clip, start, layer.time, layer.hold), options.upAxis);
  const std::vector<JointMatrix> pose = rig.sample(layer);
  const std::vector<Transform> source =
      must(reference::samplePose(rig.skeleton, rig.clips, {}, {&layer, 1}, 0)).joints;
  const SkeletonSkin& skin = rig.skeleton.skins[0];
  for (std::size_t joint = 0; joint < pose.size(); ++joint) {
    if (!isCarried(rig, skin.joints[joint])) continue;
    const dmat4 bind = test::matrixOf(skin.inverseBind[joint].m);
    if (std::abs(glm::determinant(bind)) < 1e-12) continue;
    const dvec4 origin = glm::inverse(bind) * dvec4(0, 0, 0, 1);
    const dvec3 off((motion * test::matrixOf(pose[joint].m) - test::matrixOf(source[joint])) *
                    origin);
    EXPECT_LE(glm::length(off), 1.1 * rig.report.maxError + 1e-6 * rig.extent())
        << "joint " << joint;
  }
  for (const double from : {0.0, layer.time - 2.3 * double{info.duration}}) {
    const auto expected = must(reference::rootMotion(rig.skeleton, rig.clips, options, layer.clip,
                                                     from, layer.time, layer.hold, &*rig.bank));
    const RootMotion found = motionOf(rig, layer.clip, from, layer.time, layer.hold);
    expectNear({.displacement = found.displacement, .turn = 0},
               {expected.motion.displacement[0], expected.motion.displacement[1],
                expected.motion.displacement[2]},
               0, expected.displacementBound);
    EXPECT_LE(std::abs(std::remainder(found.turn - expected.motion.turn, 2 * pi)),
              expected.turnBound);
  }
}

void checkClips(const PackedRig& rig, std::mt19937& random, int times = fewer(40, 4)) {
  for (std::uint32_t clip = 0; clip < rig.clips.size(); ++clip) {
    SCOPED_TRACE("clip " + std::to_string(clip));
    for (int i = 0; i < times; ++i) {
      const ClipLayer layer{.clip = clip,
                            .time = rig.clips[clip].duration * between(random, -2, 3),
                            .hold = i % 8 == 0};
      SCOPED_TRACE("at " + std::to_string(layer.time));
      ClipLayer earlier = layer;
      earlier.time -= 2.3 * double{rig.bank->clip(clip).duration};
      if (rig.isNearJump(layer) || rig.isNearJump(earlier)) continue;
      if (!rig.clips[clip].additive) checkMotion(rig, layer);
      rig.check(layer);
    }
    if (::testing::Test::HasFailure()) return;
  }
}

/// A figure in centimeters with z up, as a file has it; its hip walks, turns, bobs and leans. The
/// clip does not begin at the origin.
gltf::Model walker(Interpolation interpolation = Interpolation::linear) {
  gltf::Model model;
  model.nodes.resize(4);
  model.nodes[0].name = "armature";
  model.nodes[0].rotation = {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
  model.nodes[0].scale = {0.01, 0.01, 0.01};
  model.nodes[0].translation = {0.3, 0, 0.1};
  model.nodes[1].name = "hip";
  model.nodes[1].parent = 0;
  model.nodes[1].translation = {0, 0, 100};
  model.nodes[2].name = "leg";
  model.nodes[2].parent = 1;
  model.nodes[2].translation = {10, 0, -90};
  model.nodes[3].name = "target";
  model.nodeOrder = {0, 3, 1, 2};
  model.skins = {{"figure", {1, 2, 3, 0}, std::vector<JointMatrix>(4)}};
  for (JointMatrix& matrix : model.skins[0].inverseBindMatrices)
    for (std::size_t i = 0; i < 3; ++i) matrix.m[i][i] = 100;
  Floats times, places, turns, kicks;
  const bool isSpline = interpolation == Interpolation::cubicSpline;
  for (int key = 0; key <= 30; ++key) {
    const double t = key / 20.0;
    times.push_back(static_cast<float>(t));
    const dvec3 place(20 + 80 * t, 30 - 25 * t * t, 100 + 4 * std::sin(8 * t));
    const dvec3 speed(80, -50 * t, 32 * std::cos(8 * t));
    const dquat turn = glm::angleAxis(0.4 + 3 * t, dvec3(0, 0, 1)) *
                       glm::angleAxis(0.2 * std::sin(5 * t), glm::normalize(dvec3(1, 0.4, 0)));
    if (isSpline)
      for (int i = 0; i < 3; ++i) places.push_back(static_cast<float>(speed[i]));
    for (int i = 0; i < 3; ++i) places.push_back(static_cast<float>(place[i]));
    if (isSpline)
      for (int i = 0; i < 3; ++i) places.push_back(static_cast<float>(speed[i]));
    for (const double x : {turn.x, turn.y, turn.z, turn.w}) turns.push_back(static_cast<float>(x));
    const dquat kick = glm::angleAxis(0.5 * std::sin(8 * t), dvec3(1, 0, 0));
    for (const double x : {kick.x, kick.y, kick.z, kick.w}) kicks.push_back(static_cast<float>(x));
  }
  model.clips.push_back({"walk",
                         1.5,
                         {channel(1, ChannelPath::translation, times, places, interpolation),
                          channel(1, ChannelPath::rotation, times, turns,
                                  isSpline ? Interpolation::linear : interpolation),
                          channel(2, ChannelPath::rotation, times, kicks)}});
  return model;
}

TEST(ClipsRootMotion, MotionAndPoseAreTheClip) {
  for (const Interpolation interpolation :
       {Interpolation::linear, Interpolation::cubicSpline, Interpolation::step}) {
    SCOPED_TRACE(static_cast<int>(interpolation));
    std::mt19937 random(1);
    PackedRig rig(walker(interpolation));
    ClipView once = rig.clips[0], lean = rig.clips[0];
    once.wraps = false;
    lean.additive = true;
    lean.baseClip = 0;
    lean.baseTime = 0.5;
    rig.clips.insert(rig.clips.end(), {once, lean});
    rig.options.rootMotion = {.node = 1, .upAxis = 1};
    ASSERT_TRUE(rig.pack());
    EXPECT_TRUE(rig.bank->hasRootMotion());
    EXPECT_GT(rig.bank->rootMotionError().translation, 0);
    checkClips(rig, random, fewer(200, 4));
  }
}

TEST(ClipsRootMotion, ThePackedClipStaysInPlace) {
  PackedRig rig(walker());
  rig.options.rootMotion = {.node = 1, .upAxis = 1};
  rig.options.maxError = 1e-4;
  ASSERT_TRUE(rig.pack());
  double lowest = 10, highest = 0;
  for (int i = 0; i <= 100; ++i) {
    const JointMatrix hip = rig.sample(ClipLayer{.time = 0.015 * i - 1e-9, .hold = true})[0];
    // 20 cm along x and 30 cm along y of the armature, which is −z.
    EXPECT_NEAR(hip.m[0][3], 0.3 + 0.2, 3e-4);
    EXPECT_NEAR(hip.m[2][3], 0.1 - 0.3, 3e-4);
    lowest = std::min(lowest, double{hip.m[1][3]});
    highest = std::max(highest, double{hip.m[1][3]});
  }
  EXPECT_NEAR(lowest, 0.96, 1e-3);
  EXPECT_NEAR(highest, 1.04, 1e-3);
  // In 1 s it goes 80 cm along x and 25 cm along +z, seen from where it stood.
  const RootMotion motion = motionOf(rig, 0, 0, 1);
  EXPECT_NEAR(motion.turn, 3, 0.05) << "leaning turns a little";
  const dvec4 moved = matrixOf(motion, 1) * dvec4(0.5, 0, -0.2, 1);
  EXPECT_NEAR(moved.x, 0.5 + 0.8, 1e-3);
  EXPECT_NEAR(moved.z, -0.2 + 0.25, 1e-3);
}

/// A node that goes around in a circle of radius 1, twice in 4 s, and faces its way. Seen from
/// above, with the up axis toward the eye, it turns to the left.
gltf::Model circler(std::uint32_t upAxis) {
  gltf::Model model;
  model.nodes.resize(1);
  model.skins = {{"one", {0}, {JointMatrix{}}}};
  const std::size_t first = (upAxis + 1) % 3, second = (upAxis + 2) % 3;
  Floats times, places, turns;
  for (int key = 0; key <= 64; ++key) {
    const double angle = 4 * pi * key / 64;
    times.push_back(static_cast<float>(key) / 16);
    std::array<double, 3> place{};
    place[first] = std::cos(angle);
    place[second] = std::sin(angle);
    std::array<double, 4> turn{0, 0, 0, std::cos(angle / 2)};
    turn[upAxis] = std::sin(angle / 2);
    for (const double x : place) places.push_back(static_cast<float>(x));
    for (const double x : turn) turns.push_back(static_cast<float>(x));
  }
  model.clips.push_back({"circle",
                         4,
                         {channel(0, ChannelPath::translation, times, places),
                          channel(0, ChannelPath::rotation, times, turns)}});
  return model;
}

TEST(ClipsRootMotion, WholeTurnsAreCounted) {
  for (const std::uint32_t up : {0u, 1u, 2u}) {
    PackedRig rig(circler(up));
    rig.options.rootMotion = {.node = 0, .upAxis = up};
    ASSERT_TRUE(rig.pack());
    // It turns about the origin, where its figure stands: nothing is displaced.
    expectNear(motionOf(rig, 0, 0, 1), {}, pi, 1e-2);
    expectNear(motionOf(rig, 0, 0, 4), {}, 4 * pi, 1e-3);
    expectNear(motionOf(rig, 0, 3.5, 0.5), {}, -3 * pi, 1e-2);
    expectNear(motionOf(rig, 0, 0, 40), {}, 40 * pi, 1e-2);
    expectNear(motionOf(rig, 0, 1, -7), {}, -8 * pi, 1e-2);
  }
}

TEST(ClipsRootMotion, LoopsHaveNoSeam) {
  PackedRig rig(walker());
  rig.options.rootMotion = {.node = 1, .upAxis = 1};
  ASSERT_TRUE(rig.pack());
  dmat4 stepped(1.0);
  double turn = 0;
  constexpr double step = 0.0625;
  for (int i = 0; i < 100; ++i) {
    const RootMotion motion = motionOf(rig, 0, step * i, step * (i + 1));
    EXPECT_LT(std::hypot(motion.displacement[0], motion.displacement[2]), 3.5 * step);
    EXPECT_LT(std::abs(motion.turn), 5 * step);
    stepped = stepped * matrixOf(motion, 1);
    turn += motion.turn;
  }
  const RootMotion whole = motionOf(rig, 0, 0, 100 * step);
  EXPECT_NEAR(turn, whole.turn, 1e-9);
  const dmat4 off = stepped - matrixOf(whole, 1);
  const dmat4 back = matrixOf(whole, 1) * matrixOf(motionOf(rig, 0, 100 * step, 0), 1) - dmat4(1.0);
  for (int column = 0; column < 4; ++column) {
    EXPECT_LT(glm::length(off[column]), 1e-9);
    EXPECT_LT(glm::length(back[column]), 1e-9);
  }
  expectNear(motionOf(rig, 0, 7.7, 7.7), {}, 0, 1e-12);
  // Far away it is as near to itself as doubles allow.
  const RootMotion here = motionOf(rig, 0, 0.25, 0.75),
                   far = motionOf(rig, 0, 3e6 + 0.25, 3e6 + 0.75);
  expectNear(far, {here.displacement[0], here.displacement[1], here.displacement[2]}, here.turn,
             1e-5);
}

TEST(ClipsRootMotion, IsClampedWhereTimesAre) {
  PackedRig rig(walker());
  ClipView once = rig.clips[0], added = rig.clips[0];
  once.wraps = false;
  added.additive = true;
  rig.clips.insert(rig.clips.end(), {once, added});
  ASSERT_TRUE(rig.pack());
  EXPECT_FALSE(rig.bank->hasRootMotion());
  EXPECT_EQ(rig.bank->rootMotionError().translation, 0);
  expectNear(motionOf(rig, 0, 0, 1), {}, 0, 0);
  rig.options.rootMotion = {.node = 1, .upAxis = 1};
  ASSERT_TRUE(rig.pack());
  const RootMotion all = motionOf(rig, 0, 0, 1.5);
  const dvec3 displacement(all.displacement[0], all.displacement[1], all.displacement[2]);
  EXPECT_GT(glm::length(displacement), 1);
  expectNear(motionOf(rig, 1, -3, 9), displacement, all.turn, 1e-12);
  expectNear(motionOf(rig, 0, -3, 9, true), displacement, all.turn, 1e-12);
  expectNear(motionOf(rig, 1, 2, 9), {}, 0, 0);
  expectNear(motionOf(rig, 2, 0, 1), {}, 0, 0);
}

TEST(ClipsRootMotion, OfModelsIsWhatTheReferenceSays) {
  std::uint32_t packed = 0;
  forEachAnimatedModel(fewer(2u, 2u), [&](gltf::Model model, std::uint32_t number) {
    std::mt19937 random(number);
    PackedRig rig(std::move(model));
    for (const std::uint32_t joint : rig.skeleton.skins[0].joints) {
      rig.options.rootMotion = {.node = joint, .upAxis = number % 3};
      if (rig.tryToPack().ok()) break;
    }
    if (!rig.tryToPack().ok()) return;
    ASSERT_TRUE(rig.pack());
    ++packed;
    checkClips(rig, random, fewer(12, 2));
  });
  EXPECT_GE(packed, 3u);
}

TEST(ClipsRootMotion, RefusesWhatCannotWork) {
  const auto refuses = [](auto change, const std::string& part) {
    PackedRig rig(walker());
    rig.options.rootMotion = {.node = 1, .upAxis = 1};
    change(rig);
    const Result<PackedClips> packed = rig.tryToPack();
    ASSERT_FALSE(packed.ok()) << part;
    EXPECT_EQ(packed.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(packed.error().message.find("packClips: rootMotion"), std::string::npos);
    EXPECT_NE(packed.error().message.find(part), std::string::npos) << packed.error().message;
  };
  refuses([](PackedRig& rig) { rig.options.rootMotion->node = 4; }, "does not exist");
  refuses([](PackedRig& rig) { rig.options.rootMotion->upAxis = 3; }, "does not exist");
  refuses([](PackedRig& rig) { rig.options.rootMotion->node = 2; },
          "node 2 'leg' is below node 1 'hip', which clips move");
  for (const std::array<double, 3>& scale :
       {std::array<double, 3>{1, 1.01, 1}, {1, 1, -1}, {0, 0, 0}})
    refuses([&](PackedRig& rig) { rig.skeleton.nodes[0].scale = scale; }, "uniform scale");

  PackedRig rig(walker());
  rig.options.rootMotion = {.node = 1, .upAxis = 1};
  ASSERT_TRUE(rig.pack());
  const auto refusesTimes = [&](std::uint32_t clip, double from, double to, const char* part) {
    const Result<RootMotion> motion = rootMotion(*rig.bank, clip, from, to);
    ASSERT_FALSE(motion.ok());
    EXPECT_EQ(motion.error().code, ErrorCode::invalidArgument);
    EXPECT_EQ(motion.error().message, std::string("rootMotion: ") + part);
  };
  refusesTimes(1, 0, 1, "there is no clip 1; the bank has 1");
  refusesTimes(0, 0, HUGE_VAL, "a time is not finite");
  refusesTimes(0, std::nan(""), 1, "a time is not finite");
  refusesTimes(0, 0, 1e30, "a time is 2^52 loops away");
}

// The position over the ground and the height are both infinite in float32; between two keys of
// opposite sign there is none.
TEST(ClipsRootMotion, HeightsBeyondFloat32) {
  constexpr float far = 3.4028234e38f, beside = 0.75f * 1.00001f * far;
  // The second of the bank's keys is halfway between the two.
  const Floats times{0, 0.5f / 120, 1.5f / 120, 1.9f / 120, 1};
  const Floats moved{0, 0,     0,       far, beside, 0,       -far, -beside,
                     0, 1e37f, 7.5e36f, 0,   2e37f,  1.5e37f, 0};
  Skeleton skeleton;
  skeleton.nodes.resize(2);
  // Its inverse turns the axis upwards to (0.8, 0.6, 0).
  const double angle = std::atan2(0.8, 0.6) / 2;
  skeleton.nodes[0].rotation = {0, 0, std::sin(angle), std::cos(angle)};
  skeleton.nodes[1].parent = 0;
  const std::array<std::uint32_t, 2> joints{0, 1};
  const std::array<JointMatrix, 2> inverseBind{};
  skeleton.skins.push_back({"", joints, inverseBind});
  ClipView clip{.name = "far", .duration = 1, .channels = {}};
  clip.channels = {{1, ChannelPath::translation, Interpolation::linear, times, moved}};
  const Result<PackedClips> packed =
      packClips(skeleton, {&clip, 1}, {.maxError = 1e36, .rootMotion = RootMotionOptions{1, 1}});
  ASSERT_FALSE(packed.ok());
  EXPECT_EQ(packed.error().code, ErrorCode::limitExceeded) << packed.error().message;
}

// What rounding makes of a path of this size is much more than its error may be. It must not be
// split as long as that takes, into 200 MB of keys.
TEST(ClipsRootMotion, TooFarForItsError) {
  PackedRig rig(walker());
  rig.options.rootMotion = {.node = 1, .upAxis = 1};
  std::mt19937 random(1);
  Floats times, values;
  for (int key = 0; key < 2000; ++key) {
    times.push_back(static_cast<float>(key) * 0.7f);
    for (int i = 0; i < 3; ++i) values.push_back(static_cast<float>(between(random, -1e15, 1e15)));
  }
  rig.clips.assign(1, ClipView{.name = "far", .duration = double{times.back()}});
  rig.clips[0].channels = {{1, ChannelPath::translation, Interpolation::linear, times, values}};
  const std::uint64_t before = peakKilobytes();
  const Result<PackedClips> packed = rig.tryToPack();
  EXPECT_LT(peakKilobytes() - before, 150'000u);
  ASSERT_FALSE(packed.ok());
  EXPECT_EQ(packed.error().code, ErrorCode::limitExceeded);
  EXPECT_NE(packed.error().message.find("'far'"), std::string::npos) << packed.error().message;
}

}  // namespace
}  // namespace dermis::test
