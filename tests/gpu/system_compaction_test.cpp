// Outputs that move into gaps: their bytes come along, and what is drawn from meanwhile stays.

#include <gtest/gtest.h>

#include <algorithm>

#include "system_test.h"

namespace dermis::test {
namespace {

class SystemCompactionTest : public SystemTest {
 protected:
  /// Six instances that have moved once, so that their previous positions differ from their
  /// positions.
  void SetUp() override {
    SystemTest::SetUp();
    if (device_ == nullptr) return;
    vulkan::SceneRecorderDescription small = description();
    small.scene.outputCapacity = Capacity::fixed(64 << 10);
    engine_.emplace(device(), context(), small);
    engine_->begin();
    instance_.mesh = engine_->addMesh(packed_);
    instance_.layout = motionLayout();
    for (std::uint32_t i = 0; i < 6; ++i) {
      instance_.pose = palettes_.emplace_back(engine_->addPose(systemPose(i)));
      instances_.push_back(engine_->addInstance(instance_));
    }
    engine_->submit();
  }
  void TearDown() override {
    engine_.reset();
    SystemTest::TearDown();
  }
  Scene& scene() { return engine_->scene(); }
  std::uint64_t offsetOf(std::uint32_t number) {
    return must(scene().output(instances_[number])).offset;
  }
  std::uint64_t sizeOfOne() { return must(scene().output(instances_[1])).places.size; }
  void remove(std::initializer_list<std::uint32_t> numbers) {
    engine_->begin();
    for (const std::uint32_t number : numbers) must(scene().removeInstance(instances_[number]));
    engine_->submit();
    engine_->runFrame();
  }
  void moveAll(std::initializer_list<std::uint32_t> numbers, std::uint32_t by) {
    for (const std::uint32_t number : numbers)
      engine_->writePose(palettes_[number], systemPose(number + by));
  }
  void expectPose(std::uint32_t number, std::uint32_t by, std::uint32_t before) {
    const Streams streams = engine_->read(instances_[number]);
    expectSkinned(streams, alone(packed_, systemPose(number + by), instance_));
    EXPECT_TRUE(streams[previousStream] ==
                alone(packed_, systemPose(number + before), instance_)[positionStream]);
  }

  PackedMesh packed_ = systemMesh(1, 100);
  std::optional<SystemEngine> engine_;
  InstanceDescription instance_;
  std::vector<PoseHandle> palettes_;
  std::vector<InstanceHandle> instances_;
};

TEST_F(SystemCompactionTest, BytesComeAlong) {
  remove({0, 2});
  engine_->begin();
  moveAll({1, 3, 4, 5}, 10);
  engine_->submit();
  engine_->begin();
  const std::uint64_t moved = scene().compact(1 << 20);
  EXPECT_EQ(moved, 2 * sizeOfOne()) << "two gaps, filled from the end";
  engine_->submit();
  EXPECT_EQ(offsetOf(1), sizeOfOne());
  EXPECT_EQ(offsetOf(3), 3 * sizeOfOne());
  EXPECT_LT(offsetOf(5), 4 * sizeOfOne());
  EXPECT_LT(offsetOf(4), 4 * sizeOfOne());
  // They settled in the same frame: nobody moved in it.
  for (const std::uint32_t number : {1u, 3u, 4u, 5u}) expectPose(number, 10, 10);
  engine_->runFrame();
  const SceneStatistics::Store outputs = scene().statistics().outputs;
  EXPECT_EQ(outputs.largestFree, outputs.capacity - outputs.used) << "one stretch";
}

TEST_F(SystemCompactionTest, PreviousPositionsComeAlongWithWhatMoves) {
  remove({0, 2});
  engine_->begin();
  moveAll({1, 3, 4, 5}, 10);
  EXPECT_EQ(scene().compact(1 << 20), 2 * sizeOfOne());
  engine_->submit();
  for (const std::uint32_t number : {1u, 3u, 4u, 5u}) expectPose(number, 10, 0);
  engine_->begin();
  moveAll({4, 5}, 20);
  engine_->submit();
  for (const std::uint32_t number : {4u, 5u}) expectPose(number, 20, 10);
}

// What moves at rest is copied, and not skinned again.
TEST_F(SystemCompactionTest, WhatRestsIsNotSkinned) {
  remove({0, 2});
  engine_->runFrame();
  engine_->begin();
  EXPECT_GT(scene().compact(1 << 20), 0u);
  engine_->submit();
  EXPECT_EQ(engine_->lastFrame().skinnedInstances, 0u);
  EXPECT_EQ(engine_->lastFrame().dispatches, 0u);
  EXPECT_GE(engine_->lastFrame().copies, 1u);
  for (const std::uint32_t number : {1u, 3u, 4u, 5u}) expectPose(number, 0, 0);
}

TEST_F(SystemCompactionTest, TheOldPlaceStaysUntilTheFrameIsComplete) {
  const std::uint64_t oldPlace = offsetOf(5), size = sizeOfOne();
  remove({0});
  engine_->begin();
  EXPECT_EQ(scene().compact(1 << 20), size);
  engine_->submit();
  ASSERT_NE(offsetOf(5), oldPlace);
  const auto expectApart = [&](InstanceHandle added) {
    const std::uint64_t offset = must(scene().output(added)).offset;
    EXPECT_TRUE(offset >= oldPlace + size || offset + size <= oldPlace)
        << "frames under way still read the old place";
  };
  engine_->begin(1);
  const InstanceHandle early = engine_->addInstance(instance_);
  engine_->submit();
  expectApart(early);
  // Once it is, it is used again.
  engine_->runFrame();
  engine_->begin();
  const InstanceHandle late = engine_->addInstance(instance_);
  engine_->submit();
  EXPECT_EQ(must(scene().output(late)).offset, oldPlace);
}

TEST_F(SystemCompactionTest, NoMoreBytesThanWereAllowed) {
  remove({0, 1, 2});
  const std::uint64_t size = must(scene().output(instances_[3])).places.size;
  engine_->begin();
  EXPECT_EQ(scene().compact(size - 1), 0u);
  engine_->submit();
  EXPECT_EQ(engine_->lastFrame().movedBytes, 0u);
  engine_->begin();
  EXPECT_EQ(scene().compact(2 * size - 1), size);
  engine_->submit();
  EXPECT_EQ(engine_->lastFrame().movedBytes, size);
  for (const std::uint32_t number : {3u, 4u, 5u}) expectPose(number, 0, 0);
}

TEST_F(SystemCompactionTest, WithoutGapsNothingMoves) {
  engine_->begin();
  EXPECT_EQ(scene().compact(1 << 20), 0u);
  engine_->submit();
  EXPECT_EQ(engine_->lastFrame().copies, 0u);
  remove({5});
  engine_->begin();
  EXPECT_EQ(scene().compact(1 << 20), 0u) << "the gap is behind them all";
  engine_->submit();
}

// What is removed, or moves to another mesh, after `compact` and before `record`.
TEST_F(SystemCompactionTest, WhatGoesBeforeItMovesIsNoTrouble) {
  remove({0, 1});
  engine_->begin();
  EXPECT_GT(scene().compact(1 << 20), 0u);
  must(scene().removeInstance(instances_[5]));
  const PackedMesh coarse = systemMesh(2, 40);
  must(scene().change({.instance = instances_[4], .mesh = engine_->addMesh(coarse)}));
  engine_->submit();
  for (const std::uint32_t number : {2u, 3u}) expectPose(number, 0, 0);
  EXPECT_TRUE(engine_->read(instances_[4]) == alone(coarse, systemPose(4), instance_));
  for (int i = 0; i < 4; ++i) engine_->runFrame();
  const SceneStatistics::Store outputs = scene().statistics().outputs;
  EXPECT_EQ(outputs.used, 2 * must(scene().output(instances_[2])).places.size +
                              must(scene().output(instances_[4])).places.size)
      << "no place is lost";
}

// Instances that overlap the place they move to must not be torn.
TEST_F(SystemCompactionTest, AGapSmallerThanAnInstanceTearsNothing) {
  engine_->begin();
  const PackedMesh coarse = systemMesh(2, 40);
  InstanceDescription small = instance_;
  small.mesh = engine_->addMesh(coarse);
  const InstanceHandle smallFirst = engine_->addInstance(small);
  const InstanceHandle largeBehind = engine_->addInstance(instance_);
  engine_->submit();
  engine_->begin();
  must(scene().removeInstance(smallFirst));
  engine_->submit();
  for (int i = 0; i < 3; ++i) {
    engine_->runFrame();
    engine_->begin();
    scene().compact(1 << 20);
    engine_->submit();
    for (std::uint32_t number = 0; number < 6; ++number) expectPose(number, 0, 0);
    EXPECT_TRUE(engine_->read(largeBehind) == alone(packed_, systemPose(5), instance_));
  }
}

}  // namespace
}  // namespace dermis::test
