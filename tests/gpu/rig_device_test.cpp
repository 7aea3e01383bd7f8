// Scenes compute what rigs drive on the device: as `evaluateRig` does, and what is skinned with it
// is what is skinned with a pose of the same matrices.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/verify.h"
#include "kit/buffer.h"
#include "kit/device.h"
#include "played_clips.h"
#include "rigged.h"
#include "scene_meshes.h"
#include "system_engine.h"
#include "test_device.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t allJoints = riggedJoints + drivenJoints;
/// The rig drives the last three.
constexpr std::uint32_t targetCount = 5, drivenTargets = 3;
constexpr std::uint32_t firstDrivenWeight = 1;  // one that is given, then two that are driven

class RigOnDevice : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string reason;
    open_ = testDevice(true, reason);
    if (open_ == nullptr) {
      if (isContinuousIntegration()) FAIL() << reason;
      GTEST_SKIP() << reason;
    }
    engine_.emplace(*open_->device, open_->context, vulkan::SceneRecorderDescription{});
    words_ = must(samples::MappedBuffer::create(*open_->device, wordBytes,
                                                VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
    mesh_ = engine_->addMesh(systemMesh(7, 130, allJoints, 4, targetCount));
  }
  void TearDown() override {
    engine_.reset();
    words_.reset();
    if (open_ == nullptr) return;
    for (const std::string& message : open_->device->takeValidationMessages())
      ADD_FAILURE() << message;
  }

  SystemEngine& engine() { return *engine_; }
  Scene& scene() { return engine_->scene(); }

  InstanceDescription riggedInstance(PoseHandle pose, Method method) const {
    return {.mesh = mesh_,
            .pose = pose,
            .method = method,
            .layout = plainLayout(),
            .drivenTargets = drivenTargets,
            .firstDrivenWeight = firstDrivenWeight};
  }
  PoseHandle addRigged(RigHandle rig, std::span<const JointMatrix> written,
                       std::span<const float> given) {
    const PoseHandle pose = must(scene().addPose(riggedJoints, {.rig = rig}));
    write(pose, written, given);
    return pose;
  }
  void write(PoseHandle pose, std::span<const JointMatrix> written, std::span<const float> given) {
    begin();
    std::ranges::copy(written, must(scene().writePose(pose)).begin());
    std::ranges::copy(given, must(scene().writePoseWeights(pose)).begin());
  }

  /// The vertices of an instance whose pose has all matrices, and whose morph weights the CPU
  /// writes.
  Streams plainVertices(std::span<const JointMatrix> written, const Driven& driven, Method method,
                        std::vector<MorphWeight> morphs) {
    Pose all(written.begin(), written.end());
    all.insert(all.end(), driven.joints.begin(), driven.joints.end());
    for (std::uint32_t i = 0; i < drivenTargets; ++i)
      morphs.push_back({targetCount - drivenTargets + i, driven.weights[firstDrivenWeight + i]});
    begin();
    const PoseHandle pose = engine().addPose(all);
    const InstanceHandle twin = engine().addInstance(
        {.mesh = mesh_, .pose = pose, .method = method, .layout = plainLayout()});
    must(scene().change(InstanceChange{.instance = twin, .morphs = morphs}));
    runFrame();
    Streams streams = engine().read(twin);
    must(scene().removeInstance(twin));
    must(scene().removePose(pose));
    return streams;
  }

  /// To the culling on the GPU.
  void show(InstanceHandle instance) {
    const std::uint32_t visible = 1;
    std::memcpy(words_->bytes().data() + 4 * must(scene().visibilityIndex(instance)), &visible, 4);
  }
  void begin() {
    if (!std::exchange(hasBegun_, true)) engine().begin();
  }
  void runFrame() {
    begin();
    engine().submit(words_->range());
    hasBegun_ = false;
  }

  bool hasBegun_ = false;
  static constexpr std::size_t wordBytes = 4096;
  samples::OpenDevice* open_ = nullptr;
  std::optional<samples::MappedBuffer> words_;
  std::optional<SystemEngine> engine_;
  MeshHandle mesh_;
};

/// The largest share of its bound by which a number is off. Infinite bounds are left out.
double shareOfBounds(const reference::EvaluatedRig& right, const Driven& found) {
  double share = 0;
  const auto add = [&](double exact, double bound, float number) {
    if (std::isfinite(bound) && double{number} != exact)
      share = std::max(share, std::abs(double{number} - exact) / bound);
  };
  for (std::size_t joint = 0; joint < found.joints.size(); ++joint) {
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 4; ++column) {
        add(right.joints.at(joint)[row][column], right.jointBounds.at(joint)[row][column],
            found.joints[joint].m[row][column]);
      }
    }
  }
  for (std::size_t weight = 0; weight < found.weights.size(); ++weight)
    add(right.weights.at(weight), right.weightBounds.at(weight), found.weights[weight]);
  return share;
}

/// Of all numbers that it drives for many poses. As `dermis verify` does.
double worstShare(samples::OpenDevice& open, const RigView& rig) {
  std::vector<samples::RigInput> inputs;
  const std::array<float, 2> given{0.5f, -0.25f};
  for (std::uint32_t seed = 0; seed < 70; ++seed)  // more than a workgroup
    inputs.push_back({systemPose(seed, riggedJoints),
                      std::vector<float>(given.begin(), given.begin() + rig.givenWeights)});
  samples::VulkanTarget target(*open.device, open.context);
  const std::vector<Driven> driven = must(target.drivePoses(must(packRig(rig)), inputs));
  EXPECT_EQ(driven.size(), inputs.size());
  double worst = 0;
  for (std::size_t i = 0; i < driven.size(); ++i) {
    const auto& [written, weights] = inputs[i];
    const double share =
        shareOfBounds(must(reference::evaluateRig(rig, written, weights)), driven[i]);
    EXPECT_LE(share, 1) << "pose " << i;
    worst = std::max(worst, share);
  }
  return worst;
}

TEST_F(RigOnDevice, DrivesWhatTheReferenceDoesWithinItsBounds) {
  const double worst = worstShare(*open_, riggedSource()->view);
  EXPECT_GT(worst, 0.01);
  RecordProperty("worst share of a bound", std::to_string(worst));
}

// What the kernel keeps of a corrective does not reach the next pose.
TEST_F(RigOnDevice, DrivesByAsManyExamplesAsAreAllowed) {
  for (const std::uint32_t inputCount : {1u, 3u}) {
    SCOPED_TRACE(inputCount);
    const auto source = riggedSource();
    std::mt19937 random(inputCount);
    std::uniform_real_distribution<float> between(-1, 1);
    const auto quaternion = [&] {
      return std::array<float, 4>{between(random), between(random), between(random),
                                  between(random)};
    };
    const std::array<std::uint32_t, 3> inputs{2, 5, 7};
    const std::array<std::uint32_t, 2> driven{riggedJoints, riggedJoints + 1};
    constexpr std::uint32_t weightCount = 9;
    std::vector<std::array<float, 4>> examples(maxRigExamples * inputCount);
    std::vector<float> weights(maxRigExamples * weightCount);
    std::vector<JointOffset> offsets(maxRigExamples * driven.size());
    for (auto& example : examples) example = quaternion();
    for (float& weight : weights) weight = between(random);
    for (JointOffset& offset : offsets)
      offset = {{between(random), between(random), 0.1f}, quaternion(), {1, 1.5f, 0.75f}};
    const std::array correctives{CorrectiveDriver{.inputs = std::span(inputs).first(inputCount),
                                                  .examples = examples,
                                                  .radius = 0.5f,
                                                  .firstWeight = 0,
                                                  .weightCount = weightCount,
                                                  .weights = weights,
                                                  .joints = driven,
                                                  .offsets = offsets}};
    RigView view;
    view.joints = std::span(source->joints).first(riggedJoints + driven.size());
    view.writtenJoints = riggedJoints;
    view.drivenWeights = weightCount;
    view.correctives = correctives;
    EXPECT_GT(worstShare(*open_, view), 0);
  }
}

TEST_F(RigOnDevice, ARigMayDriveNothing) {
  const std::vector<RigJoint> joints(allJoints);
  RigView view;
  view.joints = joints;
  view.writtenJoints = allJoints;
  const PackedRig rig = must(packRig(view));
  const Pose written = systemPose(1, allJoints);
  samples::VulkanTarget target(*open_->device, open_->context);
  const std::vector<samples::RigInput> inputs(2, {written, {}});
  const std::vector<Driven> driven = must(target.drivePoses(rig, inputs));
  ASSERT_EQ(driven.size(), inputs.size());
  EXPECT_TRUE(driven[1].joints.empty() && driven[1].weights.empty());
  // In a scene, too.
  const RigHandle handle = must(scene().addRig(PackedRig(rig)));
  InstanceDescription instance{.mesh = mesh_, .layout = plainLayout()};
  instance.pose = must(scene().addPose(allJoints, {.rig = handle}));
  write(instance.pose, written, {});
  const InstanceHandle rigged = engine().addInstance(instance);
  instance.pose = engine().addPose(written);
  const InstanceHandle plain = engine().addInstance(instance);
  runFrame();
  EXPECT_EQ(engine().read(rigged), engine().read(plain));
}

TEST_F(RigOnDevice, DrivenJointsAndWeightsAreSkinnedAsOthers) {
  const RigHandle rig = must(scene().addRig(riggedPose(2)));
  for (const Method method : {Method::linear, Method::dualQuaternion, Method::blended}) {
    SCOPED_TRACE(methodName(method));
    const Pose written = systemPose(3, riggedJoints);
    const std::array<float, givenWeights> given{0.75f, 0.5f};
    const PoseHandle pose = addRigged(rig, written, given);
    const InstanceHandle instance = engine().addInstance(riggedInstance(pose, method));
    const std::vector<MorphWeight> morphs{{1, 0.25f}};
    must(scene().change(InstanceChange{.instance = instance, .morphs = morphs}));
    runFrame();
    const Streams streams = engine().read(instance);
    EXPECT_FALSE(streams[positionStream].empty());
    EXPECT_EQ(streams, plainVertices(written, engine().readDriven(pose), method, morphs));
    // Another pose, and one of the same rig that the frame does not need.
    const Pose next = systemPose(5, riggedJoints);
    write(pose, next, given);
    runFrame();
    EXPECT_NE(engine().read(instance), streams);
    EXPECT_EQ(engine().read(instance),
              plainVertices(next, engine().readDriven(pose), method, morphs));
  }
}

TEST_F(RigOnDevice, OtherTargetsAreWrittenByTheGpu) {
  const RigHandle rig = must(scene().addRig(riggedPose(4)));
  const Pose written = systemPose(6, riggedJoints);
  const std::array<float, givenWeights> given{0.75f, 0.5f};
  const PoseHandle pose = addRigged(rig, written, given);
  InstanceDescription description = riggedInstance(pose, Method::dualQuaternion);
  description.morphWriter = MorphWriter::gpu;
  const InstanceHandle instance = engine().addInstance(description);
  begin();
  const std::array<float, targetCount - drivenTargets> weights{0.5f, -1};
  engine().writeWeights(instance, weights);
  runFrame();
  EXPECT_EQ(engine().read(instance),
            plainVertices(written, engine().readDriven(pose), Method::dualQuaternion,
                          {{0, weights[0]}, {1, weights[1]}}));
}

TEST_F(RigOnDevice, PosesMayBeWrittenByTheGpu) {
  const PackedRig rig = riggedPose(5);
  const RigHandle handle = must(scene().addRig(PackedRig(rig)));
  // Behind the joints are the given weights.
  Pose written = systemPose(8, riggedJoints);
  written.resize(riggedJoints + 1);
  written.back().m[0][0] = 0.5f;
  written.back().m[0][1] = 0.25f;
  const PoseHandle pose =
      must(scene().addPose(riggedJoints, {.writtenByGpu = true, .rig = handle}));
  const InstanceHandle instance =
      engine().addInstance(riggedInstance(pose, Method::dualQuaternion));
  begin();
  engine().writePose(pose, written);
  runFrame();
  written.pop_back();
  const Driven driven = engine().readDriven(pose);
  const std::array<float, givenWeights> given{0.5f, 0.25f};
  EXPECT_LE(largestDifference(evaluated(rig, written, given), driven), 2e-5f);
  EXPECT_EQ(engine().read(instance), plainVertices(written, driven, Method::dualQuaternion, {}));
}

TEST_F(RigOnDevice, FiguresMayHaveRigs) {
  constexpr std::uint32_t given = 3;
  const std::uint32_t node = weightedNode(given);
  const PackedRig rig = riggedPose(6, given, node);
  const ClipsHandle bank = must(scene().addClips(PackedClips(playedClips())));
  const RigHandle handle = must(scene().addRig(PackedRig(rig)));
  const FigureHandle figure = must(scene().addFigure(bank, std::array{RigHandle(), handle}));
  const PoseHandle pose = must(scene().pose(figure, 1));
  InstanceDescription description = riggedInstance(pose, Method::dualQuaternion);
  for (const bool culled : {false, true}) {
    description.culledOnGpu = culled;
    const InstanceHandle instance = engine().addInstance(description);
    show(instance);
    for (std::uint32_t play = 0; play < playCount; ++play) {
      SCOPED_TRACE(play);
      const FigurePlay played{figure, playedLayers(play)};
      must(scene().play({&played, 1}));
      runFrame();
      std::array<float, given> weights;
      must(sampleWeights(playedClips(), playedLayers(play), node, weights));
      const Pose written = playedPose(play, 1);
      const Driven driven = engine().readDriven(pose);
      EXPECT_LE(largestDifference(evaluated(rig, written, weights), driven), 1e-4f);
      EXPECT_EQ(engine().read(instance),
                plainVertices(engine().readPose(pose), driven, Method::dualQuaternion, {}));
    }
    must(scene().removeInstance(instance));
  }
}

TEST_F(RigOnDevice, ARigFitsTheSkinOfAFigure) {
  const ClipsHandle bank = must(scene().addClips(PackedClips(playedClips())));
  const RigHandle wrong = must(scene().addRig(riggedPose(6, 2, weightedNode(3))));
  EXPECT_EQ(scene().addFigure(bank, std::array{wrong, RigHandle()}).error().message,
            "the rig of skin 0 takes 2 weights, but the clips have 3 of its node");
  EXPECT_EQ(scene().addFigure(bank, std::array{wrong}).error().message,
            "there are 1 rigs for 2 skins");
}

TEST_F(RigOnDevice, WhatTheGpuCullsIsDrivenIfItIsNeeded) {
  const PackedRig rig = riggedPose(9);
  const RigHandle handle = must(scene().addRig(PackedRig(rig)));
  const Pose written = systemPose(9, riggedJoints);
  const std::array<float, givenWeights> given{0.25f, 0.5f};
  const PoseHandle pose = addRigged(handle, written, given);
  InstanceDescription description = riggedInstance(pose, Method::dualQuaternion);
  description.culledOnGpu = true;
  const InstanceHandle instance = engine().addInstance(description);
  show(instance);
  runFrame();
  EXPECT_EQ(engine().read(instance),
            plainVertices(written, engine().readDriven(pose), Method::dualQuaternion, {}));
}

TEST_F(RigOnDevice, AnAbandonedFrameIsDrivenAgain) {
  const PackedRig rig = riggedPose(10);
  const RigHandle handle = must(scene().addRig(PackedRig(rig)));
  const Pose written = systemPose(10, riggedJoints);
  const std::array<float, givenWeights> given{1, 2};
  const PoseHandle pose = addRigged(handle, written, given);
  const InstanceHandle instance =
      engine().addInstance(riggedInstance(pose, Method::dualQuaternion));
  begin();
  engine().abandon();
  runFrame();
  const Driven driven = engine().readDriven(pose);
  EXPECT_LE(largestDifference(evaluated(rig, written, given), driven), 2e-5f);
  EXPECT_EQ(engine().read(instance), plainVertices(written, driven, Method::dualQuaternion, {}));
}

TEST_F(RigOnDevice, WhatDoesNotFitIsRefused) {
  const RigHandle rig = must(scene().addRig(riggedPose()));
  EXPECT_EQ(scene().addPose(5, {.rig = rig}).error().message,
            "the pose has 5 joints, but rig 0 has 8 written ones");
  const PoseHandle pose = must(scene().addPose(riggedJoints, {.rig = rig}));
  EXPECT_EQ(scene().removeRig(rig).error().message, "rig 0 is used by 1 pose");
  InstanceDescription description = riggedInstance(pose, Method::dualQuaternion);
  description.firstDrivenWeight = 5;
  EXPECT_EQ(scene().addInstance(description).error().message,
            "the instance has 3 driven targets from weight 5 on, but its rig has 7 weights");
  description.drivenTargets = 6;
  EXPECT_EQ(scene().addInstance(description).error().message,
            "the instance has 6 driven targets, but its mesh has 5 targets");
  description = riggedInstance(pose, Method::dualQuaternion);
  const InstanceHandle instance = engine().addInstance(description);
  const std::vector<MorphWeight> morphs{{2, 1}};
  EXPECT_FALSE(scene().change(InstanceChange{.instance = instance, .morphs = morphs}).ok());
  const PoseHandle plain = must(scene().addPose(riggedJoints));
  EXPECT_EQ(engine().recorder().drivenRange(plain).error().message, "pose 1 has no rig");
  EXPECT_TRUE(must(scene().writePoseWeights(plain)).empty());
  must(scene().removeInstance(instance));
  must(scene().removePose(pose));
  must(scene().removeRig(rig));
  EXPECT_FALSE(scene().addPose(riggedJoints, {.rig = rig}).ok());
}

}  // namespace
}  // namespace dermis::test
