// Instances that are drawn between their last two updates: when their previous positions are
// settled, what the vertex shader is told, and their boxes, without a device.

#include <gtest/gtest.h>

#include <cstddef>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "plan_commands.h"
#include "planned_scene.h"
#include "scene_meshes.h"

namespace dermis::test {
namespace {

/// One such instance, of which results are written as a GPU would.
class SceneInterpolation : public ::testing::TestWithParam<bool> {
 protected:
  SceneInterpolation() {
    SceneCommandsDescription description;
    description.scene.framesInFlight = 3;
    description.limits.maxStorageBuffersPerStage = storageBuffersWanted;
    must(owner_.tryToCreate(description));
    MeshInfo info;
    info.vertexCount = 100;
    info.requiredJoints = 4;
    info.maxInfluences = 4;
    info.byteSize = 4096;
    description_.mesh = must(owner_.addMesh(info));
    description_.pose = must(scene().addPose(4));
    description_.layout.motion = true;
    description_.bounds = true;
    description_.interpolates = true;
    description_.updateInterval = 4;
    description_.culledOnGpu = GetParam();
  }

  Scene& scene() { return owner_.scene(); }
  void add() { instance_ = must(scene().addInstance(description_)); }
  void begin(std::uint64_t frames = 1) {
    frame_ += frames;
    must(scene().beginFrame(frame_, frame_ - frames));
  }
  void record() { owner_.record(); }
  void runFrame(bool isMoved = false) {
    begin();
    if (isMoved) must(scene().writePose(description_.pose));
    record();
  }
  /// Frames in which its pose is written, until one skins it.
  void runUntilSkinned() {
    do {
      begin();
      must(scene().writePose(description_.pose));
      const bool isDue = must(scene().isDue(instance_));
      record();
      if (isDue) return;
    } while (frame_ < 1000);
  }
  bool isSkinned() { return !scene().skinnedInstances().empty(); }
  bool isSettled() { return !scene().settledInstances().empty(); }
  /// Of the only candidate of the last plan.
  bool isHeld() const {
    std::vector<std::uint32_t> words(owner_.planned.buffer(BufferRole::tables).size / 4);
    must(writeTables(owner_.planned, std::as_writable_bytes(std::span(words))));
    for (const PlannedDispatch& dispatch : dispatchesOf(owner_.planned)) {
      if (dispatch.variant.kernel != Kernel::skin) continue;
      const auto record = abi::load<abi::InstanceRecord>(words, dispatch.skinPush().instances);
      return (record.joints & abi::INSTANCE_HOLDS) != 0;
    }
    ADD_FAILURE() << "no candidate";
    return false;
  }
  void expectInterpolation(float frames, float interval) {
    const InstanceOutput output = must(scene().output(instance_));
    EXPECT_EQ(output.interpolation, frames / interval) << "frame " << frame_;
    EXPECT_EQ(output.motionScale, 1 / interval) << "frame " << frame_;
  }

  /// Reads back the last frame: a box of this size, or what was there before. That a frame has
  /// copied nothing is known already.
  void readBack(std::optional<float> size = {}) {
    begin();
    if (scene().statistics().lastCompletedFrame.frame == frame_ - 1) {
      EXPECT_FALSE(size);
      must(owner_.readBack(frame_ - 1, {}));
      return;
    }
    InstanceResult result;
    if (size) size_ = *size;
    const float corners[2] = {-size_, size_};
    std::uint32_t bits[2];
    std::memcpy(bits, corners, sizeof(bits));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      result.orderedMin[axis] = ~bits[0];
      result.orderedMax[axis] = bits[1] | 0x80000000u;
    }
    std::vector<std::byte> bytes(1 << 16);
    std::memcpy(bytes.data() + readBackResults, &result, sizeof(result));
    must(owner_.readBack(frame_ - 1, bytes));
  }
  /// The half of its sides; 0 if there is none.
  float boxSize() {
    const std::optional<Box> box = must(scene().bounds(instance_));
    if (!box) return 0;
    EXPECT_EQ(box->min[0], -box->max[0]);
    return box->max[2];
  }

  PlannedScene owner_;
  InstanceDescription description_;
  InstanceHandle instance_;
  std::uint64_t frame_ = 0;
  float size_ = 0;
};

using SceneInterpolationOnCpu = SceneInterpolation;
INSTANTIATE_TEST_SUITE_P(ShownByTheCpu, SceneInterpolationOnCpu, ::testing::Values(false));
using SceneInterpolationOnGpu = SceneInterpolation;
INSTANTIATE_TEST_SUITE_P(ShownByTheGpu, SceneInterpolationOnGpu, ::testing::Values(true));
INSTANTIATE_TEST_SUITE_P(ShownBy, SceneInterpolation, ::testing::Bool(), [](const auto& isGpu) {
  return std::string(isGpu.param ? "TheGpu" : "TheCpu");
});

TEST_P(SceneInterpolation, NeedsPreviousPositions) {
  description_.layout.motion = false;
  const Result<InstanceHandle> added = scene().addInstance(description_);
  ASSERT_FALSE(added.ok());
  EXPECT_EQ(added.error().code, ErrorCode::invalidArgument);
  EXPECT_EQ(added.error().message,
            "the instance interpolates, but its layout has no previous positions (motion)");
}

TEST_P(SceneInterpolation, OthersAreDrawnAsTheyAre) {
  description_.interpolates = false;
  add();
  runFrame();
  runUntilSkinned();
  for (int rest = 0; rest < 5; ++rest) {
    expectInterpolation(1, 1);
    runFrame();
  }
}

// From the positions before to the current ones in as many frames as its interval has.
TEST_P(SceneInterpolation, GoesToEachUpdateUntilTheNext) {
  add();
  runFrame();
  runUntilSkinned();
  for (int update = 0; update < 3; ++update) {
    for (const float elapsed : {1.0f, 2.0f, 3.0f, 4.0f}) {
      expectInterpolation(elapsed, 4);
      EXPECT_FALSE(isSettled());
      runFrame(true);
    }
  }
}

TEST_P(SceneInterpolation, TheIntervalOfTheLastUpdateCounts) {
  add();
  runFrame();
  runUntilSkinned();
  must(scene().change({.instance = instance_, .updateInterval = 2}));
  expectInterpolation(1, 4);
  runFrame();
  expectInterpolation(2, 4);
  runUntilSkinned();
  expectInterpolation(1, 2);
}

// The positions of a frame that is not executed are never drawn.
TEST_P(SceneInterpolation, IsThatOfTheLastFrameThatWasExecuted) {
  add();
  runFrame();
  runUntilSkinned();
  begin();
  expectInterpolation(1, 4);
  must(owner_.plan());
  expectInterpolation(1, 4);
  must(owner_.commit());
  expectInterpolation(2, 4);
  must(scene().abandonFrame(frame_));
  expectInterpolation(1, 1);
}

TEST_P(SceneInterpolationOnCpu, SettlesOnceWhenItHasReachedItsPose) {
  add();
  runFrame();
  runUntilSkinned();
  for (int held = 1; held < 4; ++held) {
    runFrame();
    EXPECT_TRUE(owner_.planned.commands().empty()) << "nothing is done for it";
    EXPECT_FALSE(isSettled());
    EXPECT_FALSE(isSkinned());
  }
  runFrame();
  EXPECT_TRUE(isSettled());
  expectInterpolation(1, 1);
  runFrame();
  EXPECT_FALSE(isSettled()) << "once";
}

// Also if the frame in which it would have is skipped.
TEST_P(SceneInterpolationOnCpu, FramesThatAreSkippedCount) {
  add();
  runFrame();
  runUntilSkinned();
  begin(3);
  record();
  EXPECT_FALSE(isSettled());
  expectInterpolation(4, 4);
  begin(7);
  record();
  EXPECT_TRUE(isSettled());
}

TEST_P(SceneInterpolationOnCpu, ARestartHasNothingToInterpolate) {
  add();
  runFrame();
  expectInterpolation(1, 1);
  runUntilSkinned();
  runFrame();
  must(scene().change({.instance = instance_, .teleports = true}));
  runFrame();
  EXPECT_TRUE(isSkinned());
  expectInterpolation(1, 1);
  for (int rest = 0; rest < 6; ++rest) {
    runFrame();
    EXPECT_FALSE(isSettled());
  }
}

// However often it is hidden and shown between two frames, it stays on its way; if it was hidden in
// a frame, it settles when it returns.
TEST_P(SceneInterpolationOnCpu, WhatReturnsSettlesAtOnce) {
  add();
  runFrame();
  runUntilSkinned();
  const auto show = [&](bool isVisible) {
    must(scene().change({.instance = instance_, .visible = isVisible}));
  };
  begin();
  for (const bool isVisible : {false, true, false, true}) show(isVisible);
  record();
  expectInterpolation(2, 4);
  EXPECT_FALSE(isSettled());
  EXPECT_EQ(owner_.books().moving_.size(), 1u) << "listed once";
  begin();
  show(false);
  record();
  EXPECT_FALSE(isSettled());
  begin();
  show(true);
  record();
  EXPECT_TRUE(isSettled());
  EXPECT_EQ(scene().settledInstances().size(), 1u);
  expectInterpolation(1, 1);
}

// Its box contains both positions until one of them is no longer drawn.
TEST_P(SceneInterpolationOnCpu, ItsBoxIsThatOfTheLastTwoUpdates) {
  add();
  begin();
  const auto readsBack = [&](bool isMoved, std::optional<float> size) {
    if (isMoved) must(scene().writePose(description_.pose));
    record();
    readBack(size);
  };
  readsBack(false, 3.0f);
  EXPECT_EQ(boxSize(), 3);
  while (!must(scene().isDue(instance_))) readsBack(false, {});
  readsBack(true, 2.0f);
  EXPECT_EQ(boxSize(), 3) << "where it comes from";
  for (int held = 1; held < 4; ++held) {
    readsBack(false, {});
    EXPECT_EQ(boxSize(), 3);
  }
  readsBack(true, 1.0f);
  EXPECT_EQ(boxSize(), 2);
  for (int held = 1; held < 4; ++held) readsBack(false, {});
  EXPECT_EQ(boxSize(), 2);
  readsBack(false, {});
  EXPECT_EQ(boxSize(), 1) << "settled";
  must(scene().change({.instance = instance_, .teleports = true}));
  readsBack(false, 0.5f);
  EXPECT_EQ(boxSize(), 0.5f);
}

// The box before the first update that was read back is another's.
TEST_P(SceneInterpolationOnCpu, ItsBoxIsNeverThatOfARemovedInstance) {
  description_.updateInterval = 1;
  add();
  runFrame();
  readBack(9.0f);
  EXPECT_EQ(boxSize(), 9);
  must(scene().removeInstance(instance_));
  add();
  record();  // is not read back
  begin();
  must(scene().writePose(description_.pose));
  record();
  readBack(1.0f);
  EXPECT_EQ(boxSize(), 1);
}

// The GPU may settle it once it has reached its pose.
TEST_P(SceneInterpolationOnGpu, TheGpuLearnsHowLongItIsHeld) {
  add();
  runFrame();
  runUntilSkinned();
  EXPECT_FALSE(isHeld()) << "it is skinned";
  for (int held = 1; held < 4; ++held) {
    runFrame(true);
    EXPECT_TRUE(isHeld());
  }
  runFrame(true);
  EXPECT_FALSE(isHeld()) << "it is skinned";
  for (int held = 1; held < 4; ++held) runFrame();
  EXPECT_TRUE(isHeld());
  runFrame();
  EXPECT_FALSE(isHeld());
  expectInterpolation(4, 4);
}

TEST_P(SceneInterpolationOnGpu, ItsBoxIsTheNewOneWhenItReturns) {
  add();
  begin();
  record();
  readBack(3.0f);
  must(scene().change({.instance = instance_, .visible = false}));
  record();
  readBack();
  must(scene().writePose(description_.pose));
  must(scene().change({.instance = instance_, .visible = true}));
  record();
  readBack(2.0f);
  EXPECT_EQ(boxSize(), 2) << "there is nothing that it comes from";
}

// The CPU does not know when it is skinned: its box contains at least both positions.
TEST_P(SceneInterpolationOnGpu, ItsBoxContainsWhatMayBeDrawn) {
  add();
  begin();
  const auto readsBack = [&](bool isMoved, std::optional<float> size) {
    if (isMoved) must(scene().writePose(description_.pose));
    record();
    readBack(size);
  };
  readsBack(false, 3.0f);
  EXPECT_EQ(boxSize(), 3);
  while (!must(scene().isDue(instance_))) readsBack(true, {});
  readsBack(true, 2.0f);
  EXPECT_EQ(boxSize(), 3) << "where it comes from";
  for (int held = 1; held < 4; ++held) readsBack(false, {});
  EXPECT_EQ(boxSize(), 3);
  readsBack(false, {});
  EXPECT_EQ(boxSize(), 2) << "it has reached its pose";
  while (!must(scene().isDue(instance_))) readsBack(true, {});
  readsBack(true, {});  // not in view
  EXPECT_EQ(boxSize(), 2);
  readsBack(false, 1.0f);  // in view, and so it restarts
  EXPECT_EQ(boxSize(), 1);
}

}  // namespace
}  // namespace dermis::test
