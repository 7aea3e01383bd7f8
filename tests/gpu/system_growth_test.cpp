// Buffers that grow, ranges of the engine's, and poses from the GPU.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "command_log.h"
#include "kit/buffer.h"
#include "system_test.h"

namespace dermis::test {
namespace {

using vulkan::BufferRange;
using vulkan::SceneRecorder;
using vulkan::SceneRecorderDescription;

class SystemGrowthTest : public SystemTest {
 protected:
  /// A system in which nearly nothing has room.
  SceneRecorderDescription tiny() {
    SceneRecorderDescription tiny = description();
    tiny.scene.meshCapacity = {16};
    tiny.scene.jointCapacity = {1};
    tiny.scene.gpuJointCapacity = {0};
    tiny.scene.outputCapacity = {4};
    tiny.scene.instanceCapacity = {1};
    tiny.scene.boundsCapacity = {0};
    return tiny;
  }
};

TEST_F(SystemGrowthTest, ASceneOfOneCharacterTakesLessThanAMebibyte) {
  SceneRecorderDescription defaults;
  const PackedMesh character = systemMesh(1, 3273, 19);
  SystemEngine engine(device(), context(), defaults);
  engine.begin();
  InstanceDescription instance;
  instance.layout = motionLayout();
  instance.bounds = true;
  instance.mesh = engine.addMesh(character);
  instance.pose = engine.addPose(systemPose(1, 19));
  const InstanceHandle handle = engine.addInstance(instance);
  engine.submit();
  engine.runFrame();
  engine.runFrame();
  engine.begin();  // what the upload took is free
  const std::uint64_t beside =
      engine.recorder().statistics().deviceMemory - engine->statistics().outputs.capacity;
  RecordProperty("kibibytes", static_cast<int>(beside >> 10));
  std::printf("a character of %zu bytes takes %llu KiB beside its output\n",
              character.bytes().size(), static_cast<unsigned long long>(beside >> 10));
  EXPECT_LT(beside, 1u << 20);
  engine.submit();
  expectSkinned(engine.read(handle), alone(character, systemPose(1, 19), instance));
}

TEST_F(SystemGrowthTest, WhatStandsInAnOutputThatGrowsStaysAndTheEngineIsTold) {
  SystemEngine engine(device(), context(), tiny());
  const PackedMesh mesh = systemMesh(1, 100);
  engine.begin();
  InstanceDescription instance;
  instance.layout = motionLayout();
  instance.mesh = engine.addMesh(mesh);
  instance.pose = engine.addPose(systemPose(1));
  const InstanceHandle first = engine.addInstance(instance);
  engine.submit();
  engine.runFrame();
  engine.begin();
  const VkBuffer before = engine.recorder().outputBuffer();
  const std::uint64_t generation = engine.recorder().outputGeneration();
  const InstanceOutput place = must(engine->output(first));
  for (std::uint32_t i = 0; i < 20; ++i) engine.addInstance(instance);
  EXPECT_EQ(engine.recorder().outputBuffer(), before) << "until it is recorded";
  EXPECT_EQ(engine.recorder().outputGeneration(), generation);
  engine.submit();
  EXPECT_NE(engine.recorder().outputBuffer(), before);
  EXPECT_NE(engine.recorder().outputGeneration(), generation);
  EXPECT_EQ(engine.lastFrame().skinnedInstances, 20u) << "the first one is copied";
  EXPECT_EQ(must(engine->output(first)).offset, place.offset);
  expectSkinned(engine.read(first), alone(mesh, systemPose(1), instance));
}

TEST_F(SystemGrowthTest, AnAbandonedFrameGrowsAgain) {
  SystemEngine engine(device(), context(), tiny());
  const PackedMesh mesh = systemMesh(1, 100);
  engine.begin();
  InstanceDescription instance;
  instance.layout = motionLayout();
  instance.mesh = engine.addMesh(mesh);
  instance.pose = engine.addPose(systemPose(1));
  std::vector<InstanceHandle> instances{engine.addInstance(instance)};
  engine.submit();
  engine.begin(1);
  const VkBuffer before = engine.recorder().outputBuffer();
  for (int i = 0; i < 5; ++i) instances.push_back(engine.addInstance(instance));
  std::uint64_t recorded = 0;
  engine.abandon({}, [&] {
    EXPECT_NE(engine.recorder().outputBuffer(), before);
    recorded = engine.recorder().outputGeneration();
    // It has to grow once more before the last growth was ever executed.
    for (int i = 0; i < 30; ++i) instances.push_back(engine.addInstance(instance));
  });
  EXPECT_EQ(engine.recorder().outputBuffer(), before);
  EXPECT_NE(engine.recorder().outputGeneration(), recorded);
  engine.begin(1);
  engine.submit();
  const std::vector<std::byte> bytes = engine.readOutput();
  for (const InstanceHandle handle : instances)
    expectSkinned(engine.read(bytes, handle), alone(mesh, systemPose(1), instance));
}

// With sets instead of pushed descriptors. The validation layer reports a set that is written, and
// a buffer that is destroyed, while a frame in flight uses it.
TEST_F(SystemGrowthTest, DescriptorSetsInFlightAreNeverRewritten) {
  vulkan::DeviceDescription lent = device().description();
  lent.enabledExtensions = {};
  vulkan::Context withSets = must(vulkan::Context::create(lent));
  SceneRecorderDescription system = tiny();
  system.scene.framesInFlight = 3;
  SystemEngine engine(device(), withSets, system);
  const PackedMesh mesh = systemMesh(1, 400);
  InstanceDescription instance;
  instance.layout = motionLayout();
  instance.bounds = true;
  std::vector<InstanceHandle> instances;
  for (int frame = 0; frame < 12; ++frame) {
    engine.begin(2);
    instance.mesh = engine.addMesh(mesh);
    instance.pose = engine.addPose(systemPose(1), {.writtenByGpu = frame % 2 != 0});
    for (int i = 0; i <= frame * 2; ++i) instances.push_back(engine.addInstance(instance));
    engine.submit();
  }
  const std::vector<std::byte> bytes = engine.readOutput();
  for (const InstanceHandle handle : instances)
    expectSkinned(engine.read(bytes, handle), alone(mesh, systemPose(1), instance));
}

TEST_F(SystemGrowthTest, BeyondTheMaximumAddingFailsWithASentence) {
  SceneRecorderDescription small = tiny();
  const PackedMesh mesh = systemMesh(1, 100);
  small.scene.meshCapacity.maximum = 2 * mesh.bytes().size() + 64;
  small.scene.jointCapacity = {8, 20};
  small.scene.gpuJointCapacity.maximum = 20;
  small.scene.outputCapacity.maximum = 10'000;
  small.scene.boundsCapacity.maximum = 1;
  small.scene.instanceCapacity.maximum = 2;
  SceneRecorder system = must(SceneRecorder::create(context(), small));
  const auto expectRefused = [](const auto& result, const std::string& text) {
    ASSERT_FALSE(result.ok()) << text;
    EXPECT_EQ(result.error().code, ErrorCode::limitExceeded) << result.error().message;
    EXPECT_NE(result.error().message.find(text), std::string::npos) << result.error().message;
  };
  const MeshHandle first = must(system.scene().addMesh(mesh));
  must(system.scene().addMesh(mesh));
  expectRefused(system.scene().addMesh(mesh), "a packed mesh takes");
  const PoseHandle pose = must(system.scene().addPose(8));
  must(system.scene().addPose(12));
  expectRefused(system.scene().addPose(1), "the CPU writes hold 20 joints, of which 20 are in use");
  must(system.scene().addPose(20, {.writtenByGpu = true}));
  expectRefused(system.scene().addPose(1, {.writtenByGpu = true}),
                "the GPU writes hold 20 joints, of which 20 are in use; their maximum is 20");
  InstanceDescription instance{.mesh = first, .pose = pose, .layout = motionLayout()};
  instance.bounds = true;
  must(system.scene().addInstance(instance));
  expectRefused(system.scene().addInstance(instance),
                "1 instances have them already: the maximum of boundsCapacity");
  instance.bounds = false;
  must(system.scene().addInstance(instance));
  expectRefused(system.scene().addInstance(instance),
                "there are 2 instances already: the maximum of instanceCapacity");
  const MeshHandle none = {};
  EXPECT_FALSE(system.scene().removeMesh(none).ok());
}

TEST_F(SystemGrowthTest, TheOutputGrowsToItsMaximumAndNoFurther) {
  SceneRecorderDescription small = tiny();
  small.scene.outputCapacity.maximum = 9 * 100 * 36;
  SystemEngine engine(device(), context(), small);
  engine.begin();
  InstanceDescription instance;
  instance.layout = motionLayout();
  instance.mesh = engine.addMesh(systemMesh(1, 100));
  instance.pose = engine.addPose(systemPose(1));
  for (int i = 0; i < 9; ++i) engine.addInstance(instance);
  const Result<InstanceHandle> tenth = engine->addInstance(instance);
  ASSERT_FALSE(tenth.ok());
  EXPECT_EQ(tenth.error().code, ErrorCode::limitExceeded);
  EXPECT_NE(tenth.error().message.find("of 32400 bytes of output only 0 are free"),
            std::string::npos)
      << tenth.error().message;
  EXPECT_EQ(engine->statistics().outputs.capacity, 32400u);
  engine.submit();
}

/// Guards around what the system may use of one buffer of the engine's, in which all stands.
TEST_F(SystemGrowthTest, RangesOfTheEnginesBuffersAreAllThatIsUsed) {
  constexpr std::uint64_t part = 85 * 768, guard = 6 * 768;  // of any alignment
  SceneRecorderDescription ranged = description();
  VkBufferUsageFlags usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  for (const BufferRole role :
       {BufferRole::meshes, BufferRole::poses, BufferRole::gpuPoses, BufferRole::positions}) {
    const BufferRequirement needed = must(SceneRecorder::requirement(context(), ranged, role));
    EXPECT_EQ(guard % needed.alignment, 0u);
    EXPECT_NE(needed.usage & VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, 0u);
    usage |= needed.usage;
  }
  samples::MappedBuffer heap =
      must(samples::MappedBuffer::create(device(), 4 * part + 5 * guard, usage));
  std::ranges::fill(heap.bytes(), std::byte{0x5a});
  const auto rangeOf = [&](std::uint64_t number) {
    return BufferRange{heap.handle(), guard + number * (part + guard), part};
  };
  ranged.meshes = rangeOf(0);
  ranged.poses = rangeOf(1);
  ranged.mappedPoses = heap.bytes().data() + ranged.poses.offset;
  ranged.gpuPoses = rangeOf(2);
  ranged.output = rangeOf(3);
  ranged.scene.outputCapacity = Capacity::fixed(heap.bytes().size());  // what the test reads
  SystemEngine engine(device(), context(), ranged);
  engine.begin();
  const PackedMesh mesh = systemMesh(1, 200);
  std::vector<InstanceHandle> instances;
  std::vector<InstanceDescription> descriptions;
  InstanceDescription instance;
  instance.layout = motionLayout();
  for (std::uint32_t i = 0; i < 6; ++i) {
    if (i % 3 == 0) instance.mesh = engine.addMesh(mesh);
    instance.method = i % 2 == 0 ? Method::linear : Method::dualQuaternion;
    instance.pose = engine.addPose(systemPose(i), {.writtenByGpu = i < 3});
    descriptions.push_back(instance);
    instances.push_back(engine.addInstance(instance));
  }
  const BufferRange pose = must(engine.recorder().poseRange(descriptions[0].pose));
  EXPECT_EQ(pose.buffer, heap.handle());
  EXPECT_GE(pose.offset, ranged.gpuPoses.offset);
  engine.submit();
  const std::vector<std::byte> bytes = engine.readOutput();
  for (std::uint32_t i = 0; i < 6; ++i)
    expectSkinned(engine.read(bytes, instances[i]), alone(mesh, systemPose(i), descriptions[i]));
  for (std::uint64_t byte = 0; byte < bytes.size(); ++byte) {
    if (byte % (part + guard) >= guard) continue;
    ASSERT_EQ(bytes[byte], std::byte{0x5a}) << "byte " << byte << " is the engine's";
  }
  // A range is full where it ends.
  Result<MeshHandle> added = MeshHandle{};
  while (added) added = engine->addMesh(mesh);
  EXPECT_EQ(added.error().code, ErrorCode::limitExceeded);
  Result<PoseHandle> another = PoseHandle{};
  std::uint32_t count = 0;
  for (; another; ++count) another = engine->addPose(100);
  EXPECT_EQ(count - 1, (part - 3 * 8 * 2 * sizeof(JointMatrix)) / (100 * 2 * sizeof(JointMatrix)));
  EXPECT_FALSE(engine->addPose(2000, {.writtenByGpu = true}).ok());
}

// Bytes behind the last whole joint, or mesh, are not bound.
TEST_F(SystemGrowthTest, RangesOfNoWholeJointsAreNotBoundToTheirEnd) {
  constexpr std::uint64_t most = 65536;
  InterceptedDevice small(device().description());
  small.changeLimits([](VkPhysicalDeviceLimits& limits) { limits.maxStorageBufferRange = most; });
  CommandLog log(small);
  vulkan::Context narrow = must(vulkan::Context::create(small.description()));
  SceneRecorderDescription ranged = tiny();
  ranged.scene.framesInFlight = 1;
  const VkBufferUsageFlags usage =
      must(SceneRecorder::requirement(narrow, ranged, BufferRole::meshes)).usage |
      must(SceneRecorder::requirement(narrow, ranged, BufferRole::gpuPoses)).usage |
      VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  samples::MappedBuffer heap = must(samples::MappedBuffer::create(device(), 4 * most, usage));
  ranged.meshes = {heap.handle(), 0, most + 8};
  ranged.gpuPoses = {heap.handle(), 2 * most, most + 8};
  SystemEngine engine(device(), narrow, ranged);
  engine.begin();
  InstanceDescription instance;
  instance.layout = motionLayout();
  const PackedMesh mesh = systemMesh(1, 100);
  instance.mesh = engine.addMesh(mesh);
  instance.pose = engine.addPose(systemPose(1), {.writtenByGpu = true});
  const InstanceHandle handle = engine.addInstance(instance);
  engine.submit();
  expectSkinned(engine.read(handle), alone(mesh, systemPose(1), instance));
  EXPECT_LE(log.longestRange, most);
  EXPECT_GT(log.longestRange, most - sizeof(JointMatrix));
}

TEST_F(SystemGrowthTest, RangesThatMakeNoSenseAreRefusedByName) {
  samples::MappedBuffer buffer =
      must(samples::MappedBuffer::create(device(), 1 << 16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
  const BufferRange good{buffer.handle(), 0, 4096}, odd{buffer.handle(), 0, 1026};
  const auto expectRefused = [&](const char* field, const auto& change) {
    SceneRecorderDescription bad = description();
    change(bad);
    const Result<SceneRecorder> system = SceneRecorder::create(context(), bad);
    ASSERT_FALSE(system.ok()) << field;
    EXPECT_EQ(system.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(system.error().message.find(std::string("::") + field), std::string::npos)
        << system.error().message;
  };
  using Description = SceneRecorderDescription;
  expectRefused("meshes ", [&](Description& d) { d.meshes = odd; });
  expectRefused("gpuPoses ", [&](Description& d) { d.gpuPoses = odd; });
  expectRefused("gpuPoses ", [&](Description& d) { d.gpuPoses = {buffer.handle(), 0, 44}; });
  expectRefused("poses has 1026 bytes", [&](Description& d) {
    d.poses = odd;
    d.mappedPoses = buffer.bytes().data();
  });
  expectRefused("poses and mappedPoses ", [&](Description& d) { d.poses = good; });
  expectRefused("poses and mappedPoses ",
                [&](Description& d) { d.mappedPoses = buffer.bytes().data(); });
}

TEST_F(SystemGrowthTest, PosesThatOneCallAddsStandOneBehindTheOther) {
  SceneRecorder system = must(SceneRecorder::create(context(), tiny()));
  std::vector<PoseHandle> poses(1000);
  must(system.scene().addPoses(poses, 7, {.writtenByGpu = true}));
  const BufferRange first = must(system.poseRange(poses[0]));
  EXPECT_EQ(first.size, 7 * sizeof(JointMatrix));
  for (std::uint32_t i = 0; i < poses.size(); ++i) {
    const BufferRange range = must(system.poseRange(poses[i]));
    EXPECT_EQ(range.buffer, first.buffer);
    EXPECT_EQ(range.offset, first.offset + i * first.size);
  }
  std::vector<PoseHandle> others(50);
  must(system.scene().addPoses(others, 300, {.writtenByGpu = true}));
  // On lavapipe these are multiples of the alignment anyway, under profiles of other devices not.
  const PoseHandle single = must(system.scene().addPose(1, {.writtenByGpu = true}));
  const PoseHandle next = must(system.scene().addPose(1, {.writtenByGpu = true}));
  for (const PoseHandle bound : {poses[0], others[0], single, next}) {
    EXPECT_EQ(
        must(system.poseRange(bound)).offset % context().limits().minStorageBufferOffsetAlignment,
        0u);
  }
  EXPECT_EQ(must(system.poseRange(poses[0])).buffer, first.buffer) << "poses never move";
  must(system.scene().addPoses({}, 7));
}

TEST_F(SystemGrowthTest, EachPoseIsWrittenByTheOneWhoDoes) {
  SystemEngine engine(device(), context(), tiny());
  const PoseHandle ofGpu = must(engine->addPose(4, {.writtenByGpu = true}));
  const PoseHandle ofCpu = must(engine->addPose(4));
  engine.begin();
  const auto expectRefused = [](const auto& result, const std::string& text) {
    ASSERT_FALSE(result.ok()) << text;
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(result.error().message.find(text), std::string::npos) << result.error().message;
  };
  expectRefused(engine->writePose(ofGpu), "is written by the GPU; use markWritten");
  expectRefused(engine->markWritten({&ofCpu, 1}), "is written by the CPU; use writePose");
  expectRefused(engine.recorder().poseRange(ofCpu), "is written by the CPU; use writePose");
  must(engine->markWritten({&ofGpu, 1}));
  must(engine->markAllWritten());
  must(engine->removePose(ofGpu));
  expectRefused(engine->markWritten({&ofGpu, 1}), "there is no pose");
  engine.submit();
  expectRefused(engine->writePose(ofCpu), "only between beginFrame and record");
}

// As the plan decides.
TEST_F(SystemGrowthTest, WhatIsDueIsSkinned) {
  SystemEngine engine(device(), context(), tiny());
  engine.begin();
  InstanceDescription instance;
  instance.mesh = engine.addMesh(systemMesh(1, 20));
  instance.layout = motionLayout();
  std::vector<InstanceHandle> instances;
  std::vector<PoseHandle> poses;
  for (std::uint32_t interval = 1; interval <= 4; ++interval) {
    poses.push_back(engine.addPose(systemPose(interval)));
    instance.pose = poses.back();
    instance.updateInterval = interval;
    instances.push_back(engine.addInstance(instance));
  }
  must(engine->change({.instance = instances[0], .visible = false}));
  EXPECT_FALSE(must(engine->isDue(instances[0])));
  for (std::uint32_t i = 1; i < 4; ++i) EXPECT_TRUE(must(engine->isDue(instances[i]))) << "new";
  engine.submit();
  std::uint32_t due = 0;
  for (std::uint32_t frame = 0; frame < 12; ++frame) {
    engine.begin();
    std::set<std::uint32_t> expected;
    for (std::uint32_t i = 0; i < 4; ++i) {
      if (must(engine->isDue(instances[i]))) expected.insert(instances[i].index);
      engine.writePose(poses[i], systemPose(frame));
    }
    engine.submit();
    EXPECT_EQ(indicesOf(engine->skinnedInstances()), expected);
    due += static_cast<std::uint32_t>(expected.size());
  }
  EXPECT_EQ(due, 6u + 4u + 3u);
  EXPECT_FALSE(engine->isDue({}).ok());
}

// Bounds, too: what the model of system_model_test.cpp does not know. Their buffer grows.
TEST_F(SystemGrowthTest, MarkedPosesAreSkinnedAndOthersRest) {
  SystemEngine engine(device(), context(), tiny());
  const PackedMesh mesh = systemMesh(1, 100);
  engine.begin();
  InstanceDescription instance;
  instance.layout = motionLayout();
  instance.bounds = true;
  instance.mesh = engine.addMesh(mesh);
  std::vector<InstanceHandle> instances;
  std::vector<PoseHandle> poses;
  for (std::uint32_t i = 0; i < 4; ++i) {
    poses.push_back(engine.addPose(systemPose(i), {.writtenByGpu = true}));
    instance.pose = poses.back();
    instances.push_back(engine.addInstance(instance));
  }
  engine.submit();
  engine.begin();
  const std::optional<Box> before = must(engine->bounds(instances[2]));
  engine.writePose(poses[2], systemPose(20));
  engine.submit();
  EXPECT_EQ(engine.lastFrame().skinnedInstances, 1u);
  EXPECT_EQ(engine.lastFrame().convertedPoses, 1u);
  expectSkinned(engine.read(instances[2]), alone(mesh, systemPose(20), instance));
  engine.begin();
  const std::optional<Box> after = must(engine->bounds(instances[2]));
  ASSERT_TRUE(before && after);
  EXPECT_NE(std::memcmp(&*before, &*after, sizeof(Box)), 0);
  // Results between two others are read back with them.
  for (int i = 0; i < 20; ++i) engine.addInstance(instance);
  engine.writePose(poses[1], systemPose(1));
  engine.submit();
  engine.begin();
  const std::optional<Box> copied = must(engine->bounds(instances[2]));
  ASSERT_TRUE(copied);
  EXPECT_EQ(std::memcmp(&*copied, &*after, sizeof(Box)), 0);
  must(engine->markAllWritten());
  engine.submit();
  EXPECT_EQ(engine.lastFrame().skinnedInstances, 24u);
  for (std::uint32_t i = 0; i < 4; ++i) {
    expectSkinned(engine.read(instances[i]), alone(mesh, systemPose(i == 2 ? 20 : i), instance));
  }
}

}  // namespace
}  // namespace dermis::test
