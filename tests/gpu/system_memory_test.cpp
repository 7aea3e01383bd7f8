// Where a system has its memory from, and that it gives all of it back, whatever fails on the way.

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

#include "command_log.h"
#include "counting_memory.h"
#include "system_test.h"

namespace dermis::test {
namespace {

using vulkan::BufferUse;
using vulkan::SceneRecorder;

class SystemMemoryTest : public SystemTest {
 protected:
  /// Everything for which a system may want memory: culling, bounds, copies of many frames.
  void use(SystemEngine& engine) {
    const samples::MappedBuffer visibility = must(samples::MappedBuffer::create(
        device(), engine->visibilityCount() * 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
    const PackedMesh packed = systemMesh(1, 100);
    engine.begin();
    InstanceDescription instance;
    instance.layout = motionLayout();
    instance.bounds = true;
    instance.mesh = engine.addMesh(packed);
    instance.pose = engine.addPose(systemPose(1));
    for (int frame = 0; frame < 4; ++frame) {
      if (frame != 0) engine.begin(1);
      for (int i = 0; i < 40; ++i) {
        instance.culledOnGpu = i % 2 == 0;
        engine.addInstance(instance);
      }
      engine.writePose(instance.pose, systemPose(2));
      engine.submit(visibility.range());
    }
    engine.finish();
  }
};

// Otherwise no test would notice what is not cleared.
TEST_F(SystemMemoryTest, NewMemoryIsNotZero) {
  VkPhysicalDeviceMemoryProperties memory{};
  device().functions().GetPhysicalDeviceMemoryProperties(device().physicalDevice(), &memory);
  if ((memory.memoryTypes[0].propertyFlags & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT) == 0)
    GTEST_SKIP() << "the CPU cannot write all of it";
  SystemEngine engine(device(), context(), description());
  const std::vector<std::byte> bytes = engine.readOutput();
  EXPECT_TRUE(std::ranges::all_of(bytes, [](std::byte byte) { return byte == std::byte{0xa5}; }));
}

TEST_F(SystemMemoryTest, AllThatTheEngineGivesComesBack) {
  CountingMemory memory(device());
  vulkan::SceneRecorderDescription own = description();
  own.buffers = memory.callbacks();
  {
    SystemEngine engine(device(), context(), own);
    EXPECT_GE(memory.bytes, own.scene.meshCapacity.initial + own.scene.outputCapacity.initial)
        << "taken when it is made";
    use(engine);
    EXPECT_EQ(engine.recorder().statistics().deviceMemory, memory.bytes);
  }
  EXPECT_GT(memory.allocations, 0u);
  EXPECT_EQ(memory.allocations, memory.frees);
  EXPECT_EQ(memory.bytes, 0u);
  EXPECT_TRUE(memory.uses.contains(BufferUse::device));
  EXPECT_TRUE(memory.uses.contains(BufferUse::upload));
  for (const std::string& name : memory.names) EXPECT_TRUE(name.starts_with("dermis ")) << name;
}

TEST_F(SystemMemoryTest, AllocatorsThatFailLeaveNothingBehind) {
  InterceptedDevice intercepted(device().description());
  CommandLog log(intercepted);
  vulkan::Context watched = must(vulkan::Context::create(intercepted.description()));
  bool succeeded = false;
  for (std::uint32_t failsAt = 0; !succeeded && failsAt < 100; ++failsAt) {
    CountingMemory memory(device());
    memory.failsAt = failsAt;
    vulkan::SceneRecorderDescription own = description();
    own.buffers = memory.callbacks();
    {
      const Result<SceneRecorder> system = SceneRecorder::create(watched, own);
      succeeded = system.ok();
      if (!succeeded) {
        EXPECT_EQ(system.error().code, ErrorCode::ioError);
        EXPECT_EQ(system.error().message, "the engine's allocator has had enough");
        EXPECT_EQ(system.error().vulkanResult, 7);
      }
    }
    EXPECT_EQ(memory.allocations, failsAt);
    EXPECT_EQ(memory.frees, failsAt);
    EXPECT_EQ(log.buffersAlive, 0);
  }
  EXPECT_TRUE(succeeded);
}

TEST_F(SystemMemoryTest, VulkanCallsThatFailLeaveNothingBehind) {
  InterceptedDevice intercepted(device().description());
  CommandLog log(intercepted);
  vulkan::Context watched = must(vulkan::Context::create(intercepted.description()));
  vulkan::SceneRecorderDescription system = description();
  system.measuresGpuTime = true;
  for (const char* function : {"vkCreateBuffer", "vkAllocateMemory", "vkBindBufferMemory",
                               "vkMapMemory", "vkCreateQueryPool"}) {
    log.failures = {{function, VK_ERROR_OUT_OF_DEVICE_MEMORY}};
    const Result<SceneRecorder> made = SceneRecorder::create(watched, system);
    ASSERT_FALSE(made.ok()) << function;
    EXPECT_EQ(made.error().code, ErrorCode::vulkanError) << function;
    EXPECT_EQ(made.error().vulkanResult, VK_ERROR_OUT_OF_DEVICE_MEMORY) << function;
    EXPECT_NE(made.error().message.find(function), std::string::npos) << made.error().message;
    EXPECT_EQ(log.buffersAlive, 0) << function;
    EXPECT_EQ(log.allocationsAlive, 0) << function;
  }
  log.failures.clear();
  EXPECT_TRUE(SceneRecorder::create(watched, system).ok());
}

TEST_F(SystemMemoryTest, AnAllocatorThatGivesNothingIsToldAndGetsNothingBack) {
  static int destroyed;
  destroyed = 0;
  vulkan::SceneRecorderDescription own = description();
  own.buffers.create = [](void*, const VkBufferCreateInfo&, vulkan::BufferUse, const char*) {
    return Result(vulkan::CreatedBuffer{});
  };
  own.buffers.destroy = [](void*, const vulkan::CreatedBuffer&) { ++destroyed; };
  const Result<SceneRecorder> system = SceneRecorder::create(context(), own);
  ASSERT_FALSE(system.ok());
  EXPECT_NE(system.error().message.find("returned no buffer for 'dermis "), std::string::npos)
      << system.error().message;
  EXPECT_EQ(destroyed, 0);
}

// An allocator that fails in the middle of a game, at each allocation for a frame whose tables have
// outgrown their buffers, and which is the first of its slot: nothing is recorded, and all is tried
// again.
TEST_F(SystemMemoryTest, AFrameWithoutMemoryIsTriedAgain) {
  InterceptedDevice intercepted(device().description());
  CommandLog log(intercepted);
  vulkan::Context watched = must(vulkan::Context::create(intercepted.description()));
  CountingMemory memory(device());
  vulkan::SceneRecorderDescription own = description();
  own.buffers = memory.callbacks();
  SystemEngine engine(device(), watched, own);
  const PackedMesh packed = systemMesh(1, 20);
  engine.begin();
  InstanceDescription instance;
  instance.layout = motionLayout();
  instance.mesh = engine.addMesh(packed);
  instance.pose = engine.addPose(systemPose(1));
  std::vector<InstanceHandle> instances{engine.addInstance(instance)};
  engine.submit();
  engine.begin();
  engine.writePose(instance.pose, systemPose(2));
  while (instances.size() < 3000) instances.push_back(must(engine->addInstance(instance)));
  const std::uint32_t before = memory.allocations;
  for (std::uint32_t failed = 0; failed < 2; ++failed) {
    memory.failsAt = before + failed;
    log.calls.clear();
    const Result<void> recorded = engine.trySubmit();
    ASSERT_FALSE(recorded.ok()) << failed;
    EXPECT_EQ(recorded.error().code, ErrorCode::ioError);
    EXPECT_EQ(recorded.error().message, "the engine's allocator has had enough");
    for (const auto& [name, count] : log.calls)
      EXPECT_FALSE(name.starts_with("vkCmd")) << name << " was recorded";
    engine.begin();
  }
  memory.failsAt = ~0u;
  engine.submit();
  EXPECT_EQ(memory.allocations, before + 2) << "what the failed frames took was kept";
  EXPECT_EQ(engine.lastFrame().skinnedInstances, 3000u);
  const std::vector<std::byte> bytes = engine.readOutput();
  const Streams expected = alone(packed, systemPose(2), instance);
  for (const InstanceHandle handle : instances)
    ASSERT_TRUE(engine.read(bytes, handle)[positionStream] == expected[positionStream]);
}

TEST_F(SystemMemoryTest, MemoryOfItsOwnIsTakenInFewBlocks) {
  InterceptedDevice intercepted(device().description());
  CommandLog log(intercepted);
  vulkan::Context watched = must(vulkan::Context::create(intercepted.description()));
  vulkan::SceneRecorderDescription system = description();
  {
    SystemEngine engine(device(), watched, system);
    use(engine);
    EXPECT_LE(log.count("vkAllocateMemory"), 6u);
    EXPECT_LE(engine.recorder().statistics().deviceMemory, log.allocatedBytes);
    EXPECT_GE(engine.recorder().statistics().deviceMemory,
              system.scene.meshCapacity.initial + system.scene.outputCapacity.initial);
  }
  EXPECT_EQ(log.buffersAlive, 0);
  EXPECT_EQ(log.allocationsAlive, 0);
}

TEST_F(SystemMemoryTest, BuffersTakenAndGivenBackForeverNeedNoMoreMemory) {
  InterceptedDevice intercepted(device().description());
  CommandLog log(intercepted);
  vulkan::Context watched = must(vulkan::Context::create(intercepted.description()));
  vulkan::SceneRecorderDescription system = description();
  SystemEngine engine(device(), watched, system);
  const PackedMesh packed = systemMesh(1, 100);
  std::uint32_t allocations = 0;
  for (int round = 0; round < 60; ++round) {
    engine.begin(1);
    InstanceDescription instance;
    instance.layout = motionLayout();
    instance.mesh = engine.addMesh(packed);
    instance.pose = engine.addPose(systemPose(1));
    std::vector<InstanceHandle> instances;
    for (int i = 0; i < 50; ++i) instances.push_back(engine.addInstance(instance));
    engine.submit();
    engine.begin(1);
    for (const InstanceHandle handle : instances) must(engine->removeInstance(handle));
    must(engine->removePose(instance.pose));
    must(engine->removeMesh(instance.mesh));
    engine.submit();
    if (round == 10) allocations = log.count("vkAllocateMemory");
  }
  EXPECT_EQ(log.count("vkAllocateMemory"), allocations);
  engine.runFrame();
  engine.begin();
  const SceneStatistics statistics = engine->statistics();
  EXPECT_EQ(statistics.meshes.used, 0u);
  EXPECT_EQ(statistics.palettes.used, 0u);
  EXPECT_EQ(statistics.outputs.used, 0u);
  for (const SceneStatistics::Store& store :
       {statistics.meshes, statistics.palettes, statistics.outputs})
    EXPECT_EQ(store.largestFree, store.capacity);
}

TEST_F(SystemMemoryTest, StatisticsAddUp) {
  SingleInstance one(device(), context(), description(), motionLayout());
  const SceneStatistics statistics = one.engine->statistics();
  EXPECT_EQ(statistics.meshes.used, one.packed.bytes().size());
  EXPECT_EQ(statistics.outputs.used, 100u * 36);
  EXPECT_GE(statistics.outputs.capacity, 4u << 20);
  EXPECT_GE(statistics.meshes.capacity, 4u << 20);
  for (const SceneStatistics::Store& store :
       {statistics.meshes, statistics.palettes, statistics.outputs}) {
    EXPECT_GT(store.used, 0u);
    EXPECT_LE(store.used + store.largestFree, store.capacity);
  }
  one.engine.submit();
  EXPECT_EQ(one.engine.lastFrame().frame, 1u);
  EXPECT_GE(one.engine.lastFrame().uploadedBytes, one.packed.bytes().size() + 8 * 48);
}

}  // namespace
}  // namespace dermis::test
