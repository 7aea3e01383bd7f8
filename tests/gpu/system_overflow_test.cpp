// More instances than the output has room for: each policy, and what happens when room comes back.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "system_test.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t vertexCount = 100;
constexpr std::uint64_t instanceSize = vertexCount * 36;  // positions, normals, previous positions

class SystemOverflowTest : public SystemTest {
 protected:
  /// Room for so many instances and a half.
  void open(OverflowPolicy policy, std::uint32_t instances) {
    if (device_ == nullptr) return;
    vulkan::SkinningSystemDescription small = description();
    small.overflow = policy;
    small.outputBudget = instances * instanceSize + instanceSize / 2;
    engine_.emplace(device(), small);
    engine_->begin();
    instance_.mesh = engine_->addMesh(packed_);
    instance_.layout = motionLayout();
  }
  void TearDown() override {
    engine_.reset();
    SystemTest::TearDown();
  }
  vulkan::SkinningSystem& system() { return engine_->system(); }

  Result<InstanceHandle> tryAdd(std::uint32_t pose) {
    instance_.palette = palettes_.emplace_back(engine_->addPalette(systemPose(pose)));
    must(system().prepare(instance_));
    return system().addInstance(instance_);
  }
  InstanceHandle add(std::uint32_t pose) { return must(tryAdd(pose)); }
  OutputState stateOf(InstanceHandle instance) { return must(system().output(instance)).state; }
  bool wasSkinned(InstanceHandle instance) {
    return indicesOf(system().skinnedInstances()).contains(instance.index);
  }
  /// A frame in which every pose is written again, shifted by so much.
  void moveAll(std::uint32_t by) {
    engine_->begin();
    for (std::uint32_t i = 0; i < palettes_.size(); ++i)
      engine_->writePose(palettes_[i], systemPose(i + by));
    engine_->submit();
  }
  void expectPose(InstanceHandle instance, const PackedMesh& mesh, std::uint32_t pose,
                  std::uint32_t before) {
    EXPECT_EQ(stateOf(instance), OutputState::own);
    const Streams streams = engine_->read(instance);
    expectSkinned(streams, alone(mesh, systemPose(pose), instance_));
    EXPECT_TRUE(streams[previousStream] ==
                alone(mesh, systemPose(before), instance_)[positionStream]);
  }
  void expectBindPose(InstanceHandle instance, std::uint32_t meshSeed, std::uint32_t vertices) {
    const OwnedMesh mesh = randomMesh(meshSeed, vertices, 8, 4);
    const Streams streams = engine_->read(instance);
    ASSERT_EQ(streams[positionStream].size(), mesh.positions.size() * 4);
    EXPECT_EQ(std::memcmp(streams[positionStream].data(), mesh.positions.data(),
                          streams[positionStream].size()),
              0);
    EXPECT_TRUE(streams[previousStream] == streams[positionStream]);
    std::vector<float> normals(mesh.normals.size());
    ASSERT_EQ(streams[normalStream].size(), normals.size() * 4);
    std::memcpy(normals.data(), streams[normalStream].data(), streams[normalStream].size());
    for (std::size_t i = 0; i < normals.size(); ++i)
      ASSERT_NEAR(normals[i], mesh.normals[i], 1e-6f) << "made unit length once more";
  }

  PackedMesh packed_ = systemMesh(1, vertexCount);
  std::optional<SystemEngine> engine_;
  InstanceDescription instance_;
  std::vector<PaletteHandle> palettes_;
};

TEST_F(SystemOverflowTest, RefusedIsAsIfItHadNotBeenAskedFor) {
  open(OverflowPolicy::refuse, 2);
  const InstanceHandle first = add(0), second = add(1);
  const Result<InstanceHandle> third = tryAdd(2);
  ASSERT_FALSE(third.ok());
  EXPECT_EQ(third.error().code, ErrorCode::limitExceeded);
  engine_->submit();
  EXPECT_EQ(engine_->lastFrame().instances, 2u);
  EXPECT_EQ(engine_->lastFrame().waitingInstances, 0u);
  expectPose(first, packed_, 0, 0);
  expectPose(second, packed_, 1, 1);
  must(system().removePalette(palettes_[2]));
}

TEST_F(SystemOverflowTest, RoomIsGivenBackOnceTheFrameIsComplete) {
  open(OverflowPolicy::refuse, 2);
  const InstanceHandle first = add(0);
  add(1);
  engine_->submit();
  const std::uint64_t place = must(system().output(first)).offset;
  engine_->begin(1);
  must(system().removeInstance(first));
  EXPECT_FALSE(tryAdd(2).ok()) << "the frame before still reads it";
  engine_->submit();
  engine_->begin(1);
  EXPECT_FALSE(tryAdd(3).ok()) << "the frame in which it was removed is not complete";
  engine_->submit();
  engine_->begin(1);
  const InstanceHandle third = add(4);
  engine_->submit();
  EXPECT_EQ(must(system().output(third)).offset, place);
  expectPose(third, packed_, 4, 4);
}

TEST_F(SystemOverflowTest, AMeshThatIsRefusedLeavesTheOldOne) {
  open(OverflowPolicy::refuse, 2);
  const InstanceHandle first = add(0);
  add(1);
  engine_->submit();
  engine_->begin();
  const MeshHandle dense = engine_->addMesh(systemMesh(2, 150));
  const Result<void> changed = system().setMesh(first, dense);
  ASSERT_FALSE(changed.ok());
  EXPECT_EQ(changed.error().code, ErrorCode::limitExceeded);
  must(system().removeMesh(dense));
  engine_->submit();
  moveAll(10);
  EXPECT_EQ(must(system().output(first)).mesh, instance_.mesh);
  expectPose(first, packed_, 10, 0);
}

TEST_F(SystemOverflowTest, ANewInstanceWaitsWithNothing) {
  open(OverflowPolicy::keepLast, 2);
  const InstanceHandle first = add(0), second = add(1), third = add(2);
  engine_->submit();
  EXPECT_EQ(stateOf(third), OutputState::none);
  EXPECT_EQ(engine_->lastFrame().instances, 3u);
  EXPECT_EQ(engine_->lastFrame().waitingInstances, 1u);
  EXPECT_EQ(engine_->lastFrame().skinnedInstances, 2u);
  moveAll(10);
  EXPECT_FALSE(wasSkinned(third));
  expectPose(second, packed_, 11, 1);
  engine_->begin();
  must(system().removeInstance(first));
  engine_->submit();
  EXPECT_EQ(stateOf(third), OutputState::none) << "a frame under way may still read what was";
  engine_->runFrame();
  EXPECT_EQ(engine_->lastFrame().waitingInstances, 0u);
  EXPECT_TRUE(wasSkinned(third));
  expectPose(third, packed_, 12, 12);
  moveAll(20);
  expectPose(third, packed_, 22, 12);
}

TEST_F(SystemOverflowTest, WaitingInstancesCanBeRemovedAndChanged) {
  open(OverflowPolicy::keepLast, 2);
  const InstanceHandle first = add(0);
  add(1);
  const InstanceHandle third = add(2), fourth = add(3);
  engine_->submit();
  engine_->begin();
  must(system().removeInstance(third));
  must(system().setVisible(fourth, false));
  must(system().removeInstance(first));
  engine_->submit();
  engine_->runFrame();
  engine_->begin();
  must(system().setVisible(fourth, true));
  const MorphWeight morph{0, 1};
  must(system().setMorphWeights(fourth, {&morph, 1}));
  engine_->submit();
  EXPECT_EQ(stateOf(fourth), OutputState::own);
  EXPECT_TRUE(engine_->read(fourth) == alone(packed_, systemPose(3), instance_, {&morph, 1}));
}

TEST_F(SystemOverflowTest, AChangedMeshWaitsWithTheLastResult) {
  open(OverflowPolicy::keepLast, 2);
  const InstanceHandle first = add(0), second = add(1);
  engine_->submit();
  const PackedMesh dense = systemMesh(2, 90);
  engine_->begin();
  const MeshHandle denseHandle = engine_->addMesh(dense);
  must(system().setMesh(first, denseHandle));
  engine_->submit();
  for (std::uint32_t i = 0; i < 3; ++i) {
    const InstanceOutput output = must(system().output(first));
    EXPECT_EQ(output.state, OutputState::last);
    EXPECT_EQ(output.mesh, instance_.mesh);
    EXPECT_FALSE(wasSkinned(first));
    EXPECT_EQ(engine_->lastFrame().waitingInstances, 1u);
    expectSkinned(engine_->read(first), alone(packed_, systemPose(0), instance_));
    moveAll(10 + i);
  }
  engine_->begin();
  must(system().removeInstance(second));
  engine_->submit();
  engine_->runFrame();
  EXPECT_EQ(must(system().output(first)).mesh, denseHandle);
  expectPose(first, dense, 12, 12);
}

TEST_F(SystemOverflowTest, TheLastResultComesToRest) {
  open(OverflowPolicy::keepLast, 2);
  const InstanceHandle first = add(0);
  add(1);
  engine_->submit();
  moveAll(10);
  engine_->begin();
  must(system().setMesh(first, engine_->addMesh(systemMesh(2, 90))));
  engine_->submit();
  const Streams streams = engine_->read(first);
  EXPECT_TRUE(streams[positionStream] == alone(packed_, systemPose(10), instance_)[positionStream]);
  EXPECT_TRUE(streams[previousStream] == streams[positionStream]) << "it moves no longer";
}

// The old mesh is needed no longer, but nothing of it either: its last result stands in the output.
TEST_F(SystemOverflowTest, ChangingBackEndsTheWait) {
  open(OverflowPolicy::keepLast, 2);
  const InstanceHandle first = add(0);
  add(1);
  engine_->submit();
  engine_->begin();
  must(system().setMesh(first, engine_->addMesh(systemMesh(2, 90))));
  engine_->submit();
  engine_->begin();
  must(system().setMesh(first, instance_.mesh));
  engine_->submit();
  // Its old place is its own again, or will be as soon as there is room.
  engine_->runFrame();
  moveAll(10);
  EXPECT_EQ(stateOf(first), OutputState::own);
  EXPECT_TRUE(engine_->read(first)[positionStream] ==
              alone(packed_, systemPose(10), instance_)[positionStream]);
}

TEST_F(SystemOverflowTest, WaitingInstancesShareTheBindPose) {
  open(OverflowPolicy::bindPose, 3);
  const InstanceHandle first = add(0), second = add(1), third = add(2), fourth = add(3);
  engine_->submit();
  EXPECT_EQ(stateOf(first), OutputState::own);
  EXPECT_EQ(stateOf(second), OutputState::own);
  EXPECT_EQ(engine_->lastFrame().waitingInstances, 2u);
  for (const InstanceHandle waiting : {third, fourth}) {
    EXPECT_EQ(stateOf(waiting), OutputState::bindPose);
    EXPECT_EQ(must(system().output(waiting)).mesh, instance_.mesh);
    ASSERT_NO_FATAL_FAILURE(expectBindPose(waiting, 1, vertexCount));
  }
  EXPECT_EQ(must(system().output(third)).offset, must(system().output(fourth)).offset);
  moveAll(10);
  ASSERT_NO_FATAL_FAILURE(expectBindPose(third, 1, vertexCount));
  expectPose(second, packed_, 11, 1);
  engine_->begin();
  must(system().removeInstance(first));
  engine_->submit();
  engine_->runFrame();
  EXPECT_EQ(engine_->lastFrame().waitingInstances, 1u);
  const bool isThird = stateOf(third) == OutputState::own;
  expectPose(isThird ? third : fourth, packed_, isThird ? 12 : 13, isThird ? 12 : 13);
  ASSERT_NO_FATAL_FAILURE(expectBindPose(isThird ? fourth : third, 1, vertexCount));
}

TEST_F(SystemOverflowTest, AMeshWithoutRoomForItsBindPoseIsRefused) {
  open(OverflowPolicy::bindPose, 3);
  const InstanceHandle first = add(0);
  add(1);
  engine_->submit();
  engine_->begin();
  const MeshHandle dense = engine_->addMesh(systemMesh(2, 90));
  const Result<void> changed = system().setMesh(first, dense);
  ASSERT_FALSE(changed.ok());
  EXPECT_EQ(changed.error().code, ErrorCode::limitExceeded);
  InstanceDescription other = instance_;
  other.mesh = dense;
  must(system().prepare(other));
  EXPECT_FALSE(system().addInstance(other).ok());
  engine_->submit();
  moveAll(10);
  expectPose(first, packed_, 10, 0);
}

TEST_F(SystemOverflowTest, AChangedMeshWaitsInItsBindPose) {
  open(OverflowPolicy::bindPose, 4);  // two bind poses, two instances
  const InstanceHandle first = add(0);
  engine_->submit();
  engine_->begin();
  const PackedMesh other = systemMesh(2, vertexCount);
  const MeshHandle otherHandle = engine_->addMesh(other);
  InstanceDescription beside = instance_;
  beside.mesh = otherHandle;
  const InstanceHandle second = engine_->addInstance(beside);
  must(system().setMesh(first, otherHandle));
  engine_->submit();
  const InstanceOutput output = must(system().output(first));
  EXPECT_EQ(output.state, OutputState::bindPose);
  EXPECT_EQ(output.mesh, otherHandle);
  ASSERT_NO_FATAL_FAILURE(expectBindPose(first, 2, vertexCount));
  engine_->begin();
  must(system().removeInstance(second));
  engine_->submit();
  engine_->runFrame();
  engine_->runFrame();
  expectPose(first, other, 0, 0);
}

// Room for the bind pose goes with the last instance of the mesh.
TEST_F(SystemOverflowTest, TheBindPoseGoesWithItsMesh) {
  open(OverflowPolicy::bindPose, 2);
  const InstanceHandle first = add(0);
  engine_->submit();
  engine_->begin();
  must(system().removeInstance(first));
  must(system().removeMesh(instance_.mesh));
  engine_->submit();
  engine_->runFrame();
  engine_->begin();
  EXPECT_EQ(system().statistics().outputs.used, 0u);
  const PackedMesh other = systemMesh(2, vertexCount);
  instance_.mesh = engine_->addMesh(other);
  const InstanceHandle second = add(5);
  engine_->submit();
  expectPose(second, other, 5, 5);
}

}  // namespace
}  // namespace dermis::test
