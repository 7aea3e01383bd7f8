// Rigs in scenes on the CPU: what is skinned with one has the bits of what is skinned with a pose
// of all its joints, and of morph targets with its weights.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cpu_engine.h"
#include "dermis/clips.h"
#include "dermis/rig.h"
#include "played_clips.h"
#include "rigged.h"
#include "scene_meshes.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t allJoints = riggedJoints + drivenJoints;
/// The rig drives the last three.
constexpr std::uint32_t targetCount = 5, drivenTargets = 3;
constexpr std::uint32_t firstDrivenWeight = 1;  // one that is given, then two that are driven

class CpuSceneRigTest : public ::testing::Test {
 protected:
  void SetUp() override {
    engine_.verticesPerJob = 50;  // several jobs for each instance
    mesh_ = engine_.addMesh(systemMesh(7, 130, allJoints, 4, targetCount));
  }

  /// An instance whose pose has a rig, and one with a pose of all joints.
  struct Pair {
    PoseHandle pose, plainPose;
    InstanceHandle instance, plain;
  };
  Pair add(PoseHandle rigged, Method method) {
    Pair pair{rigged, must(engine_->addPose(allJoints)), {}, {}};
    InstanceDescription description{.mesh = mesh_,
                                    .pose = rigged,
                                    .method = method,
                                    .layout = plainLayout(),
                                    .drivenTargets = drivenTargets,
                                    .firstDrivenWeight = firstDrivenWeight};
    pair.instance = must(engine_->addInstance(description));
    description.pose = pair.plainPose;
    description.drivenTargets = 0;
    pair.plain = must(engine_->addInstance(description));
    return pair;
  }
  void setMorphs(InstanceHandle instance, const std::vector<MorphWeight>& morphs) {
    must(engine_->change(InstanceChange{.instance = instance, .morphs = morphs}));
  }
  /// Gives the plain one of a pair what the rig should drive.
  void writePlain(const Pair& pair, const PackedRig& rig, const Pose& written,
                  std::span<const float> given, std::vector<MorphWeight> morphs) {
    const Driven driven = evaluated(rig, written, given);
    Pose all = written;
    all.insert(all.end(), driven.joints.begin(), driven.joints.end());
    engine_.writePose(pair.plainPose, all);
    for (std::uint32_t i = 0; i < drivenTargets; ++i)
      morphs.push_back({targetCount - drivenTargets + i, driven.weights[firstDrivenWeight + i]});
    setMorphs(pair.plain, morphs);
  }
  void expectAlike(const Pair& pair) const {
    const std::vector<std::byte> output = engine_.readOutput();
    const Streams streams = engine_.read(output, pair.instance);
    EXPECT_FALSE(streams[positionStream].empty());
    EXPECT_EQ(streams, engine_.read(output, pair.plain));
  }

  CpuEngine engine_{{}};
  MeshHandle mesh_;
};

TEST_F(CpuSceneRigTest, DrivenJointsAndWeightsAreSkinnedAsOthers) {
  const std::array<PackedRig, 2> rigs{riggedPose(1), riggedPose(2)};
  std::array<RigHandle, 2> handles;
  for (std::size_t i = 0; i < rigs.size(); ++i)
    handles[i] = must(engine_->addRig(PackedRig(rigs[i])));
  std::vector<Pair> pairs;
  for (std::uint32_t i = 0; i < 40; ++i) {  // more than one task takes
    const PoseHandle pose = must(engine_->addPose(riggedJoints, {.rig = handles[i % 2]}));
    pairs.push_back(add(pose, i % 3 == 0 ? Method::linear : Method::dualQuaternion));
  }
  for (std::uint32_t frame = 0; frame < 3; ++frame) {
    engine_.begin();
    for (std::uint32_t i = frame; i < pairs.size(); i += 1 + frame) {
      const Pose written = systemPose(100 * frame + i, riggedJoints);
      const std::array<float, givenWeights> given{0.01f * static_cast<float>(i), -0.25f};
      engine_.writePose(pairs[i].pose, written);
      std::ranges::copy(given, must(engine_->writePoseWeights(pairs[i].pose)).begin());
      std::vector<MorphWeight> morphs;
      if (i % 4 == 1) morphs.push_back({1, 0.25f});
      setMorphs(pairs[i].instance, morphs);
      writePlain(pairs[i], rigs[i % 2], written, given, morphs);
    }
    engine_.submit();
    for (const Pair& pair : pairs) expectAlike(pair);
  }
}

TEST_F(CpuSceneRigTest, FiguresMayHaveRigs) {
  constexpr std::uint32_t given = 3;
  const std::uint32_t node = weightedNode(given);
  const PackedRig rig = riggedPose(6, given, node);
  const ClipsHandle bank = must(engine_->addClips(PackedClips(playedClips())));
  const RigHandle handle = must(engine_->addRig(PackedRig(rig)));
  std::vector<FigureHandle> figures;
  std::vector<Pair> pairs;
  for (std::uint32_t i = 0; i < 20; ++i) {
    figures.push_back(must(engine_->addFigure(bank, std::array{RigHandle(), handle})));
    pairs.push_back(add(must(engine_->pose(figures[i], 1)), Method::dualQuaternion));
  }
  for (std::uint32_t frame = 0; frame < 3; ++frame) {
    engine_.begin();
    for (std::uint32_t i = frame; i < pairs.size(); ++i) {
      const std::uint32_t play = (i + frame) % playCount;
      const FigurePlay played{figures[i], playedLayers(play)};
      must(engine_->play({&played, 1}));
      std::array<float, given> weights;
      must(sampleWeights(playedClips(), playedLayers(play), node, weights));
      writePlain(pairs[i], rig, playedPose(play, 1), weights, {});
    }
    engine_.submit();
    for (const Pair& pair : pairs) expectAlike(pair);
  }
}

// The figure plays on while the skin with the rig is hidden.
TEST_F(CpuSceneRigTest, ARigIsEvaluatedWhenItsSkinIsShownAgain) {
  constexpr std::uint32_t given = 3;
  const std::uint32_t node = weightedNode(given);
  const PackedRig rig = riggedPose(6, given, node);
  const ClipsHandle bank = must(engine_->addClips(PackedClips(playedClips())));
  const FigureHandle figure = must(
      engine_->addFigure(bank, std::array{RigHandle(), must(engine_->addRig(PackedRig(rig)))}));
  const Pair pair = add(must(engine_->pose(figure, 1)), Method::dualQuaternion);
  const std::uint32_t joints = playedClips().jointCount(0);
  must(engine_->addInstance({.mesh = engine_.addMesh(systemMesh(2, 40, joints)),
                             .pose = must(engine_->pose(figure, 0)),
                             .layout = plainLayout()}));
  const auto run = [&](bool isVisible, std::optional<std::uint32_t> play) {
    engine_.begin();
    must(engine_->change(InstanceChange{.instance = pair.instance, .visible = isVisible}));
    if (play) {
      const FigurePlay played{figure, playedLayers(*play)};
      must(engine_->play({&played, 1}));
      std::array<float, given> weights;
      must(sampleWeights(playedClips(), playedLayers(*play), node, weights));
      writePlain(pair, rig, playedPose(*play, 1), weights, {});
    }
    engine_.submit();
  };
  run(true, 0);
  expectAlike(pair);
  run(false, 1);
  run(true, {});
  expectAlike(pair);
}

// Otherwise it could not go back to the figure.
TEST_F(CpuSceneRigTest, AMeshWithOtherTargetsIsRefusedAwayFromTheFigure) {
  const ClipsHandle bank = must(engine_->addClips(PackedClips(playedClips())));
  const std::uint32_t joints = playedClips().jointCount(0);
  const MeshHandle three = engine_.addMesh(systemMesh(2, 40, joints, 4, 3)),
                   two = engine_.addMesh(systemMesh(2, 40, joints, 4, 2));
  const InstanceHandle instance =
      must(engine_->addInstance({.mesh = three,
                                 .pose = must(engine_->pose(must(engine_->addFigure(bank)), 0)),
                                 .layout = plainLayout(),
                                 .morphWriter = MorphWriter::clips,
                                 .weightsOf = weightedNode(3)}));
  must(engine_->change(
      InstanceChange{.instance = instance, .pose = must(engine_->addPose(joints))}));
  const Result<void> changed = engine_->change(InstanceChange{.instance = instance, .mesh = two});
  ASSERT_FALSE(changed.ok());
  EXPECT_EQ(changed.error().message,
            "the instance has 3 morph weights, which the CPU does not write, but its mesh has 2 "
            "targets");
}

TEST_F(CpuSceneRigTest, AFigureNeedsThePipelinesOfAllItsRigs) {
  const ClipsHandle bank = must(engine_->addClips(PackedClips(playedClips())));
  const RigHandle handle = must(engine_->addRig(riggedPose(6, 0)));
  const auto needsRigs = [&](std::span<const RigHandle> rigs, std::uint32_t skin) {
    const FigureHandle figure = must(engine_->addFigure(bank, rigs));
    const InstanceDescription instance{
        .mesh = mesh_, .pose = must(engine_->pose(figure, skin)), .layout = plainLayout()};
    return must(engine_->pipelineNeeds(instance)).rigs;
  };
  // The skin without a rig is sampled together with the other one.
  EXPECT_TRUE(needsRigs(std::array{RigHandle(), handle}, 0));
  EXPECT_TRUE(needsRigs(std::array{RigHandle(), handle}, 1));
  EXPECT_FALSE(needsRigs({}, 0));
}

TEST_F(CpuSceneRigTest, ARigThatReadsNoWeightsMayNameANodeThatHasSome) {
  const PackedRig rig = riggedPose(6, 0, weightedNode(4));
  const ClipsHandle bank = must(engine_->addClips(PackedClips(playedClips())));
  const RigHandle handle = must(engine_->addRig(PackedRig(rig)));
  std::vector<FigureHandle> figures;
  std::vector<Pair> pairs;
  for (std::uint32_t i = 0; i < 5; ++i) {
    figures.push_back(must(engine_->addFigure(bank, std::array{RigHandle(), handle})));
    pairs.push_back(add(must(engine_->pose(figures[i], 1)), Method::dualQuaternion));
  }
  engine_.begin();
  for (std::uint32_t i = 0; i < pairs.size(); ++i) {
    const FigurePlay played{figures[i], playedLayers(i)};
    must(engine_->play({&played, 1}));
    writePlain(pairs[i], rig, playedPose(i, 1), {}, {});
  }
  engine_.submit();
  for (const Pair& pair : pairs) expectAlike(pair);
}

TEST_F(CpuSceneRigTest, AnAbandonedFrameIsDrivenAgain) {
  const PackedRig rig = riggedPose(3);
  const RigHandle handle = must(engine_->addRig(PackedRig(rig)));
  const Pair pair = add(must(engine_->addPose(riggedJoints, {.rig = handle})), Method::linear);
  engine_.begin();
  engine_.abandon([] {});
  engine_.begin();
  const std::array<float, givenWeights> given{};
  writePlain(pair, rig, Pose(riggedJoints), given, {});
  engine_.submit();
  expectAlike(pair);
}

}  // namespace
}  // namespace dermis::test
