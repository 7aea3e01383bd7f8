// The books of a scene without a device: what a plan lists, and what counts as done.

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
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
  explicit OneInstance(bool isCulled = false) {
    MeshInfo info;
    info.vertexCount = 100;
    info.requiredJoints = 4;
    info.maxInfluences = 4;
    info.byteSize = 4096;
    mesh = *scene.addMesh(info);
    pose = *scene.addPose(4);
    InstanceDescription description;
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

  Scene scene = *Scene::create(smallScene());
  MeshHandle mesh;
  PoseHandle pose;
  InstanceHandle instance;
  Plan planned;
};

/// The kinds of a plan's commands, and for copies and clears their buffers.
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
      names.emplace_back("barrier");
    }
  }
  return names;
}

TEST(Scene, AFrameUploadsConvertsSkinsAndReadsBack) {
  OneInstance one;
  one.plan(1, 0);
  EXPECT_EQ(
      namesOf(one.planned),
      (std::vector<std::string>{"barrier", "upload to tables", "barrier", "palette", "clear",
                                "barrier", "skin", "barrier", "results to read-back", "barrier"}));
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
  description.limits.texelBuffers = description.limits.shaderInt64 = true;
  description.limits.scalarBlockLayout = true;
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
          for (const Variant& variant : *everyVariant(needs, description.limits, {})) {
            // Palettes of dual quaternions may be for the engine's shaders alone.
            const bool isForShaders = (method == Method::linear || method == Method::logMatrix) &&
                                      variant.kernel == Kernel::palette &&
                                      variant.method == Method::dualQuaternion;
            if (!isForShaders) foreseen.insert(variant.key());
          }
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

TEST(Scene, TheGpuChoosesBeforeItSkins) {
  OneInstance one(true);
  const std::vector<std::string> first{"barrier",
                                       "upload to tables",
                                       "clear counters",
                                       "clear history",  //
                                       "barrier",
                                       "visibility",
                                       "barrier",
                                       "visibility",  //
                                       "barrier",
                                       "palette",
                                       "clear",  //
                                       "barrier",
                                       "indirect skin",  //
                                       "barrier",
                                       "counters to read-back",
                                       "results to read-back",
                                       "barrier"};
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

// The frame in which it was hidden was never displayed: it moved in the frame before, and rests.
TEST(Scene, WhatWasHiddenInAnAbandonedFrameOnlySettles) {
  OneInstance one;
  InstanceDescription description;
  description.mesh = one.mesh;
  description.pose = *one.scene.addPose(4);
  description.layout.motion = Motion::kept;
  const InstanceHandle moving = *one.scene.addInstance(description);
  const auto runFrame = [&](std::uint64_t frame) {
    ASSERT_TRUE(one.scene.plan(one.planned).ok());
    ASSERT_TRUE(one.scene.commit().ok()) << frame;
  };
  for (std::uint64_t frame = 1; frame < 3; ++frame) {
    ASSERT_TRUE(one.scene.beginFrame(frame, frame - 1).ok());
    ASSERT_TRUE(one.scene.writePose(description.pose).ok());
    runFrame(frame);
  }
  ASSERT_TRUE(one.scene.beginFrame(3, 2).ok());
  ASSERT_TRUE(one.scene.change({.instance = moving, .visible = false}).ok());
  runFrame(3);
  ASSERT_TRUE(one.scene.abandonFrame(3).ok());
  ASSERT_TRUE(one.scene.change({.instance = moving, .visible = true}).ok());
  runFrame(3);
  ASSERT_EQ(one.scene.settledInstances().size(), 1u);
  EXPECT_EQ(one.scene.settledInstances()[0], moving);
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
  EXPECT_FALSE(one.scene.beginFrame(9, 0).ok()) << "frames 1 and 8 are in flight";
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
  EXPECT_FALSE(one.scene.readBack(0, bytes).ok());
  EXPECT_FALSE(one.scene.readBack(2, bytes).ok());
  EXPECT_FALSE(one.scene.readBack(1, std::span(bytes).first(40)).ok());
  EXPECT_FALSE(one.scene.bounds(one.instance)->has_value());
  EXPECT_TRUE(one.scene.readBack(1, bytes).ok());
  EXPECT_TRUE(one.scene.bounds(one.instance)->has_value());
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
}

}  // namespace
}  // namespace dermis::test
