// Systems on devices with narrow limits, and outputs that are larger than a storage buffer range.
// Where it can be, the device is only made to look narrow: the validation layer sees every command
// all the same.

#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "command_log.h"
#include "system_test.h"

namespace dermis::test {
namespace {

/// Instances of two meshes in an engine, to be compared with each alone.
class SystemLimitsTest : public SystemTest {
 protected:
  struct Member {
    InstanceHandle handle;
    InstanceDescription description;
    PoseHandle poseHandle;
    std::uint32_t mesh = 0, pose = 0;
  };
  void addCrowd(SystemEngine& engine, std::uint32_t count, const VertexLayout& layout) {
    std::vector<MeshHandle> handles;
    for (const PackedMesh& mesh : meshes_) handles.push_back(engine.addMesh(mesh));
    for (std::uint32_t i = 0; i < count; ++i) {
      Member member;
      member.mesh = i % 2;
      member.pose = i % 10;
      member.poseHandle = engine.addPose(systemPose(member.pose));
      member.description.mesh = handles[member.mesh];
      member.description.pose = member.poseHandle;
      member.description.layout = layout;
      member.description.method = i % 3 == 0 ? Method::linear : Method::dualQuaternion;
      member.handle = engine.addInstance(member.description);
      crowd_.push_back(member);
    }
  }
  void moveCrowd(SystemEngine& engine, std::uint32_t by) {
    engine.begin();
    for (Member& member : crowd_) {
      member.pose += by;
      engine.writePose(member.poseHandle, systemPose(member.pose));
    }
    engine.submit();
  }
  void expectCrowd(SystemEngine& engine) {
    const std::vector<std::byte> bytes = engine.readOutput();
    for (const Member& member : crowd_) {
      SCOPED_TRACE(member.handle.index);
      expectSkinned(engine.read(bytes, member.handle), expected(member));
    }
  }
  /// Instances of the second mesh that the GPU chooses, all of them, in this frame and the next.
  void expectCulledCrowd(SystemEngine& engine, int count) {
    InstanceDescription instance;
    instance.layout = plainLayout();
    instance.culledOnGpu = true;
    instance.mesh = engine.addMesh(meshes_[1]);
    instance.pose = engine.addPose(systemPose(1));
    std::vector<InstanceHandle> instances;
    for (int i = 0; i < count; ++i) instances.push_back(engine.addInstance(instance));
    const samples::MappedBuffer words = must(samples::MappedBuffer::create(
        device(), engine->visibilityCount() * 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
    std::ranges::fill(words.bytes(), std::byte{1});
    for (const std::uint32_t pose : {1u, 2u}) {
      if (pose != 1) engine.begin(1);
      engine.writePose(instance.pose, systemPose(pose));
      engine.submit(words.range());
    }
    const std::vector<std::byte> bytes = engine.readOutput();
    const Streams expected = alone(meshes_[1], systemPose(2), instance);
    for (const InstanceHandle handle : instances)
      expectSkinned(engine.read(bytes, handle), expected);
    engine.finish();
  }
  const Streams& expected(const Member& member) {
    Streams& streams = expected_[{member.mesh, member.pose, member.description.method}];
    if (streams[positionStream].empty())
      streams = alone(meshes_[member.mesh], systemPose(member.pose), member.description);
    return streams;
  }

  std::vector<PackedMesh> meshes_{systemMesh(1, 1234), systemMesh(2, 70)};
  std::vector<Member> crowd_;
  std::map<std::tuple<std::uint32_t, std::uint32_t, Method>, Streams> expected_;
};

TEST_F(SystemLimitsTest, OutputLargerThanARangeThatIsNarrow) {
  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    if (device_ == nullptr) return;
    for (const bool planar : {false, true}) {
      if (!pushDescriptors && planar) continue;  // DeviceLimits::separateRanges
      InterceptedDevice small(device().description());
      small.changeLimits(
          [](VkPhysicalDeviceLimits& limits) { limits.maxStorageBufferRange = 256 << 10; });
      vulkan::Context narrow = must(vulkan::Context::create(small.description()));
      vulkan::SceneRecorderDescription system = description();
      system.scene.meshCapacity = Capacity::fixed(192 << 10);
      system.scene.jointCapacity = Capacity::fixed(1024);
      system.scene.outputCapacity = Capacity::fixed(2 << 20);
      SystemEngine engine(device(), narrow, system);
      engine.begin();
      VertexLayout layout = motionLayout();
      layout.planar = planar;
      crowd_.clear();
      addCrowd(engine, 60, layout);
      engine.submit();
      EXPECT_GT(engine.lastFrame().dispatches, 5u) << "one a range, at least";
      expectCrowd(engine);
      moveCrowd(engine, 10);
      expectCrowd(engine);
    }
  }
}

TEST_F(SystemLimitsTest, OutputLargerThanTheDevicesRange) {
  const std::uint64_t range = context().limits().maxStorageBufferRange;
  if (range > std::uint64_t{256} << 20) GTEST_SKIP() << "it would take too much memory";
  vulkan::SceneRecorderDescription large = description();
  large.scene.outputCapacity = Capacity::fixed(range + range / 2);
  const std::uint32_t vertexCount = 200'000;
  const PackedMesh packed = systemMesh(3, vertexCount, 8, 1);
  large.scene.meshCapacity = Capacity::fixed(packed.bytes().size() + 4096);
  SystemEngine engine(device(), context(), large);
  engine.begin();
  InstanceDescription instance;
  instance.layout = plainLayout();
  instance.mesh = engine.addMesh(packed);
  instance.pose = engine.addPose(systemPose(1));
  std::vector<InstanceHandle> instances;
  const std::uint64_t size = std::uint64_t{vertexCount} * 24;
  while ((instances.size() + 1) * size <= large.scene.outputCapacity.initial)
    instances.push_back(engine.addInstance(instance));
  engine.submit();
  EXPECT_EQ(engine.lastFrame().skinnedInstances, instances.size());
  std::uint64_t last = 0;
  const std::vector<std::byte> bytes = engine.readOutput();
  const Streams expected = alone(packed, systemPose(1), instance);
  for (const InstanceHandle handle : instances) {
    last = std::max(last, must(engine->output(handle)).offset);
    expectSkinned(engine.read(bytes, handle), expected);
  }
  EXPECT_GT(last, range);
}

// What is culled on the GPU has indirect dispatches, one a range too.
TEST_F(SystemLimitsTest, CullingOnTheGpuReachesEveryRange) {
  InterceptedDevice small(device().description());
  small.changeLimits(
      [](VkPhysicalDeviceLimits& limits) { limits.maxStorageBufferRange = 256 << 10; });
  vulkan::Context narrow = must(vulkan::Context::create(small.description()));
  vulkan::SceneRecorderDescription system = description();
  system.scene.meshCapacity = Capacity::fixed(192 << 10);
  system.scene.jointCapacity = Capacity::fixed(1024);
  system.scene.outputCapacity = Capacity::fixed(600 * 70 * 24 + (1 << 16));
  SystemEngine engine(device(), narrow, system);
  engine.begin();
  expectCulledCrowd(engine, 600);
}

TEST_F(SystemLimitsTest, CullingOnTheGpuNeedsNoInstancesAtFirst) {
  vulkan::SceneRecorderDescription system = description();
  system.scene.instanceCapacity = {0};
  SystemEngine engine(device(), context(), system);
  engine.begin();
  expectCulledCrowd(engine, 5);
}

TEST_F(SystemLimitsTest, WorkgroupsAreFoldedWhereADimensionIsShort) {
  InterceptedDevice small(device().description());
  small.changeLimits(
      [](VkPhysicalDeviceLimits& limits) { limits.maxComputeWorkGroupCount[0] = 13; });
  vulkan::Context narrow = must(vulkan::Context::create(small.description()));
  vulkan::SceneRecorderDescription system = description();
  system.tuning = Tuning{32, 1};  // more than 13 workgroups in each dispatch
  SystemEngine engine(device(), narrow, system);
  engine.begin();
  addCrowd(engine, 30, motionLayout());
  engine.submit();
  expectCrowd(engine);
  engine.runFrame();
  moveCrowd(engine, 5);
  expectCrowd(engine);
}

// So few that rows are folded, and what drivers say that have no limit.
TEST_F(SystemLimitsTest, CullingOnTheGpuCountsWorkgroupsOnEveryDevice) {
  for (const std::uint32_t most : {13u, 0xffffffffu}) {
    SCOPED_TRACE(most);
    InterceptedDevice patched(device().description());
    patched.changeLimits([=](VkPhysicalDeviceLimits& limits) {
      limits.maxComputeWorkGroupCount[0] = limits.maxComputeWorkGroupCount[1] = most;
    });
    vulkan::Context patchedContext = must(vulkan::Context::create(patched.description()));
    vulkan::SceneRecorderDescription system = description();
    system.tuning = Tuning{32, 1};
    SystemEngine engine(device(), patchedContext, system);
    engine.begin();
    expectCulledCrowd(engine, 20);
    engine.begin();
    EXPECT_EQ(engine->statistics().lastCompletedFrame.workgroups, 3u * 20u);
  }
}

TEST_F(SystemLimitsTest, FourStorageBuffersAreEnough) {
  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    if (device_ == nullptr) return;
    InterceptedDevice small(device().description());
    small.changeLimits(
        [](VkPhysicalDeviceLimits& limits) { limits.maxPerStageDescriptorStorageBuffers = 4; });
    vulkan::Context narrow = must(vulkan::Context::create(small.description()));
    vulkan::SceneRecorderDescription system = description();
    SystemEngine engine(device(), narrow, system);
    engine.begin();
    crowd_.clear();
    addCrowd(engine, 20, motionLayout());
    engine.submit();
    expectCrowd(engine);
    InstanceDescription bounded = crowd_[0].description;
    bounded.bounds = true;
    const Result<InstanceHandle> refused = engine->addInstance(bounded);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::limitExceeded) << refused.error().message;
    engine.begin();
    expectCulledCrowd(engine, 30);
  }
}

TEST_F(SystemLimitsTest, RunsThatAreNotWholeWordsAreRefused) {
  SingleInstance one(device(), context(), description(), plainLayout());
  InstanceDescription halves = one.description;
  halves.layout.positions = VertexFormat::float16x3;
  const Result<InstanceHandle> refused = one.engine->addInstance(halves);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("use float16x4"), std::string::npos)
      << refused.error().message;
  one.engine.submit();
}

TEST_F(SystemLimitsTest, DescriptorsWithoutPushing) {
  useDevice(false);
  if (device_ == nullptr) return;
  SystemEngine engine(device(), context(), description());
  engine.begin();
  addCrowd(engine, 30, motionLayout());
  engine.submit();
  expectCrowd(engine);
  for (std::uint32_t frame = 0; frame < 5; ++frame) moveCrowd(engine, 1);
  expectCrowd(engine);
  engine.begin();
  expectCulledCrowd(engine, 30);
}

TEST_F(SystemLimitsTest, AnyTuningGivesTheSameBits) {
  for (const Tuning tuning : {Tuning{8, 1}, Tuning{32, 5, 1000}, Tuning{128, 16}}) {
    vulkan::SceneRecorderDescription system = description();
    system.tuning = tuning;
    SystemEngine engine(device(), context(), system);
    engine.begin();
    crowd_.clear();
    addCrowd(engine, 20, motionLayout());
    engine.submit();
    expectCrowd(engine);
  }
}

// The engine's names and labels, where it enabled them, are no trouble to the validation layer, and
// the statistics count what is really recorded.
TEST_F(SystemLimitsTest, StatisticsCountTheCommandsThatThereAre) {
  InterceptedDevice intercepted(device().description());
  CommandLog log(intercepted);
  vulkan::Context watched = must(vulkan::Context::create(intercepted.description()));
  vulkan::SceneRecorderDescription system = description();
  SystemEngine engine(device(), watched, system);
  for (int frame = 0; frame < 4; ++frame) {
    engine.begin();
    if (frame % 2 == 0) addCrowd(engine, 10, motionLayout());
    log.calls.clear();
    engine.submit();
    const LastFrame statistics = engine.lastFrame();
    EXPECT_EQ(statistics.dispatches,
              log.count("vkCmdDispatch") + log.count("vkCmdDispatchIndirect"));
    EXPECT_EQ(statistics.copies, log.count("vkCmdCopyBuffer"));
    EXPECT_TRUE(frame % 2 == 0 || log.count("vkCmdPipelineBarrier") == 0) << "nothing changed";
  }
}

}  // namespace
}  // namespace dermis::test
