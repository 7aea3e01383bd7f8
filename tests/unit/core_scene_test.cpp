// The books of a scene without a device: what a plan lists, and what counts as done.

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "dermis/scene.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

SceneDescription smallScene() {
  SceneDescription description;
  description.meshBudget = 1 << 16;
  description.jointBudget = 256;
  description.outputBudget = 1 << 16;
  description.instanceBudget = 16;
  description.boundsBudget = 16;
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

  Scene scene = *Scene::create(smallScene());
  MeshHandle mesh;
  PoseHandle pose;
  InstanceHandle instance;
  Plan plan;
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
  ASSERT_TRUE(one.scene.beginFrame(1, 0).ok());
  ASSERT_TRUE(one.scene.plan(one.plan).ok());
  EXPECT_EQ(namesOf(one.plan), (std::vector<std::string>{"barrier", "upload to tables", "barrier",
                                                         "palette", "barrier", "skin", "barrier",
                                                         "results to read-back", "barrier"}));
}

TEST(Scene, TheGpuChoosesBeforeItSkins) {
  OneInstance one(true);
  const std::vector<std::string> first{"barrier",
                                       "upload to tables",
                                       "clear counters",
                                       "clear history",
                                       "barrier",
                                       "visibility",
                                       "barrier",
                                       "visibility",
                                       "barrier",
                                       "palette",
                                       "barrier",
                                       "indirect skin",
                                       "barrier",
                                       "counters to read-back",
                                       "results to read-back",
                                       "barrier"};
  ASSERT_TRUE(one.scene.beginFrame(1, 0).ok());
  ASSERT_TRUE(one.scene.plan(one.plan).ok());
  EXPECT_EQ(namesOf(one.plan), first);
  // History is cleared until a frame that does so is recorded, and never again.
  ASSERT_TRUE(one.scene.plan(one.plan).ok());
  EXPECT_EQ(namesOf(one.plan), first);
  ASSERT_TRUE(one.scene.commit().ok());
  ASSERT_TRUE(one.scene.beginFrame(2, 1).ok());
  ASSERT_TRUE(one.scene.plan(one.plan).ok());
  EXPECT_EQ(std::ranges::count(namesOf(one.plan), "clear history"), 0);
  EXPECT_EQ(std::ranges::count(namesOf(one.plan), "clear counters"), 1);
}

TEST(Scene, WhatIsNotCommittedIsPlannedAgain) {
  OneInstance one;
  ASSERT_TRUE(one.scene.beginFrame(1, 0).ok());
  ASSERT_TRUE(one.scene.plan(one.plan).ok());
  const std::vector<std::string> all = namesOf(one.plan);
  ASSERT_TRUE(one.scene.beginFrame(2, 0).ok());
  ASSERT_TRUE(one.scene.plan(one.plan).ok());
  EXPECT_EQ(namesOf(one.plan), all);
  EXPECT_EQ(one.scene.output(one.instance)->size, 0u);
  ASSERT_TRUE(one.scene.commit().ok());
  EXPECT_EQ(one.scene.output(one.instance)->size, 100u * 12u);
  EXPECT_EQ(one.scene.statistics().lastFrame.skinnedInstances, 1u);
  ASSERT_TRUE(one.scene.beginFrame(3, 2).ok());
  ASSERT_TRUE(one.scene.plan(one.plan).ok());
  EXPECT_TRUE(one.plan.commands().empty());
}

// A change between plan and commit would count as done.
TEST(Scene, AChangedSceneIsNotCommitted) {
  const std::vector<std::function<void(OneInstance&)>> changes{
      [](OneInstance& one) { EXPECT_TRUE(one.scene.removeInstance(one.instance).ok()); },
      [](OneInstance& one) { EXPECT_TRUE(one.scene.writePose(one.pose).ok()); },
      [](OneInstance& one) { EXPECT_TRUE(one.scene.setVisible(one.instance, false).ok()); },
      [](OneInstance& one) { EXPECT_TRUE(one.scene.teleport(one.instance).ok()); },
      [](OneInstance& one) { EXPECT_TRUE(one.scene.beginFrame(2, 0).ok()); },
      [](OneInstance& one) { EXPECT_EQ(one.scene.compact(1000), 0u); }};
  for (const auto& change : changes) {
    OneInstance one;
    EXPECT_FALSE(one.scene.commit().ok()) << "nothing is planned";
    ASSERT_TRUE(one.scene.beginFrame(1, 0).ok());
    ASSERT_TRUE(one.scene.plan(one.plan).ok());
    change(one);
    const Result<void> committed = one.scene.commit();
    ASSERT_FALSE(committed.ok());
    EXPECT_EQ(committed.error().code, ErrorCode::invalidArgument);
    ASSERT_TRUE(one.scene.plan(one.plan).ok());
    EXPECT_TRUE(one.scene.commit().ok());
    EXPECT_FALSE(one.scene.commit().ok()) << "once";
  }
}

TEST(Scene, ReadsBackOnlyWhatWasRecorded) {
  OneInstance one;
  ASSERT_TRUE(one.scene.beginFrame(1, 0).ok());
  ASSERT_TRUE(one.scene.plan(one.plan).ok());
  ASSERT_TRUE(one.scene.commit().ok());
  ASSERT_TRUE(one.scene.beginFrame(2, 1).ok());
  std::vector<std::byte> bytes(one.scene.buffer(BufferRole::readBack).size);
  EXPECT_FALSE(one.scene.readBack(0, bytes).ok());
  EXPECT_FALSE(one.scene.readBack(2, bytes).ok());
  EXPECT_FALSE(one.scene.readBack(1, std::span(bytes).first(bytes.size() - 1)).ok());
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
  bad.outputBudget = 0;
  expectRefused(bad, ErrorCode::invalidArgument, "outputBudget is 0");
  bad = smallScene();
  bad.limits.maxStorageBufferRange = 65536;
  bad.jointBudget = 1000;
  expectRefused(bad, ErrorCode::limitExceeded, "jointBudget");
  bad = smallScene();
  bad.jointBudget = bad.framesInFlight = 0xffffffffu;  // 48 times their product is more than 2^64
  expectRefused(bad, ErrorCode::limitExceeded, "framesInFlight");
  bad = smallScene();
  bad.tuning.workgroupSize = 3;
  expectRefused(bad, ErrorCode::invalidArgument, "tuning");
  bad = smallScene();
  bad.limits.maxWorkgroupCountX = 0;
  expectRefused(bad, ErrorCode::invalidArgument, "limits");
}

}  // namespace
}  // namespace dermis::test
