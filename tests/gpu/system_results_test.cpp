// What comes back from the GPU: the box of an instance is its own, of the newest frame that is
// complete, and exact, whoever chose the instance and whoever had its slot before.

#include <algorithm>
#include <cstring>

#include "command_log.h"
#include "system_visibility.h"

namespace dermis::test {
namespace {

std::vector<float> floatsOf(const std::vector<std::byte>& bytes) {
  std::vector<float> floats(bytes.size() / sizeof(float));
  std::memcpy(floats.data(), bytes.data(), bytes.size());
  return floats;
}

/// Of positions in float32x3.
Box boxOf(const std::vector<std::byte>& positions) {
  const std::vector<float> values = floatsOf(positions);
  Box box{{values[0], values[1], values[2]}, {values[0], values[1], values[2]}};
  for (std::size_t i = 0; i < values.size(); ++i) {
    box.min[i % 3] = std::min(box.min[i % 3], values[i]);
    box.max[i % 3] = std::max(box.max[i % 3], values[i]);
  }
  return box;
}

void expectBox(const std::optional<Box>& box, const Box& expected) {
  ASSERT_TRUE(box.has_value());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(box->min[axis], expected.min[axis]) << axis;
    EXPECT_EQ(box->max[axis], expected.max[axis]) << axis;
  }
}

/// A pose with every joint in one place, shrunk: its box lies inside that of any other.
Pose smallPose() {
  Pose pose(8);
  for (JointMatrix& joint : pose) {
    for (std::size_t axis = 0; axis < 3; ++axis) joint.m[axis][axis] = 0.01f;
  }
  return pose;
}

class SystemResultsTest : public SystemVisibilityTest {
 protected:
  std::optional<Box> boundsOf(std::uint32_t instance) {
    return must((*engine_)->bounds(instances_[instance]));
  }
  void openWithBounds(bool culledOnGpu) {
    instance_.bounds = true;
    open(culledOnGpu, plainLayout());
  }
};

// As the GPU has both, in each frame.
TEST_F(SystemResultsTest, WhatIsDrawnBetweenUpdatesHasTheBoxOfBothPositions) {
  for (const bool culledOnGpu : {false, true}) {
    instances_.clear();
    palettes_.clear();
    instance_.bounds = instance_.interpolates = true;
    instance_.updateInterval = 3;
    open(culledOnGpu, motionLayout());
    std::uint32_t moving = 0;
    for (std::uint32_t frame = 1; frame <= 12; ++frame) {
      if (frame > 1 && frame < 8) moveAll(100 * frame);
      submit();
      const std::vector<std::byte> bytes = engine_->readOutput();
      completed();
      for (std::uint32_t i = 0; i < instanceCount; ++i) {
        SCOPED_TRACE("frame " + std::to_string(frame) + ", instance " + std::to_string(i));
        const Streams streams = engine_->read(bytes, instances_[i]);
        Box both = boxOf(streams[positionStream]);
        const Box earlier = boxOf(streams[previousStream]);
        for (std::size_t axis = 0; axis < 3; ++axis) {
          both.min[axis] = std::min(both.min[axis], earlier.min[axis]);
          both.max[axis] = std::max(both.max[axis], earlier.max[axis]);
        }
        expectBox(boundsOf(i), both);
        moving += streams[positionStream] != streams[previousStream];
      }
    }
    EXPECT_GT(moving, 4 * instanceCount);
    submit();
  }
}

// The box of each pose, not of all poses so far.
TEST_F(SystemResultsTest, WhatTheGpuChoosesHasTheBoxOfItsNewestPose) {
  openWithBounds(true);
  submit();
  engine_->begin();
  for (std::uint32_t i = 0; i < instanceCount; ++i)
    ASSERT_NO_FATAL_FAILURE(expectBox(boundsOf(i), boxOf(positionsIn(i))));
  const Pose small = smallPose();
  const Box shrunk = boxOf(alone(packed_, small, instance_)[positionStream]);
  show(0, 10);
  for (const PoseHandle palette : palettes_) engine_->writePose(palette, small);
  submit();
  engine_->begin();
  for (std::uint32_t i = 0; i < instanceCount; ++i)
    ASSERT_NO_FATAL_FAILURE(expectBox(boundsOf(i), i < 10 ? shrunk : boxOf(positionsIn(i))));
  show(0, instanceCount);
  submit();
  engine_->begin();
  for (std::uint32_t i = 0; i < instanceCount; ++i)
    ASSERT_NO_FATAL_FAILURE(expectBox(boundsOf(i), shrunk));
  submit();
}

// Its slot among the results may have been another's.
TEST_F(SystemResultsTest, ANewInstanceHasNoBoxUntilItsFirstFrameIsComplete) {
  openWithBounds(false);
  engine_->submit();
  engine_->begin();
  ASSERT_TRUE(boundsOf(3).has_value());
  must((*engine_)->removeInstance(instances_[3]));
  instance_.pose = palettes_[7];
  instances_[3] = engine_->addInstance(instance_);
  EXPECT_FALSE(boundsOf(3).has_value()) << "not recorded";
  engine_->submit();
  EXPECT_FALSE(boundsOf(3).has_value()) << "not complete";
  engine_->begin(1);
  EXPECT_FALSE(boundsOf(3).has_value()) << "still not complete";
  EXPECT_TRUE(boundsOf(4).has_value());
  engine_->submit();
  engine_->begin();
  expectBox(boundsOf(3), boxOf(positionsIn(7)));
  engine_->submit();
}

// Culled on the GPU it may be recorded in many frames before it is seen in one.
TEST_F(SystemResultsTest, WhatTheGpuHasNotSeenYetHasNoBox) {
  openWithBounds(true);
  submit();
  engine_->begin();
  must((*engine_)->removeInstance(instances_[3]));
  instance_.pose = palettes_[7];
  instances_[3] = engine_->addInstance(instance_);
  show(10, 1);
  for (int frame = 0; frame < 3; ++frame) {
    submit();
    engine_->begin();
    EXPECT_FALSE(boundsOf(3).has_value()) << frame;
    EXPECT_TRUE(boundsOf(4).has_value()) << frame;
  }
  show(0, instanceCount);
  submit();
  engine_->begin();
  expectBox(boundsOf(3), boxOf(positionsIn(7)));
  submit();
}

// The GPU has finished frame 2 long ago, but the engine has not said so.
TEST_F(SystemResultsTest, NothingIsReadBackOfAFrameThatIsNotComplete) {
  openWithBounds(true);
  submit();
  engine_->begin();
  EXPECT_EQ((*engine_)->statistics().lastCompletedFrame.frame, 1u);
  show(0, 10);
  moveAll(100);
  submit();
  engine_->submitNow([](VkCommandBuffer) {});
  engine_->begin(1);
  ASSERT_EQ(engine_->completedFrame(), 1u);
  const SceneStatistics::Culling gpu = (*engine_)->statistics().lastCompletedFrame;
  EXPECT_EQ(gpu.frame, 1u);
  EXPECT_EQ(gpu.visibleInstances, instanceCount);
  for (std::uint32_t i = 0; i < instanceCount; ++i)
    ASSERT_NO_FATAL_FAILURE(expectBox(boundsOf(i), boxOf(positionsIn(i))));
  submit();
  engine_->begin();
  EXPECT_EQ((*engine_)->statistics().lastCompletedFrame.frame, 3u);
  expectBox(boundsOf(0), boxOf(positionsIn(100)));
  expectBox(boundsOf(10), boxOf(positionsIn(10)));
  submit();
}

// 200 instances have boxes; two of them move, and no more than their boxes are read back.
TEST_F(SystemResultsTest, OnlyWhatAFrameWritesIsReadBack) {
  constexpr std::uint32_t count = 200, moved[] = {3, 190};
  InterceptedDevice intercepted(device().description());
  CommandLog log(intercepted);
  vulkan::Context watched = must(vulkan::Context::create(intercepted.description()));
  vulkan::SceneRecorderDescription system = description();
  system.scene.boundsCapacity = Capacity::fixed(count);
  SystemEngine engine(device(), watched, system);
  engine.begin();
  instance_.mesh = engine.addMesh(packed_);
  instance_.layout = plainLayout();
  instance_.bounds = true;
  std::vector<InstanceHandle> instances;
  std::vector<PoseHandle> palettes;
  for (std::uint32_t i = 0; i < count; ++i) {
    palettes.push_back(instance_.pose = engine.addPose(systemPose(i % 20)));
    instances.push_back(engine.addInstance(instance_));
  }
  engine.submit();
  ASSERT_EQ(log.copies.back().size(), 1u);
  EXPECT_EQ(log.copies.back()[0].size, count * sizeof(InstanceResult));

  engine.begin();
  for (const std::uint32_t i : moved) engine.writePose(palettes[i], systemPose(20));
  engine.submit();
  ASSERT_EQ(log.copies.back().size(), std::size(moved));
  for (std::size_t i = 0; i < std::size(moved); ++i) {
    EXPECT_EQ(log.copies.back()[i].srcOffset, moved[i] * sizeof(InstanceResult));
    EXPECT_EQ(log.copies.back()[i].size, sizeof(InstanceResult));
  }
  engine.begin();
  engine.submit();
  for (std::uint32_t i = 0; i < count; ++i) {
    SCOPED_TRACE(i);
    const bool hasMoved = std::ranges::find(moved, i) != std::end(moved);
    expectBox(must(engine->bounds(instances[i])), boxOf(positionsIn(hasMoved ? 20 : i % 20)));
  }
}

// An instance that finds no room in the output gives back its slot among the results.
TEST_F(SystemResultsTest, AnInstanceThatIsRefusedKeepsNoSlot) {
  vulkan::SceneRecorderDescription small = description();
  small.scene.boundsCapacity = Capacity::fixed(2);
  small.scene.outputCapacity = Capacity::fixed(crowdVertices * 24);
  SystemEngine engine(device(), context(), small);
  engine.begin();
  instance_.mesh = engine.addMesh(packed_);
  instance_.pose = engine.addPose(systemPose(1));
  instance_.layout = plainLayout();
  instance_.bounds = true;
  const InstanceHandle first = engine.addInstance(instance_);
  for (int attempt = 0; attempt < 3; ++attempt) {
    const Result<InstanceHandle> refused = engine->addInstance(instance_);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::limitExceeded);
    EXPECT_NE(refused.error().message.find("bytes of output"), std::string::npos)
        << refused.error().message;
  }
  engine.submit();
  must(engine->removeInstance(first));
  engine.begin();
  instance_.pose = engine.addPose(systemPose(2));
  const InstanceHandle second = engine.addInstance(instance_);
  engine.submit();
  engine.begin();
  expectBox(must(engine->bounds(second)), boxOf(positionsIn(2)));
  engine.submit();
}

}  // namespace
}  // namespace dermis::test
