// The C interface against that of C++: banks of clips, and figures. What both do must be the same
// to the bit.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "c_helpers.h"
#include "dermis/clips.h"
#include "dermis/gltf.h"
#include "dermis/verify.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

class CClipsTest : public ::testing::Test {
 protected:
  CClipsTest() {
    const std::string path = std::string(sampleModels) + "/figure.glb";
    dermis_model_source file = sized<dermis_model_source>();
    file.path = path.c_str();
    expectOk(dermis_model_load(&file, &model, &error));
    expectOk(dermis_model_clips(model, &source, &error));
    expected = must(gltf::load(path));
    skeleton = gltf::skeleton(expected);
    clips = gltf::clips(expected);
  }
  /// Packs both.
  PackedClips pack(Owned<dermis_bank>& bank, const PackClipsOptions& options = {}) {
    expectOk(dermis_pack_clips(&source, &bank, &error));
    PackedClips same = must(packClips(skeleton, clips, options, &report));
    dermis_bank_info info = sized<dermis_bank_info>();
    expectOk(dermis_bank_contents(bank, &info, &error));
    EXPECT_EQ(info.byte_count, same.bytes().size());
    EXPECT_TRUE(isSame(info.bytes, same.bytes().data(), same.bytes().size()));
    EXPECT_EQ(info.worst_error, report.worstError);
    EXPECT_EQ(info.max_error, report.maxError);
    EXPECT_EQ(info.slowest_rate, report.slowestRate);
    EXPECT_EQ(info.fastest_rate, report.fastestRate);
    EXPECT_EQ(info.key_count, report.keyCount);
    EXPECT_EQ(info.animated_tracks, report.animatedTracks);
    EXPECT_EQ(info.constant_tracks, report.constantTracks);
    EXPECT_EQ(info.worst, report.worst);
    return same;
  }
  void expectRefused(const std::string& part) {
    Owned<dermis_bank> none;
    expectError(dermis_pack_clips(&source, &none, &error), part);
    EXPECT_EQ(none.object, nullptr);
  }

  /// What the reference samples of the source, with bounds of the bank.
  dermis_sampled_clips sampledOf(const dermis_bank* bank,
                                 std::span<const dermis_clip_layer> layers) {
    dermis_bank_info info = sized<dermis_bank_info>();
    expectOk(dermis_bank_contents(bank, &info, &error));
    dermis_sampled_clips sampled = sized<dermis_sampled_clips>();
    sampled.source = &source;
    sampled.layers = layers.data();
    sampled.layer_count = static_cast<std::uint32_t>(layers.size());
    sampled.bank = info.bytes;
    sampled.bank_byte_count = info.byte_count;
    return sampled;
  }
  /// The pose that the reference samples is that of C++.
  static void expectPose(const dermis_sampled_clips& sampled,
                         const reference::SampledPose& expected) {
    std::vector<double> joints(12 * expected.joints.size()), bounds(3 * expected.joints.size());
    expectOk(dermis_reference_pose(&sampled, 0, joints.data(), joints.size(), bounds.data(),
                                   bounds.size(), &error));
    EXPECT_TRUE(isSame(joints.data(), expected.joints.data(), 8 * joints.size()));
    EXPECT_TRUE(isSame(bounds.data(), expected.bounds.data(), 8 * bounds.size()));
    EXPECT_GT(bounds[0], 0);
  }

  Owned<dermis_model> model;
  dermis_clips_source source = sized<dermis_clips_source>();
  gltf::Model expected;
  Skeleton skeleton;
  std::vector<ClipView> clips;
  PackClipsReport report;
};

TEST_F(CClipsTest, ABankOfAModelIsThatOfCpp) {
  Owned<dermis_bank> bank;
  const PackedClips same = pack(bank);
  dermis_bank_info info = sized<dermis_bank_info>();
  expectOk(dermis_bank_contents(bank, &info, &error));
  EXPECT_EQ(info.node_count, same.nodeCount());
  ASSERT_EQ(info.skin_count, same.skinCount());
  EXPECT_EQ(info.joint_counts[0], same.jointCount(0));
  ASSERT_EQ(info.clip_count, clips.size());
  EXPECT_EQ(info.mask_count, 0u);
  EXPECT_EQ(info.morphed_node_count, 0u);
  for (std::uint32_t clip = 0; clip < info.clip_count; ++clip) {
    EXPECT_EQ(info.clips[clip].duration, same.clip(clip).duration);
    EXPECT_EQ(info.clips[clip].is_clamped, 0u);
    EXPECT_EQ(info.clips[clip].is_additive, 0u);
  }
  Owned<dermis_bank> loaded;
  expectOk(dermis_bank_load(info.bytes, info.byte_count, &loaded, &error));
  dermis_bank_info again = sized<dermis_bank_info>();
  expectOk(dermis_bank_contents(loaded, &again, &error));
  EXPECT_TRUE(isSame(again.bytes, info.bytes, info.byte_count));
  EXPECT_EQ(again.worst_error, 0);
  EXPECT_STREQ(again.worst, "");
  expectError(dermis_bank_load(info.bytes, info.byte_count - 4, &loaded, &error), "",
              DERMIS_INVALID_DATA);
}

TEST_F(CClipsTest, EveryOptionIsThatOfCpp) {
  const std::size_t nodes = skeleton.nodes.size();
  std::vector<float> masks(2 * nodes, 0.5f);
  masks[nodes + 1] = 0;
  std::vector<dermis_clip_view> views(source.clips, source.clips + source.clip_count);
  ASSERT_GE(views.size(), 2u);
  views[0].is_clamped = 1;
  views[1].is_additive = 1;
  views[1].base_clip = 1;
  views[1].base_time = 0.25;
  source.clips = views.data();
  source.masks = masks.data();
  source.mask_count = 2;
  source.max_error = 0.01;
  dermis_primitive primitive = sized<dermis_primitive>();
  expectOk(dermis_model_primitive(model, 0, &primitive, &error));
  source.meshes = primitive.mesh;
  ASSERT_EQ(source.skin_count, 1u);

  clips[0].wraps = false;
  clips[1].additive = true;
  clips[1].baseClip = 0;
  clips[1].baseTime = 0.25;
  const std::array<std::span<const float>, 2> spans{std::span(masks).first(nodes),
                                                    std::span(masks).subspan(nodes)};
  const gltf::SkinnedPrimitive& skinned = expected.skinnedPrimitives[0];
  const gltf::PrimitiveView view(expected.meshes[skinned.mesh].primitives[skinned.primitive]);
  const JointBounds reach = must(jointBounds(view.mesh(), primitive.joint_count));
  const std::array<const JointBounds*, 1> meshes{&reach};
  Owned<dermis_bank> bank;
  const PackedClips same = pack(bank, {.maxError = 0.01, .meshes = meshes, .masks = spans});
  dermis_bank_info info = sized<dermis_bank_info>();
  expectOk(dermis_bank_contents(bank, &info, &error));
  EXPECT_EQ(info.mask_count, 2u);
  EXPECT_EQ(info.clips[0].is_clamped, 1u);
  EXPECT_EQ(info.clips[1].is_additive, 1u);

  const std::array<dermis_clip_layer, 2> layers{{{7.3, 0.5f, 0, 0, 1}, {0.6, -0.25f, 1, 2, 0}}};
  const std::array<ClipLayer, 2> sameLayers{{{0, 7.3, 0.5f, 0, true}, {1, 0.6, -0.25f, 2, false}}};
  std::vector<JointMatrix> pose(same.jointCount(0));
  must(samplePose(same, sameLayers, 0, pose));
  std::vector<dermis_joint> joints(pose.size());
  expectOk(
      dermis_sample_pose(bank, layers.data(), 2, 0, joints.data(), primitive.joint_count, &error));
  EXPECT_TRUE(isSame(joints.data(), pose.data(), sizeof(JointMatrix) * pose.size()));
  expectPose(sampledOf(bank, layers),
             must(reference::samplePose(skeleton, clips, spans, sameLayers, 0, &same)));

  // A mesh that is skinned in the bank's pose.
  const dermis_sampled_clips sampled = sampledOf(bank, layers);
  dermis_posed_mesh posed = sized<dermis_posed_mesh>();
  posed.mesh = primitive.mesh;
  posed.method = DERMIS_METHOD_LINEAR;
  posed.clips = &sampled;
  const reference::SkinnedMesh inSource = must(reference::skin(
      view.mesh(), must(reference::samplePose(skeleton, clips, spans, sameLayers, 0, &same)),
      Method::linear));
  std::vector<double> positions(3 * inSource.positions.size());
  expectOk(dermis_reference_skin(&posed, positions.data(), positions.size(), nullptr, 0, nullptr, 0,
                                 &error));
  EXPECT_TRUE(isSame(positions.data(), inSource.positions.data(), 8 * positions.size()));
  std::vector<float> stored;
  for (const reference::Double3& position :
       must(reference::skin(view.mesh(), pose, Method::linear)).positions)
    stored.insert(stored.end(), {static_cast<float>(position[0]), static_cast<float>(position[1]),
                                 static_cast<float>(position[2])});
  dermis_skinned_view inBank = sized<dermis_skinned_view>();
  inBank.vertex_count = static_cast<std::uint32_t>(inSource.positions.size());
  inBank.positions = {stored.data(), 0, DERMIS_FORMAT_FLOAT32X3};
  dermis_comparison comparison = sized<dermis_comparison>();
  expectOk(dermis_compare(&posed, &inBank, &comparison, &error));
  EXPECT_EQ(comparison.passed, 1u);
  EXPECT_GT(comparison.compared, 0u);
  EXPECT_GT(comparison.largest_position_error, 1e-6) << "the bank is as exact as its source";
  posed.skin = 1;
  expectError(dermis_compare(&posed, &inBank, &comparison, &error), "skin 1 does not exist");
  posed.skin = 0;
  posed.joints = joints.data();
  posed.joint_count = primitive.joint_count;
  expectError(dermis_compare(&posed, &inBank, &comparison, &error), "there are joints and clips");
  posed.clips = nullptr;
  expectOk(dermis_compare(&posed, &inBank, &comparison, &error));
  EXPECT_EQ(comparison.passed, 1u);

  expectError(
      dermis_sample_pose(bank, layers.data(), 2, 1, joints.data(), primitive.joint_count, &error),
      "there is no skin 1");
  expectError(dermis_sample_pose(bank, nullptr, 2, 0, joints.data(), 1, &error), "layers is null");

  const auto refuses = [&](const char* text, dermis_code code) {
    Owned<dermis_bank> none;
    expectError(dermis_pack_clips(&source, &none, &error), text, code);
  };
  source.mask_count = 0xffffffffu;
  refuses("there are 4294967295 masks, but at most 31 are allowed", DERMIS_LIMIT_EXCEEDED);
  source.mask_count = 2;
  // The next one would not be aligned.
  std::array<std::byte, sizeof(dermis_mesh_view) + 8> larger{};
  auto* const odd = new (larger.data()) dermis_mesh_view(*primitive.mesh);
  odd->size += 4;
  source.meshes = odd;
  refuses("meshes: its size is", DERMIS_INVALID_ARGUMENT);
}

TEST_F(CClipsTest, ErrorsAndTimesAreThoseOfCpp) {
  Owned<dermis_bank> bank;
  const PackedClips same = pack(bank);
  float largest = 0;
  for (std::uint32_t node = 0; node <= skeleton.nodes.size(); ++node) {
    dermis_clip_error found{9, 9, 9, 9};
    expectOk(dermis_node_error(bank, node, &found, &error));
    const ClipError wanted = same.error(node);
    EXPECT_TRUE(isSame(&found, &wanted, sizeof(found)));
    largest = std::max(largest, found.rotation);
  }
  EXPECT_GT(largest, 0);
  expectError(dermis_node_error(nullptr, 0, nullptr, &error), "bank is null");
  expectError(dermis_node_error(bank, 0, nullptr, &error), "result is null");

  float time = 0;
  for (const double seconds : {-0.25, 0.5, 100.0}) {
    for (const bool hold : {false, true}) {
      expectOk(dermis_clip_time(bank, 1, seconds, hold ? 1 : 0, &time, &error));
      EXPECT_EQ(time, clipTime(same.clip(1), seconds, hold));
    }
  }
  expectError(dermis_clip_time(nullptr, 0, 0, 0, &time, &error), "bank is null");
  expectError(dermis_clip_time(bank, 7, 0, 0, &time, &error), "there is no clip 7");
  expectError(dermis_clip_time(bank, 0, 0, 0, nullptr, &error), "result is null");
  expectError(dermis_clip_time(bank, 0, std::numeric_limits<double>::infinity(), 0, &time, &error),
              "the time is not finite");
}

TEST_F(CClipsTest, WhatIsWrongForTheReferenceIsSaid) {
  Owned<dermis_bank> bank;
  const PackedClips same = pack(bank);
  const dermis_clip_layer layer{0.5, 1, 0, 0, 0};
  const dermis_sampled_clips right = sampledOf(bank, {&layer, 1});
  const dermis_clips_source callers = source;
  dermis_sampled_clips sampled = right;
  const std::size_t count = same.jointCount(0);
  std::vector<double> joints(12 * count, 7), bounds(3 * count, 7);
  const auto refused = [&](const std::string& part, dermis_code code = DERMIS_INVALID_ARGUMENT) {
    expectError(dermis_reference_pose(&sampled, 0, joints.data(), 12 * count, bounds.data(),
                                      3 * count, &error),
                part, code);
    EXPECT_EQ(joints[0], 7);
    EXPECT_EQ(bounds[0], 7);
    sampled = right;
  };
  sampled.size = 8;
  refused("sampled: its size is 8");
  sampled.source = nullptr;
  refused("source is null");
  source.size = 8;
  refused("source: its size is 8");
  source.size = sizeof(source);
  sampled.layers = nullptr;
  refused("layers is null");
  sampled.layer_count = 5;
  const std::array<dermis_clip_layer, 5> many{};
  sampled.layers = many.data();
  refused("there are 5 layers, but at most 4");
  sampled.bank = nullptr;
  refused("bank is null");
  sampled.bank = nullptr;
  sampled.bank_byte_count = 0;
  refused("there is no bank, from which bounds follow");
  sampled.bank_byte_count -= 4;
  refused("", DERMIS_INVALID_DATA);
  expectError(dermis_reference_pose(nullptr, 0, nullptr, 0, nullptr, 0, &error), "sampled is null");
  expectError(dermis_reference_pose(&sampled, 1, nullptr, 0, nullptr, 0, &error),
              "skin 1 does not exist");
  expectError(
      dermis_reference_pose(&sampled, 0, joints.data(), 12 * count, bounds.data(), 1, &error),
      "bounds have " + std::to_string(3 * count) + " numbers, not 1");
  EXPECT_EQ(joints[0], 7);  // nothing is written if a count is wrong
  expectError(dermis_reference_weights(nullptr, 0, nullptr, 0, nullptr, 0, &error),
              "sampled is null");
  expectError(dermis_reference_weights(&sampled, 0, joints.data(), 4, nullptr, 0, &error),
              "weights have 0 numbers, not 4");
  double motion[4] = {7};
  expectError(dermis_reference_motion(nullptr, 0, 0, 1, 0, motion, nullptr, &error),
              "sampled is null");
  expectError(dermis_reference_motion(&sampled, 0, 0, 1, 0, motion, nullptr, &error),
              "the source has no root_motion_node");
  EXPECT_EQ(motion[0], 7);
  std::vector<dermis_node> nodes(source.nodes, source.nodes + source.node_count);
  nodes[0].parent = 1;
  source.nodes = nodes.data();
  refused("the parents of nodes form a cycle");
  source.root_motion_node = 1;
  expectError(dermis_reference_motion(&sampled, 0, 0, 1, 0, motion, nullptr, &error),
              "the parents of nodes form a cycle");
  source = callers;
  // Without a bank and arrays, what is given is checked.
  sampled.bank = nullptr;
  sampled.bank_byte_count = 0;
  expectOk(dermis_reference_pose(&sampled, 0, nullptr, 0, nullptr, 0, &error));
  expectOk(dermis_reference_pose(&sampled, 0, joints.data(), 12 * count, nullptr, 0, &error));
  EXPECT_NE(joints[0], 7);
}

TEST_F(CClipsTest, BoxesAreThoseOfCpp) {
  Owned<dermis_bank> bank;
  const PackedClips same = pack(bank);
  dermis_primitive primitive = sized<dermis_primitive>();
  expectOk(dermis_model_primitive(model, 0, &primitive, &error));
  Owned<dermis_joint_bounds> bounds;
  expectOk(dermis_joint_bounds_create(primitive.mesh, primitive.joint_count, nullptr, 0, &bounds,
                                      &error));
  const gltf::SkinnedPrimitive& skinned = expected.skinnedPrimitives[0];
  const gltf::PrimitiveView view(expected.meshes[skinned.mesh].primitives[skinned.primitive]);
  const JointBounds reach = must(jointBounds(view.mesh(), primitive.joint_count));
  dermis_box box{};
  expectOk(dermis_clip_box(bank, 1, 0, bounds, DERMIS_METHOD_LINEAR, DERMIS_PROMISE_SCALING, &box,
                           &error));
  Box found = must(clipBounds(same, 1, 0, reach, Method::linear));
  EXPECT_TRUE(isSame(&box, &found, sizeof(box)));
  const std::array<std::uint32_t, 2> blended{0, 2};
  expectOk(dermis_blend_box(bank, blended.data(), 2, 0, bounds, DERMIS_METHOD_DEFAULT,
                            DERMIS_PROMISE_SCALE_IGNORED, &box, &error));
  found = must(
      blendBounds(same, blended, 0, reach, Method::dualQuaternion, JointPromise::scaleIgnored));
  EXPECT_TRUE(isSame(&box, &found, sizeof(box)));
  expectError(dermis_clip_box(bank, 7, 0, bounds, DERMIS_METHOD_LINEAR, DERMIS_PROMISE_SCALING,
                              &box, &error),
              "7");
  expectError(dermis_blend_box(bank, nullptr, 1, 0, bounds, DERMIS_METHOD_LINEAR,
                               DERMIS_PROMISE_SCALING, &box, &error),
              "clips is null");
}

// A scale of zeros is the default in C.
TEST_F(CClipsTest, ANodeOfAModelThatIsHiddenStaysHidden) {
  const std::string text = R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
    "nodes": [{"name": "hidden", "scale": [0, 0, 0]}], "skins": [{"joints": [0]}]})";
  dermis_model_source file = sized<dermis_model_source>();
  file.bytes = text.data();
  file.byte_count = text.size();
  Owned<dermis_model> hidden;
  expectOk(dermis_model_load(&file, &hidden, &error));
  expectOk(dermis_model_clips(hidden, &source, &error));
  ASSERT_EQ(source.skin_count, 1u);
  Owned<dermis_bank> bank;
  expectOk(dermis_pack_clips(&source, &bank, &error));
  JointMatrix joint;
  expectOk(
      dermis_sample_pose(bank, nullptr, 0, 0, reinterpret_cast<dermis_joint*>(&joint), 1, &error));
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(joint.m[i][i], 0.0f);
}

TEST_F(CClipsTest, WeightsAreThoseOfCpp) {
  const std::array<float, 4> rest{0, 0.25f, 0.5f, 1}, times{0, 0.5f, 1, 2};
  std::array<float, 16> values{};
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i * i % 7);
  std::vector<dermis_node> nodes(source.nodes, source.nodes + source.node_count);
  nodes[1].weights = rest.data();
  nodes[1].weight_count = 4;
  dermis_channel channel = sized<dermis_channel>();
  channel.node = 1;
  channel.path = DERMIS_CHANNEL_WEIGHTS;
  channel.interpolation = DERMIS_INTERPOLATION_LINEAR;
  channel.times = times.data();
  channel.values = values.data();
  channel.key_count = 4;
  channel.value_count = 16;
  dermis_clip_view clip = sized<dermis_clip_view>();
  clip.duration = 2;
  clip.channels = &channel;
  clip.channel_count = 1;
  source.nodes = nodes.data();
  source.clips = &clip;
  source.clip_count = 1;
  source.max_weight_error = 0.01;
  skeleton.nodes[1].weights = rest;
  clips.resize(1);
  clips[0] = {.duration = 2, .channels = {}};
  clips[0].channels = {
      {1, ChannelPath::weights, Interpolation::linear, std::span(times), std::span(values)}};
  Owned<dermis_bank> bank;
  const PackedClips same = pack(bank, {.maxWeightError = 0.01});
  const dermis_clip_layer layer{0.7, 1, 0, 0, 0};
  const ClipLayer sameLayer{0, 0.7};
  std::array<float, 4> weights{}, expectedWeights{};
  expectOk(dermis_sample_weights(bank, &layer, 1, 1, weights.data(), 4, &error));
  must(sampleWeights(same, {&sameLayer, 1}, 1, expectedWeights));
  EXPECT_EQ(weights, expectedWeights);
  EXPECT_NE(weights, rest);
  const dermis_sampled_clips sampled = sampledOf(bank, {&layer, 1});
  const auto exact = must(reference::sampleWeights(skeleton, clips, {}, {&sameLayer, 1}, 1, &same));
  std::vector<double> exactWeights(4), bounds(4);
  expectOk(dermis_reference_weights(&sampled, 1, exactWeights.data(), 4, bounds.data(), 4, &error));
  EXPECT_EQ(exactWeights, exact.weights);
  EXPECT_EQ(bounds, exact.bounds);
  dermis_clip_error of{};
  expectOk(dermis_node_error(bank, 1, &of, &error));
  EXPECT_EQ(of.weight, same.error(1).weight);
  // A loaded bank knows how many a node has.
  dermis_bank_info info = sized<dermis_bank_info>();
  Owned<dermis_bank> loaded;
  expectOk(dermis_bank_contents(bank, &info, &error));
  expectOk(dermis_bank_load(info.bytes, info.byte_count, &loaded, &error));
  expectOk(dermis_bank_contents(loaded, &info, &error));
  ASSERT_EQ(info.morphed_node_count, 1u);
  EXPECT_EQ(info.morphed_nodes[0], 1u);
  EXPECT_EQ(info.weight_counts[0], 4u);
  expectError(dermis_sample_weights(bank, &layer, 1, 1, weights.data(), 3, &error),
              "there are 3 weights, but node 1 has 4");
  expectError(dermis_sample_weights(bank, &layer, 1, 1, nullptr, 4, &error), "weights is null");
}

TEST_F(CClipsTest, RootMotionIsThatOfCpp) {
  const std::array<float, 2> times{0, 2};
  const std::array<float, 6> values{0, 1, 2, 3, 4, 6};
  dermis_channel channel = sized<dermis_channel>();
  channel.times = times.data();
  channel.values = values.data();
  channel.key_count = 2;
  channel.value_count = 6;
  channel.interpolation = DERMIS_INTERPOLATION_LINEAR;
  dermis_clip_view clip = sized<dermis_clip_view>();
  clip.duration = 2;
  clip.channels = &channel;
  clip.channel_count = 1;
  source.clips = &clip;
  source.clip_count = 1;
  while (channel.node + 1 < source.node_count && source.nodes[channel.node].parent != 0)
    ++channel.node;
  ASSERT_EQ(source.nodes[channel.node].parent, 0u);
  clips.resize(1);
  clips[0] = {.duration = 2, .channels = {}};
  clips[0].channels = {{.node = channel.node, .times = times, .values = values}};
  for (std::uint32_t up = 0; up < 4; ++up) {
    source.root_motion_node = channel.node + 1;
    source.up_axis = up;
    const RootMotionOptions carrier{.node = channel.node, .upAxis = up == 0 ? 1 : up - 1};
    Owned<dermis_bank> bank;
    const PackedClips same = pack(bank, {.rootMotion = carrier});
    dermis_bank_info info = sized<dermis_bank_info>();
    expectOk(dermis_bank_contents(bank, &info, &error));
    EXPECT_EQ(info.has_root_motion, 1u);
    const ClipError wanted = same.rootMotionError();
    EXPECT_TRUE(isSame(&info.root_motion_error, &wanted, sizeof(wanted)));
    const dermis_clip_layer layer{0.7, 1, 0, 0, 0};
    const ClipLayer sameLayer{0, 0.7};
    const dermis_sampled_clips sampled = sampledOf(bank, {&layer, 1});
    expectPose(sampled, must(reference::samplePose(skeleton, clips, {}, {&sameLayer, 1}, 0, &same,
                                                   &carrier)));
    for (const bool hold : {false, true}) {
      std::array<double, 3> displacement{};
      double turn = -1;
      expectOk(dermis_root_motion(bank, 0, 1, 5, hold ? 1 : 0, displacement.data(), &turn, &error));
      const RootMotion motion = must(rootMotion(same, 0, 1, 5, hold));
      EXPECT_EQ(displacement, motion.displacement);
      EXPECT_EQ(turn, motion.turn);
      EXPECT_NEAR(displacement[2], up == 3 ? 0 : hold ? 2 : 8, 0.01);
      const auto exact =
          must(reference::rootMotion(skeleton, clips, carrier, 0, 1, 5, hold, &same));
      std::array<double, 4> of{};
      std::array<double, 2> bounds{};
      expectOk(dermis_reference_motion(&sampled, 0, 1, 5, hold ? 1 : 0, of.data(), bounds.data(),
                                       &error));
      EXPECT_TRUE(isSame(of.data(), exact.motion.displacement.data(), 24));
      EXPECT_EQ(of[3], exact.motion.turn);
      EXPECT_EQ(bounds, (std::array{exact.displacementBound, exact.turnBound}));
      expectOk(dermis_reference_motion(&sampled, 0, 1, 5, 0, nullptr, nullptr, &error));
    }
    expectError(dermis_reference_motion(&sampled, 1, 0, 1, 0, nullptr, nullptr, &error),
                "clip 1 does not exist");
    double turn = 0;
    expectError(dermis_root_motion(bank, 1, 0, 1, 0, &turn, &turn, &error), "there is no clip 1");
    expectError(dermis_root_motion(bank, 0, 0, 1, 0, nullptr, &turn, &error),
                "displacement is null");
  }
  source.up_axis = 4;
  expectRefused("rootMotion names a node or an axis that does not exist");
}

TEST_F(CClipsTest, ZerosAreTheDefaultsOfANode) {
  const double matrix[12] = {1, 0, 0, 0.5, 0, 2, 0, 0, 0, 0, 1, 0};
  std::array<dermis_node, 3> nodes{sized<dermis_node>(), sized<dermis_node>(),
                                   sized<dermis_node>()};
  nodes[1].parent = 1;
  nodes[1].translation[1] = 3;
  nodes[2].parent = 2;
  nodes[2].matrix = matrix;
  const std::array<std::uint32_t, 2> joints{2, 1};
  std::array<dermis_joint, 2> inverse{};
  for (dermis_joint& joint : inverse) {
    const JointMatrix identity;
    std::memcpy(&joint, &identity, sizeof(joint));
  }
  dermis_skin skin{sizeof(dermis_skin), 2, nullptr, joints.data(), inverse.data()};
  source = sized<dermis_clips_source>();
  source.nodes = nodes.data();
  source.node_count = 3;
  source.skins = &skin;
  source.skin_count = 1;
  Owned<dermis_bank> bank;
  expectOk(dermis_pack_clips(&source, &bank, &error));
  std::array<JointMatrix, 2> pose;
  expectOk(dermis_sample_pose(bank, nullptr, 0, 0, reinterpret_cast<dermis_joint*>(pose.data()), 2,
                              &error));
  EXPECT_EQ(pose[0].m[0][3], 0.5f);
  EXPECT_EQ(pose[0].m[1][1], 2.0f);
  EXPECT_EQ(pose[0].m[1][3], 3.0f);
  EXPECT_EQ(pose[1].m[1][1], 1.0f);

  // What is wrong is said.
  source.skin_count = 0;
  expectRefused("there are no skins");
  source.skin_count = 1;
  nodes[1].size = 3;
  expectRefused("nodes[1]");
  nodes[1].size = sizeof(dermis_node);
  nodes[0].parent = 3;
  expectRefused("cycle");
  nodes[0].parent = 0;
  source.mask_count = 1;
  expectRefused("masks is null");
  source.mask_count = 0;
  dermis_channel channel = sized<dermis_channel>();
  channel.path = static_cast<dermis_channel_path>(4);
  dermis_clip_view clip = sized<dermis_clip_view>();
  clip.channels = &channel;
  clip.channel_count = 1;
  source.clips = &clip;
  source.clip_count = 1;
  expectRefused("a channel's path is 4");
  channel.path = DERMIS_CHANNEL_SCALE;
  channel.interpolation = static_cast<dermis_interpolation>(3);
  expectRefused("a channel's interpolation is 3");
  channel.interpolation = DERMIS_INTERPOLATION_STEP;
  channel.key_count = 1;
  expectRefused("a channel's times is null");
}

TEST_F(CClipsTest, FiguresPlay) {
  Owned<dermis_bank> bank;
  const PackedClips same = pack(bank);
  Owned<dermis_runner> runner;
  expectOk(dermis_runner_create(nullptr, &runner, &error));
  dermis_scene* const scene = dermis_runner_scene(runner);
  dermis_clips clipsOfScene{};
  expectOk(dermis_add_clips(scene, bank, &clipsOfScene, &error));
  std::array<dermis_figure, 3> figures{};
  expectOk(dermis_add_figures(scene, clipsOfScene, nullptr, 0, 3, figures.data(), &error));

  dermis_primitive primitive = sized<dermis_primitive>();
  expectOk(dermis_model_primitive(model, 0, &primitive, &error));
  Owned<dermis_packed> packed;
  expectOk(dermis_pack(primitive.mesh, primitive.joint_count, &packed, &error));
  dermis_instance_desc desc = sized<dermis_instance_desc>();
  expectOk(dermis_add_mesh(scene, packed, &desc.mesh, &error));
  expectOk(dermis_figure_pose(scene, figures[0], 0, &desc.pose, &error));
  const dermis_pose first = desc.pose;
  dermis_instance instance{};
  expectOk(dermis_add_instance(scene, &desc, &instance, &error));
  // A pose that the caller writes, for comparison.
  dermis_pose_desc written = sized<dermis_pose_desc>();
  written.joint_count = primitive.joint_count;
  expectOk(dermis_add_poses(scene, &written, 1, &desc.pose, &error));
  dermis_instance other{};
  expectOk(dermis_add_instance(scene, &desc, &other, &error));

  expectOk(dermis_begin_frame(scene, 1, 0, &error));
  const std::array<dermis_clip_layer, 2> layers{{{0.4, 0.75f, 0, 0, 0}, {1.9, 0.25f, 1, 0, 1}}};
  const std::array<dermis_play, 2> plays{
      {{figures[1], 0, nullptr}, {figures[0], 2, layers.data()}}};
  expectOk(dermis_play_clips(scene, plays.data(), 2, &error));
  const std::array<ClipLayer, 2> sameLayers{{{0, 0.4, 0.75f}, {1, 1.9, 0.25f, 0, true}}};
  dermis_joint* memory = nullptr;
  expectOk(dermis_write_poses(scene, &desc.pose, 1, &memory, nullptr, &error));
  must(samplePose(same, sameLayers, 0,
                  {reinterpret_cast<JointMatrix*>(memory), primitive.joint_count}));
  dermis_runner_frame frame = sized<dermis_runner_frame>();
  expectOk(dermis_runner_jobs(runner, 0, &frame, &error));
  for (std::uint32_t job = 0; job < frame.job_count; ++job)
    expectOk(dermis_run_job(runner, job, &error));
  std::array<dermis_instance_info, 2> infos{sized<dermis_instance_info>(),
                                            sized<dermis_instance_info>()};
  expectOk(dermis_instance_contents(scene, instance, &infos[0], &error));
  expectOk(dermis_instance_contents(scene, other, &infos[1], &error));
  const auto* output = static_cast<const std::byte*>(frame.output);
  EXPECT_EQ(infos[0].is_written, 1u);
  EXPECT_TRUE(isSame(output + infos[0].offset, output + infos[1].offset,
                     12 * std::size_t{primitive.mesh->vertex_count}));
  dermis_scene_info info = sized<dermis_scene_info>();
  expectOk(dermis_scene_contents(scene, &info, &error));
  EXPECT_EQ(info.sampled_figures, 1u);

  expectError(dermis_play_clips(scene, nullptr, 1, &error), "plays is null");
  dermis_play wrong = plays[1];
  wrong.layer_count = 5;
  const std::array<dermis_clip_layer, 5> many{};
  wrong.layers = many.data();
  expectError(dermis_play_clips(scene, &wrong, 1, &error), "entry 0: there are 5 layers");
  std::array<dermis_play, 2> second{plays[1], plays[0]};
  second[1].layer_count = 1;
  expectError(dermis_play_clips(scene, second.data(), 2, &error), "entry 1: layers is null");
  second[1].layer_count = 0;
  std::memcpy(&second[1].figure, &first, sizeof(first));
  expectError(dermis_play_clips(scene, second.data(), 2, &error),
              "entry 1: figure: this is the handle of a pose");
  // The first wrong entry is named, whether the scene or the C interface finds what is wrong.
  const auto expectFirst = [&](std::span<const dermis_play> entries, const char* message) {
    expectError(dermis_play_clips(scene, entries.data(), static_cast<std::uint32_t>(entries.size()),
                                  &error),
                message);
  };
  dermis_clip_layer infinite = layers[0];
  infinite.weight = std::numeric_limits<float>::infinity();
  const dermis_play heavy{figures[2], 1, &infinite}, missing{figures[2], 1, nullptr};
  expectFirst(std::array{plays[1], heavy, plays[0], second[1]},
              "entry 1: layer 0: its weight is not");
  expectFirst(std::array{plays[1], plays[0], missing, heavy}, "entry 2: layers is null");
  expectFirst(std::array{plays[1], second[1], heavy},
              "entry 1: figure: this is the handle of a pose");
  expectFirst(std::array{missing, heavy}, "entry 0: layers is null");
  expectError(dermis_remove_clips(scene, clipsOfScene, &error), "is used by 3 figures");
  expectError(dermis_remove_figure(scene, figures[0], &error), "is used by 1 instance");
  expectError(dermis_figure_pose(scene, figures[0], 1, &desc.pose, &error), "has no skin 1");
  expectOk(dermis_begin_frame(scene, 2, 1, &error));
  expectError(dermis_write_poses(scene, &first, 1, &memory, nullptr, &error), "belongs to figure");
  dermis_figure misused{};
  std::memcpy(&misused, &clipsOfScene, sizeof(misused));
  expectError(dermis_remove_figure(scene, misused, &error), "this is the handle of clips");
  expectOk(dermis_remove_instance(scene, instance, &error));
  for (const dermis_figure figure : figures) expectOk(dermis_remove_figure(scene, figure, &error));
  expectError(dermis_remove_figure(scene, figures[0], &error), "it was removed");
  expectOk(dermis_remove_clips(scene, clipsOfScene, &error));
  expectError(dermis_add_figures(scene, clipsOfScene, nullptr, 0, 2, figures.data(), &error),
              "it was removed");
}

TEST_F(CClipsTest, FiguresHaveRigs) {
  Owned<dermis_bank> bank;
  const std::uint32_t joints = pack(bank).jointCount(0);
  Owned<dermis_runner> runner;
  expectOk(dermis_runner_create(nullptr, &runner, &error));
  dermis_scene* const scene = dermis_runner_scene(runner);
  dermis_clips clipsOfScene{};
  expectOk(dermis_add_clips(scene, bank, &clipsOfScene, &error));
  std::array<dermis_rig, 2> rigs{};  // the second does not fit
  const std::vector<dermis_rig_joint> rigJoints(joints);
  for (std::uint32_t i = 0; i < 2; ++i) {
    dermis_rig_source described = sized<dermis_rig_source>();
    described.joint_count = described.written_joints = joints - i;
    described.joints = rigJoints.data();
    Owned<dermis_packed_rig> packed;
    expectOk(dermis_pack_rig(&described, &packed, &error));
    expectOk(dermis_add_rig(scene, packed, &rigs[i], &error));
  }
  std::array<dermis_figure, 2> figures{};
  const auto refused = [&](const std::string& part, const dermis_rig* all, std::uint32_t count) {
    expectError(dermis_add_figures(scene, clipsOfScene, all, count, 2, figures.data(), &error),
                part);
    EXPECT_EQ(figures[0].generation, 0u);
  };
  refused("rigs is null", nullptr, 1);
  refused("there are 2 rigs for 1 skins", rigs.data(), 2);
  refused("has " + std::to_string(joints - 1) + " written joints", &rigs[1], 1);
  dermis_rig misused{};
  std::memcpy(&misused, &clipsOfScene, sizeof(misused));
  refused("rig: this is the handle of clips", &misused, 1);
  expectOk(dermis_add_figures(scene, clipsOfScene, rigs.data(), 1, 2, figures.data(), &error));
  expectError(dermis_remove_rig(scene, rigs[0], &error), "is used by 2 poses");
  expectOk(dermis_remove_rig(scene, rigs[1], &error));
  expectError(dermis_add_figures(scene, clipsOfScene, &rigs[1], 1, 2, figures.data(), &error),
              "there is no rig 1 of generation 1; it was removed");
}

}  // namespace
}  // namespace dermis::test
