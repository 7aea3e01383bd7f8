// Previous positions: those of the last frame in which an instance was displayed, whatever happened
// since.

#include <gtest/gtest.h>

#include "system_test.h"

namespace dermis::test {
namespace {

/// One instance with previous positions, and what tier 1 makes of its poses.
class SystemMotionTest : public SystemTest {
 protected:
  void SetUp() override {
    SystemTest::SetUp();
    if (device_ != nullptr) one_.emplace(device(), context(), description(), motionLayout());
  }
  void TearDown() override {
    one_.reset();
    SystemTest::TearDown();
  }

  SystemEngine& engine() { return one_->engine; }
  void move(std::uint32_t pose) { engine().writePose(one_->description.pose, systemPose(pose)); }
  void moveInFrame(std::uint32_t pose) {
    engine().begin();
    move(pose);
    engine().submit();
  }
  const std::vector<std::byte>& positionsIn(std::uint32_t pose) {
    std::vector<std::byte>& positions = expected_[pose];
    if (positions.empty())
      positions = alone(one_->packed, systemPose(pose), one_->description)[positionStream];
    return positions;
  }
  /// Expects the instance in a pose, after it was displayed in another.
  void expectMotion(std::uint32_t pose, std::uint32_t before) {
    const Streams streams = engine().read(one_->instance);
    EXPECT_TRUE(streams[positionStream] == positionsIn(pose))
        << "positions in frame " << engine().frame();
    EXPECT_TRUE(streams[previousStream] == positionsIn(before))
        << "previous positions in frame " << engine().frame();
  }
  bool wasSkinned() {
    return indicesOf(engine()->skinnedInstances()).contains(one_->instance.index);
  }
  bool wasSettled() {
    return indicesOf(engine()->settledInstances()).contains(one_->instance.index);
  }

  std::optional<SingleInstance> one_;
  std::map<std::uint32_t, std::vector<std::byte>> expected_;
};

TEST_F(SystemMotionTest, EveryFrameSeesThePositionsOfTheFrameBefore) {
  engine().submit();
  expectMotion(1, 1);
  for (std::uint32_t pose = 2; pose < 8; ++pose) {
    moveInFrame(pose);
    EXPECT_TRUE(wasSkinned());
    EXPECT_FALSE(wasSettled());
    expectMotion(pose, pose - 1);
  }
}

TEST_F(SystemMotionTest, WhatNoLongerMovesSettlesOnce) {
  engine().submit();
  moveInFrame(2);
  engine().runFrame();
  EXPECT_FALSE(wasSkinned());
  EXPECT_TRUE(wasSettled());
  EXPECT_EQ(engine().lastFrame().settledInstances, 1u);
  EXPECT_EQ(engine().lastFrame().skinnedVertices, 0u);
  expectMotion(2, 2);
  engine().runFrame();
  EXPECT_FALSE(wasSettled());
  EXPECT_EQ(engine().lastFrame().dispatches, 0u);
  expectMotion(2, 2);
  moveInFrame(3);
  expectMotion(3, 2);
}

// Its previous positions are its positions from the beginning.
TEST_F(SystemMotionTest, ANewInstanceHasNothingToSettle) {
  engine().submit();
  engine().runFrame();
  EXPECT_EQ(engine().lastFrame().dispatches, 0u);
  expectMotion(1, 1);
}

TEST_F(SystemMotionTest, ATeleportLeavesNoMotionBehind) {
  engine().submit();
  moveInFrame(2);
  engine().begin();
  move(3);
  must(engine()->change({.instance = one_->instance, .teleports = true}));
  engine().submit();
  expectMotion(3, 3);
  moveInFrame(4);
  expectMotion(4, 3);
}

TEST_F(SystemMotionTest, WhatComesBackIntoViewDoesNotMove) {
  engine().submit();
  moveInFrame(2);
  engine().begin();
  must(engine()->change({.instance = one_->instance, .visible = false}));
  engine().submit();
  EXPECT_FALSE(wasSkinned());
  EXPECT_EQ(engine().lastFrame().skinnedVertices, 0u);
  moveInFrame(3);
  EXPECT_FALSE(wasSkinned());
  engine().begin();
  must(engine()->change({.instance = one_->instance, .visible = true}));
  engine().submit();
  EXPECT_TRUE(wasSkinned());
  expectMotion(3, 3);
  moveInFrame(4);
  expectMotion(4, 3);
}

// It settles when it is displayed again, and nothing is done for it before.
TEST_F(SystemMotionTest, WhatComesBackInTheSamePoseDoesNotMove) {
  engine().submit();
  moveInFrame(2);
  engine().begin();
  must(engine()->change({.instance = one_->instance, .visible = false}));
  engine().submit();
  EXPECT_EQ(engine().lastFrame().settledInstances, 0u);
  EXPECT_EQ(engine().lastFrame().dispatches, 0u);
  engine().runFrame();
  engine().begin();
  must(engine()->change({.instance = one_->instance, .visible = true}));
  engine().submit();
  EXPECT_TRUE(wasSettled());
  EXPECT_FALSE(wasSkinned());
  EXPECT_EQ(engine().lastFrame().settledInstances, 1u);
  expectMotion(2, 2);
  engine().runFrame();
  EXPECT_EQ(engine().lastFrame().settledInstances, 0u);
}

// What is skinned when it comes back, or had settled before it left, has nothing to settle.
TEST_F(SystemMotionTest, WhatComesBackSettlesOnlyIfItHasTo) {
  engine().submit();
  moveInFrame(2);
  const auto leaveAndReturn = [this](std::optional<std::uint32_t> pose) {
    engine().begin();
    must(engine()->change({.instance = one_->instance, .visible = false}));
    engine().submit();
    EXPECT_EQ(engine().lastFrame().settledInstances, 0u);
    engine().begin();
    // Shown, hidden and shown again before the record is shown once.
    for (const bool isVisible : {true, false, true})
      must(engine()->change({.instance = one_->instance, .visible = isVisible}));
    if (pose) move(*pose);
    engine().submit();
    EXPECT_EQ(engine().lastFrame().settledInstances, 0u);
  };
  leaveAndReturn(3);
  EXPECT_TRUE(wasSkinned());
  expectMotion(3, 3);
  moveInFrame(4);
  engine().runFrame();
  EXPECT_TRUE(wasSettled());
  leaveAndReturn(std::nullopt);
  EXPECT_FALSE(wasSkinned());
  EXPECT_EQ(engine().lastFrame().dispatches, 0u);
  expectMotion(4, 4);
}

TEST_F(SystemMotionTest, WhatHasAnotherMeshWhenItComesBackHasNothingToSettle) {
  engine().submit();
  moveInFrame(2);
  engine().begin();
  must(engine()->change({.instance = one_->instance, .visible = false}));
  const PackedMesh coarse = systemMesh(9, 40);
  must(engine()->change({.instance = one_->instance, .mesh = engine().addMesh(coarse)}));
  engine().submit();
  EXPECT_EQ(engine().lastFrame().settledInstances, 0u);
  engine().begin();
  must(engine()->change({.instance = one_->instance, .visible = true}));
  engine().submit();
  EXPECT_TRUE(wasSkinned());
  EXPECT_FALSE(wasSettled());
  EXPECT_TRUE(engine().read(one_->instance) == alone(coarse, systemPose(2), one_->description));
}

TEST_F(SystemMotionTest, HiddenAndShownBetweenTwoFramesWasNeverAway) {
  engine().submit();
  engine().begin();
  must(engine()->change({.instance = one_->instance, .visible = false}));
  move(2);
  must(engine()->change({.instance = one_->instance, .visible = true}));
  engine().submit();
  expectMotion(2, 1);
}

TEST_F(SystemMotionTest, ATeleportOutOfViewIsOverWhenItComesBack) {
  engine().submit();
  engine().begin();
  must(engine()->change({.instance = one_->instance, .visible = false}));
  must(engine()->change({.instance = one_->instance, .teleports = true}));
  engine().submit();
  engine().begin();
  must(engine()->change({.instance = one_->instance, .visible = true}));
  move(2);
  engine().submit();
  expectMotion(2, 2);
  moveInFrame(3);
  expectMotion(3, 2);
}

TEST_F(SystemMotionTest, AnotherMeshHasNoMotionYet) {
  engine().submit();
  moveInFrame(2);
  engine().begin();
  const PackedMesh coarse = systemMesh(9, 40);
  must(engine()->change({.instance = one_->instance, .mesh = engine().addMesh(coarse)}));
  move(3);
  engine().submit();
  Streams streams = engine().read(one_->instance);
  const Streams expected = alone(coarse, systemPose(3), one_->description);
  EXPECT_TRUE(streams == expected);
  engine().begin();
  move(4);
  engine().submit();
  streams = engine().read(one_->instance);
  EXPECT_TRUE(streams[positionStream] ==
              alone(coarse, systemPose(4), one_->description)[positionStream]);
  EXPECT_TRUE(streams[previousStream] == expected[positionStream]);
}

TEST_F(SystemMotionTest, MorphWeightsMoveToo) {
  engine().submit();
  engine().begin();
  const std::vector<MorphWeight> morphs{{1, 0.5f}};
  must(engine()->change({.instance = one_->instance, .morphs = morphs}));
  engine().submit();
  const Streams streams = engine().read(one_->instance);
  EXPECT_TRUE(streams[positionStream] ==
              alone(one_->packed, systemPose(1), one_->description, morphs)[positionStream]);
  EXPECT_TRUE(streams[previousStream] == positionsIn(1));
  engine().runFrame();
  EXPECT_TRUE(wasSettled());
}

// Skinned in one frame of three: in the frame after it stands still, and does so until its next.
TEST_F(SystemMotionTest, WhatIsSkippedStandsStillAndThenMovesFromWhereItWas) {
  must(engine()->change({.instance = one_->instance, .updateInterval = 3}));
  move(100);
  engine().submit();
  EXPECT_TRUE(wasSkinned()) << "in its first frame, whatever its interval";
  expectMotion(100, 100);
  std::uint32_t shown = 100, updates = 0;
  bool moved = false;
  for (std::uint32_t frame = 0; frame < 12; ++frame) {
    const std::uint32_t pose = 101 + frame;
    moveInFrame(pose);
    if (wasSkinned()) {
      expectMotion(pose, shown);
      shown = pose;
      ++updates;
    } else {
      expectMotion(shown, shown);
      EXPECT_EQ(wasSettled(), moved) << "in the frame after it moved, and in no other";
    }
    moved = wasSkinned();
  }
  EXPECT_EQ(updates, 4u);
}

TEST_F(SystemMotionTest, ATeleportDoesNotWaitForTheInterval) {
  must(engine()->change({.instance = one_->instance, .updateInterval = 5}));
  engine().submit();
  for (std::uint32_t frame = 0; frame < 10; ++frame) {
    engine().begin();
    move(200 + frame);
    must(engine()->change({.instance = one_->instance, .teleports = true}));
    engine().submit();
    EXPECT_TRUE(wasSkinned());
    expectMotion(200 + frame, 200 + frame);
  }
}

// A pose that was written in a frame in which the instance is skipped is not lost.
TEST_F(SystemMotionTest, ASkippedPoseIsSkinnedWithinItsInterval) {
  must(engine()->change({.instance = one_->instance, .updateInterval = 4}));
  engine().submit();
  for (std::uint32_t offset = 0; offset < 4; ++offset) {
    moveInFrame(300 + offset);
    std::uint32_t waited = 0;
    while (!wasSkinned() && waited < 4) {
      engine().runFrame();
      ++waited;
    }
    EXPECT_LT(waited, 4u);
    EXPECT_TRUE(engine().read(one_->instance)[positionStream] == positionsIn(300 + offset));
    for (std::uint32_t rest = 0; rest <= offset; ++rest) engine().runFrame();
  }
}

class SystemIntervalTest : public SystemTest {};

// A body and its clothes rest until the face alone moves: whatever follows, they show one pose.
TEST_F(SystemIntervalTest, InstancesOfAPoseKeepTogetherWhenOneChangesAlone) {
  SingleInstance body(device(), context(), description(), plainLayout());
  body.description.updateInterval = 4;
  must(body.engine->change({.instance = body.instance, .updateInterval = 4}));
  const InstanceHandle clothes = body.engine.addInstance(body.description);
  body.engine.submit();
  for (std::uint32_t rest = 4; rest < 8; ++rest) {
    for (std::uint32_t frame = 0; frame < rest; ++frame) body.engine.runFrame();
    body.engine.begin();
    const MorphWeight morph{rest % 3, 0.5f};
    must(body.engine->change(
        {.instance = body.instance, .morphs = std::span<const MorphWeight>(&morph, 1)}));
    body.engine.submit();
    for (std::uint32_t pose = 0; pose < 8; ++pose) {
      body.engine.begin();
      body.engine.writePose(body.description.pose, systemPose(pose));
      body.engine.submit();
      const std::set<std::uint32_t> skinned = indicesOf(body.engine->skinnedInstances());
      EXPECT_EQ(skinned.contains(body.instance.index), skinned.contains(clothes.index));
    }
  }
}

// Whatever the beat of its interval, and whether its pose is written before or after it is shown.
TEST_F(SystemIntervalTest, WhatComesBackIntoViewDoesNotWaitForTheInterval) {
  for (const bool poseFirst : {true, false}) {
    SingleInstance one(device(), context(), description(), motionLayout());
    must(one.engine->change({.instance = one.instance, .updateInterval = 5}));
    one.engine.submit();
    for (std::uint32_t away = 1; away <= 10; ++away) {
      SCOPED_TRACE(away);
      one.engine.begin();
      must(one.engine->change({.instance = one.instance, .visible = false}));
      one.engine.submit();
      for (std::uint32_t frame = 1; frame < away; ++frame) one.engine.runFrame();
      one.engine.begin();
      if (!poseFirst) must(one.engine->change({.instance = one.instance, .visible = true}));
      one.engine.writePose(one.description.pose, systemPose(away));
      if (poseFirst) must(one.engine->change({.instance = one.instance, .visible = true}));
      one.engine.submit();
      EXPECT_EQ(one.engine.lastFrame().skinnedInstances, 1u);
      const Streams expected = alone(one.packed, systemPose(away), one.description);
      EXPECT_TRUE(one.engine.read(one.instance) == expected);
    }
  }
}

TEST_F(SystemIntervalTest, PosesAreSpreadOverTheFramesAndTheirInstancesKeepTogether) {
  SystemEngine engine(device(), context(), description());
  engine.begin();
  const MeshHandle mesh = engine.addMesh(systemMesh(1, 20));
  std::vector<PoseHandle> palettes;
  std::vector<std::pair<InstanceHandle, InstanceHandle>> pairs;
  InstanceDescription instance;
  instance.mesh = mesh;
  instance.layout = plainLayout();
  instance.updateInterval = 4;
  for (std::uint32_t i = 0; i < 16; ++i) {
    instance.pose = palettes.emplace_back(engine.addPose(systemPose(i)));
    const InstanceHandle body = engine.addInstance(instance);
    pairs.push_back({body, engine.addInstance(instance)});
  }
  engine.submit();
  EXPECT_EQ(engine.lastFrame().skinnedInstances, 32u) << "the first time";
  for (std::uint32_t frame = 0; frame < 8; ++frame) {
    engine.begin();
    for (std::uint32_t i = 0; i < 16; ++i) engine.writePose(palettes[i], systemPose(i + frame));
    engine.submit();
    EXPECT_EQ(engine.lastFrame().skinnedInstances, 8u) << "a fourth of them in each frame";
    const std::set<std::uint32_t> skinned = indicesOf(engine->skinnedInstances());
    for (const auto& [body, clothes] : pairs)
      EXPECT_EQ(skinned.contains(body.index), skinned.contains(clothes.index));
  }
}

}  // namespace
}  // namespace dermis::test
