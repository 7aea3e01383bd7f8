// More instances than a budget has room for, and what happens when room comes back.

#include <gtest/gtest.h>

#include <cstring>

#include "system_test.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t meshVertices = 100;
constexpr std::uint64_t instanceSize = meshVertices * 36;  // positions, normals, previous positions

class SystemOverflowTest : public SystemTest {
 protected:
  /// Room for so many instances and a half.
  void open(std::uint32_t instances) {
    if (device_ == nullptr) return;
    vulkan::SceneRecorderDescription small = description();
    small.scene.outputCapacity = Capacity::fixed(instances * instanceSize + instanceSize / 2);
    engine_.emplace(device(), context(), small);
    engine_->begin();
    instance_.mesh = engine_->addMesh(packed_);
    instance_.layout = motionLayout();
  }
  void TearDown() override {
    engine_.reset();
    SystemTest::TearDown();
  }
  Scene& scene() { return engine_->scene(); }

  Result<InstanceHandle> tryAdd(std::uint32_t pose) {
    instance_.pose = palettes_.emplace_back(engine_->addPose(systemPose(pose)));
    must(engine_->recorder().prepare(instance_));
    return scene().addInstance(instance_);
  }
  InstanceHandle add(std::uint32_t pose) { return must(tryAdd(pose)); }
  /// A frame in which every pose is written again, shifted by so much.
  void moveAll(std::uint32_t by) {
    engine_->begin();
    for (std::uint32_t i = 0; i < palettes_.size(); ++i)
      engine_->writePose(palettes_[i], systemPose(i + by));
    engine_->submit();
  }
  void expectPose(InstanceHandle instance, const PackedMesh& mesh, std::uint32_t pose,
                  std::uint32_t before) {
    const Streams streams = engine_->read(instance);
    expectSkinned(streams, alone(mesh, systemPose(pose), instance_));
    EXPECT_TRUE(streams[previousStream] ==
                alone(mesh, systemPose(before), instance_)[positionStream]);
  }

  PackedMesh packed_ = systemMesh(1, meshVertices);
  std::optional<SystemEngine> engine_;
  InstanceDescription instance_;
  std::vector<PoseHandle> palettes_;
};

TEST_F(SystemOverflowTest, RefusedIsAsIfItHadNotBeenAskedFor) {
  open(2);
  const InstanceHandle first = add(0), second = add(1);
  const Result<InstanceHandle> third = tryAdd(2);
  ASSERT_FALSE(third.ok());
  EXPECT_EQ(third.error().code, ErrorCode::limitExceeded);
  engine_->submit();
  EXPECT_EQ(engine_->lastFrame().instances, 2u);
  expectPose(first, packed_, 0, 0);
  expectPose(second, packed_, 1, 1);
  must(scene().removePose(palettes_[2]));
}

TEST_F(SystemOverflowTest, RoomIsGivenBackOnceTheFrameIsComplete) {
  open(2);
  const InstanceHandle first = add(0);
  add(1);
  engine_->submit();
  const std::uint64_t place = must(scene().output(first)).offset;
  engine_->begin(1);
  must(scene().removeInstance(first));
  EXPECT_FALSE(tryAdd(2).ok()) << "the frame before still reads it";
  engine_->submit();
  engine_->begin(1);
  EXPECT_FALSE(tryAdd(3).ok()) << "the frame in which it was removed is not complete";
  engine_->submit();
  engine_->begin(1);
  const InstanceHandle third = add(4);
  engine_->submit();
  EXPECT_EQ(must(scene().output(third)).offset, place);
  expectPose(third, packed_, 4, 4);
}

TEST_F(SystemOverflowTest, AMeshThatIsRefusedLeavesTheOldOne) {
  open(2);
  const InstanceHandle first = add(0);
  add(1);
  engine_->submit();
  engine_->begin();
  const MeshHandle dense = engine_->addMesh(systemMesh(2, 150));
  const Result<void> changed = scene().change({.instance = first, .mesh = dense});
  ASSERT_FALSE(changed.ok());
  EXPECT_EQ(changed.error().code, ErrorCode::limitExceeded);
  must(scene().removeMesh(dense));
  engine_->submit();
  moveAll(10);
  EXPECT_EQ(must(scene().output(first)).mesh, instance_.mesh);
  expectPose(first, packed_, 10, 0);
}

// The kernel that chooses instances reads a word for each index, and keeps a record for it.
TEST_F(SystemOverflowTest, NoVisibilityIndexReachesTheInstanceBudget) {
  vulkan::SceneRecorderDescription small = description();
  small.scene.instanceCapacity = Capacity::fixed(3);
  engine_.emplace(device(), context(), small);
  engine_->begin();
  instance_.layout = motionLayout();
  instance_.culledOnGpu = true;
  std::vector<InstanceHandle> added;
  for (std::uint32_t i = 0; i < small.scene.instanceCapacity.initial; ++i) {
    instance_.mesh = engine_->addMesh(packed_);
    added.push_back(add(i));
    EXPECT_LT(must(scene().visibilityIndex(added.back())), scene().visibilityCount());
  }
  const Result<InstanceHandle> further = tryAdd(9);
  ASSERT_FALSE(further.ok());
  EXPECT_EQ(further.error().code, ErrorCode::limitExceeded);
  samples::MappedBuffer words = must(samples::MappedBuffer::create(
      device(), small.scene.instanceCapacity.initial * 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
  std::memset(words.bytes().data(), 1, words.bytes().size());
  engine_->submit(words.range());
  for (std::uint32_t i = 0; i < added.size(); ++i) expectPose(added[i], packed_, i, i);
  engine_.reset();
}

TEST_F(SystemOverflowTest, AFailedRecordChangesNothingThatIsShown) {
  open(3);
  const InstanceHandle first = add(0);
  engine_->submit();
  engine_->begin();
  const PackedMesh other = systemMesh(2, 90);
  const MeshHandle otherHandle = engine_->addMesh(other);
  instance_.culledOnGpu = true;
  must(scene().change({.instance = first, .mesh = otherHandle}));
  const InstanceOutput before = must(scene().output(first));
  add(1);  // chosen by the GPU, but by what?
  ASSERT_FALSE(engine_->trySubmit().ok());
  const InstanceOutput after = must(scene().output(first));
  EXPECT_EQ(after.mesh, instance_.mesh);
  EXPECT_EQ(after.offset, before.offset);
  EXPECT_EQ(after.places.size, before.places.size);
}

// Every switch takes room beside what is shown, and gives it back.
TEST_F(SystemOverflowTest, ALevelOfDetailMaySwitchOftenOutOfView) {
  open(3);
  const InstanceHandle gap = add(0), first = add(1);
  const PackedMesh coarse = systemMesh(2, 90);
  const MeshHandle coarseHandle = engine_->addMesh(coarse);
  engine_->submit();
  engine_->begin();
  must(scene().change({.instance = first, .visible = false}));
  must(scene().removeInstance(gap));
  engine_->submit();
  for (std::uint32_t i = 0; i < 5; ++i) {
    engine_->begin();
    must(scene().change({.instance = first, .mesh = coarseHandle}));
    engine_->submit();
    engine_->begin();
    must(scene().change({.instance = first, .mesh = instance_.mesh}));
    engine_->submit();
  }
  engine_->runFrame();
  engine_->begin();
  EXPECT_EQ(scene().statistics().outputs.used, instanceSize);
  must(scene().change({.instance = first, .mesh = coarseHandle}));
  must(scene().change({.instance = first, .mesh = instance_.mesh}));
  EXPECT_EQ(scene().compact(1 << 20), instanceSize);
  must(scene().change({.instance = first, .visible = true}));
  engine_->submit();
  EXPECT_EQ(engine_->lastFrame().movedBytes, instanceSize);
  expectPose(first, packed_, 1, 1);
}

}  // namespace
}  // namespace dermis::test
