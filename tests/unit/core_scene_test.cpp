// The books of a scene without a device: what a plan lists, and what counts as done.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/scene.h"
#include "plan_commands.h"
#include "scene_meshes.h"

namespace dermis::test {
namespace {

SceneDescription smallScene() {
  SceneDescription description;
  description.meshCapacity = Capacity::fixed(1 << 16);
  description.jointCapacity = Capacity::fixed(256);
  description.outputCapacity = Capacity::fixed(1 << 16);
  description.instanceCapacity = Capacity::fixed(16);
  description.boundsCapacity = Capacity::fixed(16);
  description.limits.maxStorageBuffersPerStage = storageBuffersWanted;
  return description;
}

/// One instance of one mesh.
struct OneInstance {
  explicit OneInstance(bool isCulled = false, const SceneDescription& wanted = smallScene())
      : scene(*Scene::create(wanted)) {
    info.vertexCount = 100;
    info.requiredJoints = 4;
    info.maxInfluences = 4;
    info.byteSize = 4096;
    mesh = *scene.addMesh(info);
    pose = *scene.addPose(4);
    description.mesh = mesh;
    description.pose = pose;
    description.bounds = true;
    description.culledOnGpu = isCulled;
    instance = *scene.addInstance(description);
  }

  void plan(std::uint64_t frame, std::uint64_t completed) {
    must(scene.beginFrame(frame, completed));
    must(scene.plan(planned));
  }
  void record(std::uint64_t frame, std::uint64_t completed) {
    plan(frame, completed);
    must(scene.commit());
  }

  Scene scene;
  MeshInfo info;
  MeshHandle mesh;
  PoseHandle pose;
  InstanceDescription description;
  InstanceHandle instance;
  Plan planned;
};

std::string nameOf(Access accesses) {
  std::string name;
  const auto add = [&](Access read, Access write, const std::string& kind) {
    if (!includes(accesses, read | write)) return;
    if (!name.empty()) name += ", ";
    name += kind;
    if (!includes(accesses, write)) name += " read";
    if (!includes(accesses, read)) name += " write";
  };
  add(Access::computeRead, Access::computeWrite, "compute");
  add(Access::copyRead, Access::copyWrite, "copy");
  if (includes(accesses, Access::indirectRead)) name += ", indirect";
  if (includes(accesses, Access::hostRead)) name += "host";
  return name;
}

/// The kinds of a plan's commands, for copies and clears their buffers, and for barriers their
/// accesses.
std::vector<std::string> namesOf(const Plan& plan) {
  const auto roleName = [](BufferRole role) {
    switch (role) {
      case BufferRole::upload:
        return "upload";
      case BufferRole::tables:
        return "tables";
      case BufferRole::counters:
        return "counters";
      case BufferRole::history:
        return "history";
      case BufferRole::results:
        return "results";
      case BufferRole::readBack:
        return "read-back";
      default:
        return "output";
    }
  };
  std::vector<std::string> names;
  for (const Command& command : plan.commands()) {
    if (const auto* dispatch = std::get_if<DispatchCommand>(&command)) {
      const Kernel kernel = dispatch->variant.kernel;
      names.push_back(std::string(dispatch->indirectOffset ? "indirect " : "") +
                      (kernel == Kernel::palette ? "palette"
                       : kernel == Kernel::skin  ? "skin"
                       : kernel == Kernel::clear ? "clear"
                                                 : "visibility"));
    } else if (const auto* copy = std::get_if<CopyCommand>(&command)) {
      names.push_back(std::string(roleName(copy->from)) + " to " + roleName(copy->to));
    } else if (const auto* clear = std::get_if<ClearCommand>(&command)) {
      names.push_back(std::string("clear ") + roleName(clear->buffer));
    } else {
      const auto& barrier = std::get<BarrierCommand>(command);
      names.push_back(nameOf(barrier.before) + " before " + nameOf(barrier.after));
    }
  }
  return names;
}

TEST(Scene, AFrameUploadsConvertsSkinsAndReadsBack) {
  OneInstance one;
  one.plan(1, 0);
  EXPECT_EQ(
      namesOf(one.planned),
      (std::vector<std::string>{
          "compute, copy, indirect before compute, copy", "upload to tables",
          "copy write before compute", "palette", "clear", "compute write before compute", "skin",
          "compute write before copy read", "results to read-back", "copy write before host"}));
}

/// Every variant that the plans of one instance use, with and without active morph targets.
std::set<std::uint64_t> variantsOf(Scene& scene, InstanceHandle instance, std::uint32_t targets) {
  std::set<std::uint64_t> used;
  Plan plan;
  std::uint64_t frame = 0;
  for (const float weight : {0.f, 1.f}) {
    const MorphWeight morph{0, weight};
    InstanceChange change{.instance = instance, .teleports = true};
    if (targets != 0) change.morphs = std::span(&morph, 1);
    EXPECT_TRUE(scene.change(change).ok());
    ++frame;
    EXPECT_TRUE(scene.beginFrame(frame, frame - 1).ok());
    EXPECT_TRUE(scene.plan(plan).ok());
    for (const Variant& variant : plan.variants()) used.insert(variant.key());
    EXPECT_TRUE(scene.commit().ok());
  }
  return used;
}

// What is prepared for one instance is what its frames use, and no more.
TEST(Scene, TellsThePipelinesOfOneInstance) {
  SceneDescription description = smallScene();
  description.limits.texelBuffers = true;
  for (const Method method : allMethods) {
    for (const auto& [fewest, most] : {std::pair{0u, 0u},
                                       {1u, 1u},
                                       {1u, 2u},
                                       {2u, 3u},
                                       {3u, 3u},
                                       {1u, 4u},
                                       {4u, 4u},
                                       {2u, 9u}}) {
      for (std::uint32_t targets = 0; targets < 2; ++targets) {
        for (int choices = 0; choices < 8; ++choices) {
          Scene scene = *Scene::create(description);
          MeshInfo info;
          info.vertexCount = 100;
          info.requiredJoints = 4;
          info.minInfluences = fewest;
          info.maxInfluences = most;
          info.morphTargetCount = targets;
          info.hasCentersOfRotation = true;
          info.byteSize = 4096;
          InstanceDescription figure;
          figure.mesh = *scene.addMesh(info);
          figure.pose = *scene.addPose(4, {.mayScale = choices % 2 != 0});
          figure.method = method;
          figure.bounds = choices / 2 % 2 != 0;
          figure.culledOnGpu = choices / 4 != 0;
          const PipelineNeeds needs = *scene.pipelineNeeds(figure);
          std::set<std::uint64_t> foreseen;
          for (const Variant& variant : *everyVariant(needs, description.limits, {}))
            foreseen.insert(variant.key());
          const InstanceHandle instance = *scene.addInstance(figure);
          EXPECT_EQ(variantsOf(scene, instance, targets), foreseen)
              << methodName(method) << ", " << fewest << " to " << most << " influences, "
              << targets << " targets, choices " << choices;
        }
      }
    }
  }
  const Scene empty = *Scene::create(description);
  EXPECT_FALSE(empty.pipelineNeeds({}).ok());
}

TEST(Scene, RunsThatAreNotWholeWordsAreRefused) {
  OneInstance one(false);
  for (const auto& [layout, text] :
       {std::pair{VertexLayout{.positions = VertexFormat::float16x3}, "use float16x4"},
        {VertexLayout{.stride = 14}, "multiples of 4"}}) {
    InstanceDescription wrong = one.description;
    wrong.layout = layout;
    const Result<InstanceHandle> added = one.scene.addInstance(wrong);
    const Result<PipelineNeeds> needs = one.scene.pipelineNeeds(wrong);
    ASSERT_FALSE(added.ok() || needs.ok());
    for (const Error& error : {added.error(), needs.error()})
      EXPECT_NE(error.message.find(text), std::string::npos) << error.message;
  }
}

TEST(Scene, TheGpuChoosesBeforeItSkins) {
  OneInstance one(true);
  const std::vector<std::string> first{"compute, copy, indirect before compute, copy",
                                       "upload to tables",
                                       "clear counters",
                                       "clear history",  //
                                       "copy write before compute",
                                       "visibility",
                                       "compute write before compute",
                                       "visibility",  //
                                       "compute write before compute, indirect",
                                       "palette",
                                       "clear",  //
                                       "compute write before compute",
                                       "indirect skin",  //
                                       "compute write before copy read",
                                       "counters to read-back",
                                       "results to read-back",
                                       "copy write before host"};
  one.plan(1, 0);
  EXPECT_EQ(namesOf(one.planned), first);
  // History is cleared until a frame that does so is recorded, and never again.
  ASSERT_TRUE(one.scene.plan(one.planned).ok());
  EXPECT_EQ(namesOf(one.planned), first);
  ASSERT_TRUE(one.scene.commit().ok());
  one.plan(2, 1);
  EXPECT_EQ(std::ranges::count(namesOf(one.planned), "clear history"), 0);
  EXPECT_EQ(std::ranges::count(namesOf(one.planned), "clear counters"), 1);
}

// What other frames have written to the history before stays.
TEST(Scene, TheNewPartOfAHistoryThatHasGrownIsCleared) {
  SceneDescription description = smallScene();
  description.instanceCapacity = {16, 64};
  description.growth = {nullptr, [](void*, const BufferGrowth&) { return Result<void>(); }};
  OneInstance one(true, description);
  one.record(1, 0);
  const std::uint64_t before = one.planned.buffer(BufferRole::history).size;
  InstanceDescription next = one.description;
  next.bounds = false;
  for (int i = 0; i < 16; ++i) ASSERT_TRUE(one.scene.addInstance(next).ok());
  one.record(2, 1);
  const std::uint64_t size = one.planned.buffer(BufferRole::history).size;
  EXPECT_GT(size, before);
  std::uint32_t clears = 0;
  for (const Command& command : one.planned.commands()) {
    const auto* clear = std::get_if<ClearCommand>(&command);
    if (clear == nullptr || clear->buffer != BufferRole::history) continue;
    ++clears;
    EXPECT_EQ(clear->offset, before);
    EXPECT_EQ(clear->offset + clear->size, size);
  }
  EXPECT_EQ(clears, 1u);
  one.record(3, 2);
  EXPECT_EQ(std::ranges::count(namesOf(one.planned), "clear history"), 0);
}

TEST(Scene, WhatIsNotCommittedIsPlannedAgain) {
  OneInstance one;
  one.plan(1, 0);
  const std::vector<std::string> all = namesOf(one.planned);
  one.plan(2, 0);
  EXPECT_EQ(namesOf(one.planned), all);
  EXPECT_EQ(one.scene.output(one.instance)->size, 0u);
  ASSERT_TRUE(one.scene.commit().ok());
  EXPECT_EQ(one.scene.output(one.instance)->size, 100u * 12u);
  EXPECT_EQ(one.scene.statistics().lastFrame.skinnedInstances, 1u);
  one.plan(3, 2);
  EXPECT_TRUE(one.planned.commands().empty());
}

TEST(Scene, AnAbandonedFrameIsPlannedAgain) {
  OneInstance one;
  one.plan(1, 0);
  const std::vector<std::string> all = namesOf(one.planned);
  ASSERT_TRUE(one.scene.commit().ok());
  EXPECT_EQ(one.scene.skinnedInstances().size(), 1u);
  ASSERT_TRUE(one.scene.abandonFrame(1).ok());
  EXPECT_EQ(one.scene.output(one.instance)->size, 0u);
  EXPECT_TRUE(one.scene.skinnedInstances().empty());
  EXPECT_EQ(one.scene.statistics().lastFrame.skinnedInstances, 0u);
  ASSERT_TRUE(one.scene.plan(one.planned).ok()) << "in the same frame";
  EXPECT_EQ(namesOf(one.planned), all);
  ASSERT_TRUE(one.scene.commit().ok());
  ASSERT_TRUE(one.scene.abandonFrame(1).ok());
  one.plan(2, 0);
  EXPECT_EQ(namesOf(one.planned), all);
  ASSERT_TRUE(one.scene.commit().ok());
  EXPECT_EQ(one.scene.output(one.instance)->size, 100u * 12u);
  one.plan(3, 2);
  EXPECT_TRUE(one.planned.commands().empty());
}

// The GPU's history was not cleared either.
TEST(Scene, AnAbandonedFrameClearsNothing) {
  OneInstance one(true);
  for (std::uint64_t frame = 1; frame < 4; ++frame) {
    one.plan(frame, 0);
    EXPECT_EQ(std::ranges::count(namesOf(one.planned), "clear history"), 1) << frame;
    ASSERT_TRUE(one.scene.commit().ok());
    if (frame < 3) {
      ASSERT_TRUE(one.scene.abandonFrame(frame).ok());
    }
  }
  one.plan(4, 0);
  EXPECT_EQ(std::ranges::count(namesOf(one.planned), "clear history"), 0);
}

/// A moving instance, shown and hidden by `change` or by `setVisibility`.
class SceneVisibility : public ::testing::TestWithParam<bool> {
 protected:
  SceneVisibility() {
    InstanceDescription description = one_.description;
    description.pose = pose_ = *scene_.addPose(4);
    description.bounds = false;
    description.layout.motion = Motion::kept;
    instance_ = *scene_.addInstance(description);
  }
  void show(bool isVisible) {
    const InstanceVisibility visibility{instance_, isVisible, 1};
    ASSERT_TRUE((GetParam() ? scene_.setVisibility({&visibility, 1})
                            : scene_.change({.instance = instance_, .visible = isVisible}))
                    .ok());
  }
  void begin() {
    ++frame_;
    ASSERT_TRUE(scene_.beginFrame(frame_, frame_ - 1).ok());
  }
  void record() {
    ASSERT_TRUE(scene_.plan(one_.planned).ok());
    ASSERT_TRUE(scene_.commit().ok()) << frame_;
  }
  /// A frame in which its pose changes.
  void move() {
    begin();
    ASSERT_TRUE(scene_.writePose(pose_).ok());
    record();
  }
  void abandon() { ASSERT_TRUE(scene_.abandonFrame(frame_).ok()); }
  bool isSkinned() const { return contains(scene_.skinnedInstances()); }
  bool isSettled() const { return contains(scene_.settledInstances()); }
  bool contains(std::span<const InstanceHandle> list) const {
    return std::ranges::count(list, instance_) == 1;
  }

  OneInstance one_;
  Scene& scene_ = one_.scene;
  PoseHandle pose_;
  InstanceHandle instance_;
  std::uint64_t frame_ = 0;
};

// Its vertices are those of the frame in which it moved.
TEST_P(SceneVisibility, WhatIsShownAgainUnchangedSettles) {
  move();
  move();
  for (const bool isVisible : {false, true}) {
    begin();
    show(isVisible);
    record();
    EXPECT_FALSE(isSkinned());
    EXPECT_EQ(isSettled(), isVisible);
  }
  begin();
  record();
  EXPECT_FALSE(isSettled()) << "once";
}

// The frame in which it was hidden was never displayed: it moved in the frame before, and rests.
TEST_P(SceneVisibility, WhatWasHiddenInAnAbandonedFrameOnlySettles) {
  move();
  move();
  begin();
  show(false);
  record();
  abandon();
  show(true);
  record();
  EXPECT_TRUE(isSettled());
}

// Nor was a frame displayed before which it was shown and hidden again.
TEST_P(SceneVisibility, WhatWasShownBetweenFramesComesBackAsWhatWasNot) {
  for (const bool isShownBetween : {false, true}) {
    move();
    move();
    begin();
    show(false);
    record();
    begin();
    if (isShownBetween) {
      show(true);
      show(false);
    }
    record();
    show(true);
    abandon();
    ASSERT_TRUE(scene_.writePose(pose_).ok());
    record();
    EXPECT_TRUE(isSkinned());
    begin();
    record();
    EXPECT_FALSE(isSettled()) << "its motion was restarted";
  }
}

INSTANTIATE_TEST_SUITE_P(Calls, SceneVisibility, ::testing::Bool(), [](const auto& call) {
  return std::string(call.param ? "SetVisibility" : "Change");
});

TEST(Scene, NothingIsDueBetweenFrames) {
  OneInstance one;
  EXPECT_FALSE(*one.scene.isDue(one.instance));
  must(one.scene.beginFrame(1, 0));
  EXPECT_TRUE(*one.scene.isDue(one.instance));
  must(one.scene.plan(one.planned));
  must(one.scene.commit());
  EXPECT_FALSE(*one.scene.isDue(one.instance));
}

TEST(Scene, AMeshWithOtherTargetsTakesNoMorphWeights) {
  OneInstance one;
  std::vector<MeshHandle> meshes;
  for (const std::uint32_t targets : {5u, 2u, 5u}) {
    MeshInfo info = one.info;
    info.morphTargetCount = targets;
    meshes.push_back(*one.scene.addMesh(info));
  }
  const auto isMorphed = [&](std::uint64_t frame) {
    one.record(frame, frame - 1);
    for (const PlannedDispatch& dispatch : dispatchesOf(one.planned)) {
      if (dispatch.variant.kernel == Kernel::skin) return dispatch.variant.morphs;
    }
    ADD_FAILURE() << "not skinned";
    return false;
  };
  for (const std::uint32_t target : {4u, 0u}) {
    const MorphWeight weight{target, 1};
    const std::uint64_t frame = target == 4 ? 1 : 4;
    must(one.scene.change(
        {.instance = one.instance, .mesh = meshes[0], .morphs = std::span(&weight, 1)}));
    EXPECT_TRUE(isMorphed(frame));
    must(one.scene.change({.instance = one.instance, .mesh = meshes[2]}));
    EXPECT_TRUE(isMorphed(frame + 1)) << "they have as many";
    must(one.scene.change({.instance = one.instance, .mesh = meshes[1]}));
    EXPECT_FALSE(isMorphed(frame + 2));
  }
}

TEST(Scene, WhatIsRemovedIsFreeWhenItsFrameIsComplete) {
  OneInstance one;
  one.record(1, 0);
  must(one.scene.removeInstance(one.instance));
  must(one.scene.removePose(one.pose));
  EXPECT_GT(one.scene.statistics().palettes.used, 0u);
  EXPECT_GT(one.scene.statistics().outputs.used, 0u);
  one.record(2, 1);
  must(one.scene.beginFrame(3, 2));
  EXPECT_EQ(one.scene.statistics().palettes.used, 0u);
  EXPECT_EQ(one.scene.statistics().outputs.used, 0u);
  EXPECT_TRUE(one.scene.addPose(256).ok()) << "all joints";
}

// Its mesh was changed after a frame that is then abandoned: two places are free, not one.
TEST(Scene, ThePlaceOfAnAbandonedFrameIsFree) {
  OneInstance one;
  const MeshHandle other = *one.scene.addMesh(one.info);
  one.record(1, 0);
  must(one.scene.change({.instance = one.instance, .mesh = other}));
  must(one.scene.abandonFrame(1));
  must(one.scene.plan(one.planned));
  must(one.scene.commit());
  must(one.scene.beginFrame(2, 1));
  EXPECT_EQ(one.scene.statistics().outputs.used, 100u * 12u);
}

TEST(Scene, PosesHaveUpToTheMaximumOfJoints) {
  SceneDescription description = smallScene();
  description.jointCapacity = Capacity::fixed(maxPoseJoints);
  OneInstance one;
  Scene scene = *Scene::create(description);
  EXPECT_TRUE(scene.addPose(maxPoseJoints).ok());
  for (const std::uint32_t count : {0u, maxPoseJoints + 1}) {
    const Result<PoseHandle> refused = scene.addPose(count);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().message, "a pose has 1 to " + std::to_string(maxPoseJoints) +
                                           " joints, not " + std::to_string(count));
  }
}

// If the engine supplies the buffers, palettes cannot grow.
TEST(Scene, PalettesSufficeForAllJoints) {
  SceneDescription description = smallScene();
  description.jointCapacity = Capacity::fixed(9);
  OneInstance one(false, description);
  InstanceDescription next = one.description;
  MeshInfo info = one.info;
  info.requiredJoints = 1;
  next.mesh = *one.scene.addMesh(info);
  for (std::uint32_t joint = 4; joint < 9; ++joint) {
    next.pose = *one.scene.addPose(1);
    const Result<InstanceHandle> added = one.scene.addInstance(next);
    EXPECT_TRUE(added.ok()) << added.error().message;
  }
}

// Removed palettes leave two ranges of 3 units; the new one needs 5.
TEST(Scene, PalettesMayFindOnlyHoles) {
  SceneDescription description = smallScene();
  description.jointCapacity = Capacity::fixed(6);  // 30 units, 17 of them taken by `one`
  OneInstance one(false, description);
  InstanceDescription next = one.description;
  MeshInfo info = one.info;
  info.requiredJoints = 1;
  next.mesh = *one.scene.addMesh(info);
  one.record(1, 0);
  must(one.scene.beginFrame(2, 1));
  std::array<std::vector<InstanceHandle>, 2> instances;
  std::array<PoseHandle, 2> poses;
  for (std::size_t i = 0; i < 2; ++i) poses[i] = *one.scene.addPose(1, {.mayScale = false});
  for (const Method method : {Method::linear, Method::dualQuaternion}) {
    next.method = method;
    for (std::size_t i = 0; i < 2; ++i) {
      next.pose = poses[i];
      instances[i].push_back(*one.scene.addInstance(next));
    }
  }
  for (const InstanceHandle instance : instances[0]) must(one.scene.removeInstance(instance));
  must(one.scene.removePose(poses[0]));
  must(one.scene.plan(one.planned));
  must(one.scene.commit());
  must(one.scene.beginFrame(3, 2));
  next.pose = *one.scene.addPose(1, {.mayScale = true});
  EXPECT_EQ(
      one.scene.addInstance(next).error().message,
      "pose 1 needs 5 units of 16 bytes of palettes for dual_quaternion, but of 30 units only "
      "7 are free; the largest free range has 3");
}

TEST(Scene, OnlyTheFrameCommittedLastIsAbandoned) {
  OneInstance one;
  const auto expectRefused = [&](std::uint64_t frame) {
    const Result<void> abandoned = one.scene.abandonFrame(frame);
    ASSERT_FALSE(abandoned.ok());
    EXPECT_EQ(abandoned.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(abandoned.error().message.find("frame " + std::to_string(frame)), std::string::npos);
  };
  expectRefused(0);
  one.plan(1, 0);
  expectRefused(1);
  ASSERT_TRUE(one.scene.commit().ok());
  expectRefused(2);
  ASSERT_TRUE(one.scene.beginFrame(2, 0).ok());
  expectRefused(1);
  expectRefused(2);
  ASSERT_TRUE(one.scene.plan(one.planned).ok());
  ASSERT_TRUE(one.scene.commit().ok());
  EXPECT_TRUE(one.scene.abandonFrame(2).ok());
  expectRefused(2);
}

// Otherwise an engine that cannot present for a while could not begin another frame; and what a
// frame in flight reads must not be overwritten.
TEST(Scene, AbandonedFramesAreNotInFlight) {
  OneInstance one;
  const auto place = [&](std::uint64_t frame) {
    EXPECT_TRUE(one.scene.beginFrame(frame, 0).ok()) << frame;
    const std::uint64_t offset = one.scene.writePose(one.pose)->offset;
    EXPECT_TRUE(one.scene.plan(one.planned).ok());
    EXPECT_TRUE(one.scene.commit().ok());
    return offset;
  };
  const std::uint64_t first = place(1);
  const std::uint64_t second = place(2);
  EXPECT_NE(first, second);
  ASSERT_TRUE(one.scene.abandonFrame(2).ok());
  for (std::uint64_t frame = 3; frame < 8; ++frame) {
    EXPECT_EQ(place(frame), second) << "frame 1 still reads its pose";
    ASSERT_TRUE(one.scene.abandonFrame(frame).ok());
  }
  EXPECT_EQ(place(8), second);
  EXPECT_EQ(one.scene.beginFrame(9, 0).error().message,
            "frame 9 begins while the GPU has completed frame 0: more frames are in flight than "
            "framesInFlight, which is 2; if one of them was recorded and not submitted, call "
            "abandonFrame");
  EXPECT_TRUE(one.scene.beginFrame(9, 1).ok());
}

// A change between plan and commit would count as done.
TEST(Scene, AChangedSceneIsNotCommitted) {
  const std::vector<std::function<void(OneInstance&)>> changes{
      [](OneInstance& one) { EXPECT_TRUE(one.scene.removeInstance(one.instance).ok()); },
      [](OneInstance& one) { EXPECT_TRUE(one.scene.writePose(one.pose).ok()); },
      [](OneInstance& one) {
        EXPECT_TRUE(one.scene.change({.instance = one.instance, .visible = false}).ok());
      },
      [](OneInstance& one) {
        EXPECT_TRUE(one.scene.change({.instance = one.instance, .teleports = true}).ok());
      },
      [](OneInstance& one) { EXPECT_TRUE(one.scene.beginFrame(2, 0).ok()); },
      [](OneInstance& one) { EXPECT_EQ(one.scene.compact(1000), 0u); }};
  for (const auto& change : changes) {
    OneInstance one;
    EXPECT_FALSE(one.scene.commit().ok()) << "nothing is planned";
    one.plan(1, 0);
    change(one);
    const Result<void> committed = one.scene.commit();
    ASSERT_FALSE(committed.ok());
    EXPECT_EQ(committed.error().code, ErrorCode::invalidArgument);
    EXPECT_EQ(committed.error().message,
              "there is no plan to commit, or the scene has changed since");
    ASSERT_TRUE(one.scene.plan(one.planned).ok());
    EXPECT_TRUE(one.scene.commit().ok());
    EXPECT_FALSE(one.scene.commit().ok()) << "once";
  }
}

TEST(Scene, ReadsBackOnlyWhatWasRecorded) {
  OneInstance one;
  one.record(1, 0);
  ASSERT_TRUE(one.scene.beginFrame(2, 1).ok());
  std::vector<std::byte> bytes(one.scene.buffer(BufferRole::readBack).size);
  for (const std::uint64_t frame : {0u, 2u}) {
    EXPECT_EQ(one.scene.readBack(frame, bytes).error().message,
              "frame " + std::to_string(frame) +
                  " cannot be read back: it is not one of the last 2 frames that were committed");
  }
  EXPECT_EQ(one.scene.readBack(1, std::span(bytes).first(40)).error().message,
            "the read-back buffer of a frame has 40 bytes, fewer than the 48 that Plan::buffer "
            "returned");
  EXPECT_FALSE(one.scene.bounds(one.instance)->has_value());
  EXPECT_TRUE(one.scene.readBack(1, bytes).ok());
  EXPECT_TRUE(one.scene.bounds(one.instance)->has_value());
}

// Bounds of a frame that has not been displayed, or whose results are not read yet, are not there.
TEST(Scene, BoundsAreThoseOfAFrameThatWasReadBack) {
  OneInstance one;
  std::vector<std::byte> bytes(one.scene.buffer(BufferRole::readBack).size);
  const InstanceHandle second = *one.scene.addInstance(one.description);
  one.record(1, 0);
  must(one.scene.beginFrame(2, 1));
  must(one.scene.readBack(1, bytes));
  EXPECT_TRUE(one.scene.bounds(one.instance)->has_value());
  // Two others with their results.
  for (const InstanceHandle instance : {one.instance, second})
    must(one.scene.removeInstance(instance));
  const InstanceHandle hidden = *one.scene.addInstance(one.description);
  const InstanceHandle shown = *one.scene.addInstance(one.description);
  must(one.scene.plan(one.planned));
  must(one.scene.commit());
  must(one.scene.abandonFrame(2));
  must(one.scene.change({.instance = hidden, .visible = false}));
  must(one.scene.plan(one.planned));
  must(one.scene.commit());
  one.record(3, 2);  // has no results
  must(one.scene.beginFrame(4, 3));
  must(one.scene.readBack(3, bytes));
  EXPECT_FALSE(one.scene.bounds(shown)->has_value()) << "only frame 2 has them";
  EXPECT_FALSE(one.scene.bounds(hidden)->has_value()) << "it was never displayed";
}

// There is no binding for them.
TEST(Scene, DevicesWithFourBuffersHaveNoResults) {
  SceneDescription description = smallScene();
  EXPECT_GT(Scene::buffer(description, BufferRole::results)->size, 0u);
  description.limits.maxStorageBuffersPerStage = 4;
  EXPECT_EQ(Scene::buffer(description, BufferRole::results)->size, 0u);
  EXPECT_EQ(Scene::create(description)->buffer(BufferRole::results).size, 0u);
}

/// Instances with a box each, in frames that an engine reads back or forgets to.
struct SeveralInstances : OneInstance {
  explicit SeveralInstances(std::size_t count) {
    must(scene.removeInstance(instance));
    for (std::size_t index = 0; index < count; ++index) all.push_back(add());
  }
  InstanceHandle add() {
    InstanceDescription added = description;
    added.pose = *scene.addPose(4);
    return must(scene.addInstance(added));
  }
  void skin(InstanceHandle which) {
    must(scene.change({.instance = which, .teleports = true}));
    must(scene.plan(planned));
    must(scene.commit());
  }
  Result<void> readBack(std::uint64_t frame) {
    return scene.readBack(frame, std::vector<std::byte>(4096));
  }
  bool hasBox(InstanceHandle which) const { return must(scene.bounds(which)).has_value(); }

  std::vector<InstanceHandle> all;
};

// The result of the last instance was never read, and is beyond all that were.
TEST(Scene, AFrameThatIsNotReadBackHasNoBoxes) {
  SeveralInstances several(12);
  several.record(1, 0);
  must(several.scene.beginFrame(2, 1));
  several.skin(several.all.front());
  must(several.scene.beginFrame(3, 2));
  must(several.readBack(2));
  EXPECT_TRUE(several.hasBox(several.all.front()));
  for (std::size_t index = 1; index < several.all.size(); ++index)
    EXPECT_FALSE(several.hasBox(several.all[index])) << index;
  several.skin(several.all.back());
  must(several.scene.beginFrame(4, 3));
  must(several.readBack(3));
  EXPECT_TRUE(several.hasBox(several.all.back()));
}

// An instance that is new may get the number of a removed one, whose box was read.
TEST(Scene, ABoxIsNeverThatOfARemovedInstance) {
  SeveralInstances several(2);
  several.record(1, 0);
  must(several.scene.beginFrame(2, 1));
  must(several.readBack(1));
  must(several.scene.removeInstance(several.all[0]));
  const InstanceHandle added = several.add();
  several.skin(added);  // is not read back
  must(several.scene.beginFrame(3, 2));
  several.skin(several.all[1]);
  must(several.scene.beginFrame(4, 3));
  must(several.readBack(3));
  EXPECT_TRUE(several.hasBox(several.all[1]));
  EXPECT_FALSE(several.hasBox(added));
}

TEST(Scene, FramesAreReadBackInOrderOnceTheyAreComplete) {
  SeveralInstances several(1);
  several.record(1, 0);
  must(several.scene.beginFrame(2, 0));
  several.skin(several.all[0]);
  const auto expectRefused = [&](std::uint64_t frame, const std::string& text) {
    const Result<void> read = several.readBack(frame);
    ASSERT_FALSE(read.ok()) << frame;
    EXPECT_EQ(read.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(read.error().message.find(text), std::string::npos) << read.error().message;
  };
  expectRefused(2, "which frames up to 0 are");
  must(several.scene.beginFrame(3, 2));
  must(several.readBack(2));
  expectRefused(1, "newer than the last that was, 2");
  expectRefused(2, "newer than the last that was, 2");
  EXPECT_EQ(several.scene.statistics().lastCompletedFrame.frame, 2u);
}

// The engine's visibility buffer would be too small for the next frame.
TEST(Scene, AnInstanceThatIsRefusedLeavesNothingBehind) {
  SceneDescription description = smallScene();
  description.growth = {nullptr, [](void*, const BufferGrowth& growth) -> Result<void> {
                          if (growth.role != BufferRole::palettes) return {};
                          return Error{ErrorCode::vulkanError, "no palettes"};
                        }};
  description.instanceCapacity = {1};
  description.boundsCapacity = {1, 1};
  description.outputCapacity = {1200, 1200};
  description.jointCapacity = {5};
  Scene scene = must(Scene::create(description));
  InstanceDescription instance;
  MeshInfo info;
  info.vertexCount = 50;
  info.maxInfluences = info.requiredJoints = 1;
  info.byteSize = 4096;
  instance.mesh = must(scene.addMesh(info));
  instance.pose = must(scene.addPose(1));
  must(scene.addInstance(instance));
  const auto expectRefused = [&](InstanceDescription wanted, std::uint32_t joints,
                                 std::uint32_t vertices, const std::string& text) {
    wanted.pose = must(scene.addPose(joints));
    info.vertexCount = vertices;
    wanted.mesh = must(scene.addMesh(info));
    const SceneStatistics before = scene.statistics();
    const std::uint32_t slots = scene.visibilityCount();
    const Result<InstanceHandle> added = scene.addInstance(wanted);
    ASSERT_FALSE(added.ok()) << text;
    EXPECT_NE(added.error().message.find(text), std::string::npos) << added.error().message;
    EXPECT_EQ(scene.visibilityCount(), slots) << text;
    EXPECT_EQ(scene.statistics().outputs.used, before.outputs.used) << text;
    EXPECT_EQ(scene.statistics().palettes.used, before.palettes.used) << text;
  };
  expectRefused(instance, 1, 51, "the instance takes 612 bytes");
  instance.bounds = true;
  expectRefused(instance, 50, 50, "no palettes");
  // The result is free again.
  must(scene.addInstance(instance));
  instance.layout.positions = VertexFormat::float16x4;
  expectRefused(instance, 1, 1, "the maximum of boundsCapacity");
}

// Instances of several strides, of which many go. `compact` moves at most what it may, and ends
// only once no instance fits a gap before it.
TEST(Scene, CompactionFillsEveryGapThatFits) {
  OneInstance one;
  std::mt19937 random(3);
  struct Shown {
    InstanceHandle handle;
    std::uint32_t stride;
  };
  std::vector<Shown> all;
  Scene& scene = one.scene = must(Scene::create([] {
    SceneDescription description = smallScene();
    description.instanceCapacity = Capacity::fixed(400);
    return description;
  }()));
  const PoseHandle pose = must(scene.addPose(4));
  std::vector<MeshHandle> meshes;
  for (std::uint32_t vertices = 1; vertices < 8; ++vertices) {
    MeshInfo info;
    info.byteSize = 512;
    info.vertexCount = vertices;
    meshes.push_back(must(scene.addMesh(info)));
  }
  for (int count = 0; count < 400; ++count) {
    InstanceDescription description;
    description.mesh = meshes[random() % meshes.size()];
    description.pose = pose;
    description.layout.stride = std::array{12u, 20u, 28u, 44u}[random() % 4];
    all.push_back({must(scene.addInstance(description)), description.layout.stride});
  }
  one.record(1, 0);
  std::ranges::shuffle(all, random);
  for (; all.size() > 150; all.pop_back()) must(scene.removeInstance(all.back().handle));
  std::uint64_t frame = 1, moved = 1;
  for (; moved != 0; ++frame) {
    must(scene.beginFrame(frame + 1, frame));
    EXPECT_EQ(scene.compact(0), 0u);
    EXPECT_EQ(scene.compact(11), 0u) << "less than any instance has";
    moved = scene.compact(1000);
    EXPECT_LE(moved, 1000u);
    must(scene.plan(one.planned));
    EXPECT_EQ(moved != 0, !one.planned.commands().empty());
    must(scene.commit());
    EXPECT_EQ(scene.statistics().lastFrame.movedBytes, moved);
  }
  EXPECT_GT(frame, 5u);
  std::map<std::uint64_t, Shown> byOffset;
  for (const Shown& shown : all) byOffset[must(scene.output(shown.handle)).offset] = shown;
  ASSERT_EQ(byOffset.size(), all.size());
  std::vector<std::pair<std::uint64_t, std::uint64_t>> gaps;  // begin, end
  std::uint64_t end = 0;
  for (const auto& [offset, shown] : byOffset) {
    const std::uint64_t size = must(scene.output(shown.handle)).size;
    ASSERT_GE(offset, end);
    gaps.emplace_back(end, offset);
    end = offset + size;
    for (const auto& [begin, gapEnd] : gaps) {
      const std::uint64_t first = (begin + shown.stride - 1) / shown.stride * shown.stride;
      EXPECT_GT(first + size, gapEnd) << "the instance at " << offset << " fits at " << first;
    }
  }
}

// An instance whose move is not recorded yet stays where it goes. Moved twice, it would keep the
// place between.
TEST(Scene, CompactionMovesEachInstanceOnceInAFrame) {
  OneInstance one;
  Scene& scene = one.scene = must(Scene::create(smallScene()));
  const PoseHandle pose = must(scene.addPose(4));
  std::vector<InstanceHandle> instances;
  for (const std::uint32_t vertices : {5u, 1u, 2u, 1u, 2u}) {
    MeshInfo info;
    info.byteSize = 512;
    info.vertexCount = vertices;
    InstanceDescription description;
    description.mesh = must(scene.addMesh(info));
    description.pose = pose;
    instances.push_back(must(scene.addInstance(description)));
  }
  one.record(1, 0);
  must(scene.removeInstance(instances[0]));
  must(scene.removeInstance(instances[2]));
  must(scene.beginFrame(2, 1));
  EXPECT_EQ(scene.compact(1000), 12u + 12u + 24u);
  EXPECT_EQ(scene.compact(1000), 0u);
  must(scene.plan(one.planned));
  must(scene.commit());
  must(scene.beginFrame(3, 2));
  EXPECT_EQ(scene.statistics().outputs.used, 12u + 12u + 24u);
}

/// The version of the only candidate of a plan.
std::uint32_t versionOf(const Plan& plan) {
  std::vector<std::uint32_t> words(plan.buffer(BufferRole::tables).size / 4);
  must(writeTables(plan, std::as_writable_bytes(std::span(words))));
  for (const PlannedDispatch& dispatch : dispatchesOf(plan)) {
    if (dispatch.variant.kernel != Kernel::visibility) continue;
    const auto push = abi::load<abi::VisibilityPush>(dispatch.constants, 0);
    return abi::load<abi::CandidateRecord>(words, push.candidates).version;
  }
  return 0;
}

// If it did, the GPU would skin the instance in the next frame, although it is not due.
TEST(Scene, APlanThatIsNotExecutedLeavesNoVersionBehind) {
  for (const bool abandons : {false, true}) {
    OneInstance one(true);
    must(one.scene.change({.instance = one.instance, .updateInterval = 4}));
    one.record(1, 0);
    const std::uint32_t executed = versionOf(one.planned);
    must(one.scene.beginFrame(4, 1));
    must(one.scene.writePose(one.pose));
    EXPECT_TRUE(must(one.scene.isDue(one.instance)));
    must(one.scene.plan(one.planned));
    EXPECT_NE(versionOf(one.planned), executed);
    if (abandons) {
      must(one.scene.commit());
      must(one.scene.abandonFrame(4));
    }
    must(one.scene.change({.instance = one.instance, .updateInterval = 1000}));
    EXPECT_FALSE(must(one.scene.isDue(one.instance)));
    must(one.scene.plan(one.planned));
    EXPECT_EQ(versionOf(one.planned), executed) << abandons;
    must(one.scene.change({.instance = one.instance, .updateInterval = 1}));
    must(one.scene.plan(one.planned));
    EXPECT_NE(versionOf(one.planned), executed) << "it is still to be skinned";
  }
}

TEST(Scene, BudgetsThatMakeNoSenseAreRefusedByName) {
  const auto expectRefused = [](const SceneDescription& description, ErrorCode code,
                                const std::string& text) {
    const Result<Scene> scene = Scene::create(description);
    ASSERT_FALSE(scene.ok()) << text;
    EXPECT_EQ(scene.error().code, code) << scene.error().message;
    EXPECT_NE(scene.error().message.find(text), std::string::npos) << scene.error().message;
  };
  SceneDescription bad = smallScene();
  bad.framesInFlight = 0;
  expectRefused(bad, ErrorCode::invalidArgument, "framesInFlight is 0");
  bad = smallScene();
  bad.outputCapacity = Capacity::fixed(0);
  expectRefused(bad, ErrorCode::invalidArgument, "outputCapacity has a maximum of 0");
  bad = smallScene();
  bad.limits.maxStorageBufferRange = 65536;
  bad.jointCapacity = Capacity::fixed(1000);
  expectRefused(bad, ErrorCode::limitExceeded, "jointCapacity");
  bad = smallScene();
  bad.framesInFlight = 0xffffffffu;
  bad.jointCapacity =
      Capacity::fixed(bad.framesInFlight);  // 48 times their product is more than 2^64
  expectRefused(bad, ErrorCode::limitExceeded, "framesInFlight");
  bad = smallScene();
  bad.tuning.workgroupSize = 3;
  expectRefused(bad, ErrorCode::invalidArgument, "Tuning::workgroupSize");
  bad = smallScene();
  bad.limits.maxWorkgroupCountX = 0;
  expectRefused(bad, ErrorCode::invalidArgument, "maxWorkgroupCountX and Y must be at least 1");
  bad = smallScene();
  bad.limits.maxStorageBufferRange = 1000;
  expectRefused(bad, ErrorCode::invalidArgument, "maxStorageBufferRange must be at least 1024");
  bad = smallScene();
  bad.limits.minStorageBufferOffsetAlignment = 48;
  expectRefused(bad, ErrorCode::invalidArgument, "must be a power of two");
  bad = smallScene();
  bad.outputOffset = 2;
  expectRefused(bad, ErrorCode::invalidArgument, "the scene's outputOffset");
}

}  // namespace
}  // namespace dermis::test
