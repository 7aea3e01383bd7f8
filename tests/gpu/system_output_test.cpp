// What a system skins of each instance, by how many commands, and what it tells of it.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "kit/buffer.h"
#include "system_test.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t outputMeshes = 20;

class SystemOutputTest : public SystemTest {
 protected:
  VkBufferUsageFlags outputUsage() {
    return must(vulkan::SceneRecorder::requirement(context(), description(), BufferRole::positions))
        .usage;
  }
};

TEST_F(SystemOutputTest, TenThousandInstancesOfTwentyMeshesAreFewCommands) {
  vulkan::SceneRecorderDescription large = description();
  large.scene.outputCapacity = Capacity::fixed(32 << 20);
  large.scene.jointCapacity = Capacity::fixed(10'000 * 4);
  large.scene.instanceCapacity = Capacity::fixed(10'000);
  SystemEngine engine(device(), context(), large);
  engine.begin();
  std::vector<MeshHandle> meshes;
  for (std::uint32_t mesh = 0; mesh < outputMeshes; ++mesh)
    meshes.push_back(engine.addMesh(systemMesh(mesh, 40 + mesh, 4)));
  const Pose pose = systemPose(1, 4);
  std::vector<PoseHandle> palettes;
  for (std::uint32_t i = 0; i < 10'000; ++i) {
    InstanceDescription instance;
    instance.mesh = meshes[i % outputMeshes];
    instance.pose = palettes.emplace_back(engine.addPose(pose));
    instance.method = i % 3 == 0 ? Method::linear : Method::dualQuaternion;
    instance.layout = motionLayout();
    engine.addInstance(instance);
  }
  engine.submit();
  // The second frame has no meshes to bring along, as most frames have not.
  for (int number = 0; number < 2; ++number) {
    EXPECT_LE(engine.lastFrame().dispatches, 6u);
    EXPECT_EQ(engine.lastFrame().skinnedInstances, 10'000u);
    if (number == 1) {
      EXPECT_LE(engine.lastFrame().copies, 1u);
      break;
    }
    engine.begin();
    for (const PoseHandle palette : palettes) engine.writePose(palette, pose);
    engine.submit();
  }
}

// Instances begin at multiples of their strides from the beginning of the buffer.
TEST_F(SystemOutputTest, ARangeHasRoomWhereverItBegins) {
  const std::array<VertexLayout, 2> layouts{VertexLayout{.normals = VertexFormat::float32x3},
                                            motionLayout()};
  const PackedMesh mesh = systemMesh(1, 100);
  vulkan::SceneRecorderDescription ranged = description();
  std::uint64_t bytes = 0;
  for (const VertexLayout& layout : layouts) bytes += 5 * must(placeVertices(layout, 100)).size;
  ranged.scene.outputCapacity = Capacity::fixed(bytes);
  const auto requirement = [&](std::span<const VertexLayout> of) {
    return must(vulkan::SceneRecorder::requirement(context(), ranged, BufferRole::positions, of));
  };
  const BufferRequirement needed = requirement(layouts);
  const samples::MappedBuffer buffer =
      must(samples::MappedBuffer::create(device(), 1 << 20, needed.usage));
  const auto added = [&](std::uint64_t begin, std::uint64_t size) {
    ranged.output = {buffer.handle(), begin, size};
    const vulkan::SceneRecorder recorder = must(vulkan::SceneRecorder::create(context(), ranged));
    InstanceDescription instance;
    instance.mesh = must(recorder.scene().addMesh(mesh));
    instance.pose = must(recorder.scene().addPose(8));
    std::uint32_t count = 0;
    for (std::uint32_t number = 0; number < 10; ++number) {
      instance.layout = layouts[number / 5];
      count += recorder.scene().addInstance(instance).ok();
    }
    ranged.output = {};
    return count;
  };
  std::uint32_t fewest = 10;
  for (std::uint64_t place = 0; place < 20; ++place) {
    EXPECT_EQ(added(place * needed.alignment, needed.size), 10u) << place;
    fewest = std::min(fewest, added(place * needed.alignment, requirement({}).size));
  }
  EXPECT_LT(fewest, 10u) << "or the layouts are for nothing";
}

/// The vertex buffer of an engine, of which Dermis has a part.
TEST_F(SystemOutputTest, ARangeOfTheEnginesBufferIsAllThatIsWritten) {
  constexpr std::uint64_t whole = 1 << 18, begin = 65 * 192, size = 92'000;
  samples::MappedBuffer buffer =
      must(samples::MappedBuffer::create(device(), whole, outputUsage()));
  vulkan::SceneRecorderDescription ranged = description();
  ranged.output = {buffer.handle(), begin, size};
  ranged.scene.outputCapacity = Capacity::fixed(whole);  // what the test reads
  SystemEngine engine(device(), context(), ranged);
  EXPECT_EQ(engine.recorder().outputBuffer(), buffer.handle());
  EXPECT_EQ(engine->statistics().outputs.capacity, size);
  engine.fillOutput(std::byte{0x5a});
  engine.begin();
  const PackedMesh mesh = systemMesh(1, 200);
  InstanceDescription instance;
  instance.mesh = engine.addMesh(mesh);
  std::vector<InstanceHandle> instances;
  std::vector<InstanceDescription> descriptions;
  for (std::uint32_t i = 0; i < 12; ++i) {
    instance.pose = engine.addPose(systemPose(i));
    instance.layout = motionLayout();
    instance.layout.planar = i % 2 != 0;
    descriptions.push_back(instance);
    instances.push_back(engine.addInstance(instance));
  }
  EXPECT_FALSE(engine->addInstance(instance).ok()) << "the range is full";
  engine.submit();
  engine.begin();
  must(engine->removeInstance(instances[0]));
  engine.submit();
  engine.begin();
  EXPECT_GT(engine->compact(50'000), 0u);
  engine.submit();
  const std::vector<std::byte> bytes = engine.readOutput();
  for (std::uint32_t i = 1; i < 12; ++i) {
    const InstanceOutput output = must(engine->output(instances[i]));
    EXPECT_GE(output.offset, begin);
    if (!descriptions[i].layout.planar) {
      EXPECT_EQ(output.offset % output.places[Stream::positions].stride, 0u) << "for firstVertex";
    }
    EXPECT_LE(output.offset + output.places.size, begin + size);
    expectSkinned(engine.read(bytes, instances[i]), alone(mesh, systemPose(i), descriptions[i]));
  }
  for (std::uint64_t byte = 0; byte < whole; ++byte) {
    if (byte >= begin && byte < begin + size) continue;
    ASSERT_EQ(bytes[byte], std::byte{0x5a}) << "byte " << byte << " is the engine's";
  }
}

TEST_F(SystemOutputTest, RangesThatMakeNoSenseAreRefused) {
  samples::MappedBuffer buffer =
      must(samples::MappedBuffer::create(device(), 1 << 16, outputUsage()));
  const std::uint64_t alignment = context().limits().minStorageBufferOffsetAlignment;
  for (const vulkan::BufferRange& bad :
       {vulkan::BufferRange{buffer.handle(), 0, 0}, vulkan::BufferRange{buffer.handle(), 0, 1026},
        vulkan::BufferRange{buffer.handle(), alignment + 1, 1024},
        vulkan::BufferRange{VK_NULL_HANDLE, 0, 1024}}) {
    vulkan::SceneRecorderDescription ranged = description();
    ranged.output = bad;
    const Result<vulkan::SceneRecorder> system = vulkan::SceneRecorder::create(context(), ranged);
    ASSERT_FALSE(system.ok());
    EXPECT_EQ(system.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(system.error().message.find("::output "), std::string::npos)
        << system.error().message;
  }
}

TEST_F(SystemOutputTest, NothingIsRecordedWhereNothingChanged) {
  SingleInstance one(device(), context(), description(), motionLayout());
  one.engine.submit();
  one.engine.runFrame();  // it comes to rest, at the latest
  one.engine.runFrame();
  const LastFrame frame = one.engine.lastFrame();
  EXPECT_EQ(frame.frame, 3u);
  EXPECT_EQ(frame.instances, 1u);
  EXPECT_EQ(frame.dispatches, 0u);
  EXPECT_EQ(frame.copies, 0u);
  EXPECT_EQ(frame.workgroups, 0u);
  EXPECT_EQ(frame.skinnedInstances, 0u);
  EXPECT_EQ(frame.settledInstances, 0u);
  EXPECT_EQ(frame.skinnedVertices, 0u);
  EXPECT_EQ(frame.convertedPoses, 0u);
  EXPECT_EQ(frame.uploadedBytes, 0u);
  EXPECT_EQ(frame.writtenBytes, 0u);
  EXPECT_TRUE(one.engine->skinnedInstances().empty());
}

TEST_F(SystemOutputTest, APoseThatManyMeshesShareIsConvertedOnce) {
  SystemEngine engine(device(), context(), description());
  engine.begin();
  const Pose first = systemPose(1), second = systemPose(2);
  const PoseHandle shared = engine.addPose(first), own = engine.addPose(second);
  std::vector<PackedMesh> meshes;
  std::vector<InstanceHandle> instances;
  InstanceDescription instance;
  instance.layout = plainLayout();
  for (std::uint32_t i = 0; i < 5; ++i) {
    meshes.push_back(systemMesh(i, 50 + 10 * i));
    instance.mesh = engine.addMesh(meshes.back());
    instance.pose = i < 4 ? shared : own;
    instances.push_back(engine.addInstance(instance));
  }
  engine.submit();
  EXPECT_EQ(engine.lastFrame().convertedPoses, 2u);
  for (std::size_t i = 0; i < 5; ++i)
    expectSkinned(engine.read(instances[i]), alone(meshes[i], i < 4 ? first : second, instance));
  engine.begin();
  engine.writePose(shared, second);
  engine.submit();
  EXPECT_EQ(engine.lastFrame().convertedPoses, 1u);
  EXPECT_EQ(engine.lastFrame().skinnedInstances, 4u);
  EXPECT_EQ(engine.lastFrame().skinnedVertices, 50u + 60 + 70 + 80);
  for (std::size_t i = 0; i < 5; ++i)
    expectSkinned(engine.read(instances[i]), alone(meshes[i], second, instance));
}

TEST_F(SystemOutputTest, AnUnwrittenPoseIsTheIdentity) {
  SystemEngine engine(device(), context(), description());
  const PackedMesh packed = systemMesh(1, 100);
  InstanceDescription instance;
  instance.layout = plainLayout();
  instance.mesh = engine.addMesh(packed);
  instance.pose = must(engine->addPose(8));
  const InstanceHandle handle = engine.addInstance(instance);  // all of it before any frame
  engine.runFrame();
  expectSkinned(engine.read(handle), alone(packed, Pose(8), instance));
}

TEST_F(SystemOutputTest, ScaleThatWasNotDeclaredIsLeftOut) {
  SystemEngine engine(device(), context(), description());
  engine.begin();
  const PackedMesh packed = systemMesh(1, 100);
  InstanceDescription instance;
  instance.layout = plainLayout();
  instance.mesh = engine.addMesh(packed);
  for (const JointPromise promise :
       {JointPromise::scaling, JointPromise::scaleIgnored, JointPromise::rigid}) {
    const Pose pose =
        randomPose(1, 8, promise == JointPromise::rigid ? Rigidity::rigid : Rigidity::shear);
    instance.pose = engine.addPose(pose, {.promise = promise});
    const InstanceHandle handle = engine.addInstance(instance);
    engine.submit();
    expectSkinned(engine.read(handle), alone(packed, pose, instance, {}, promise));
    engine.begin();
  }
  engine.submit();
}

TEST_F(SystemOutputTest, MorphWeightsAreThoseThatWereSetLast) {
  VertexLayout layout = plainLayout();
  layout.tangents = VertexFormat::float32x4;
  SingleInstance one(device(), context(), description(), layout);
  const std::vector<MorphWeight> smile{{0, 0.5f}, {2, 0.25f}}, frown{{1, 1.0f}};
  must(one.engine->change({.instance = one.instance, .morphs = frown}));
  must(one.engine->change({.instance = one.instance, .morphs = smile}));
  one.engine.submit();
  const Pose pose = systemPose(1);
  expectSkinned(one.engine.read(one.instance), alone(one.packed, pose, one.description, smile));
  one.engine.begin();
  must(one.engine->change({.instance = one.instance, .morphs = frown}));
  one.engine.submit();
  EXPECT_EQ(one.engine.lastFrame().skinnedInstances, 1u);
  expectSkinned(one.engine.read(one.instance), alone(one.packed, pose, one.description, frown));
  one.engine.begin();
  must(one.engine->change({.instance = one.instance, .morphs = std::span<const MorphWeight>()}));
  one.engine.submit();
  expectSkinned(one.engine.read(one.instance), alone(one.packed, pose, one.description));
}

TEST_F(SystemOutputTest, BoundsAreThoseOfTheNewestCompleteFrame) {
  SingleInstance one(device(), context(), description(), plainLayout());
  InstanceDescription bounded = one.description;
  bounded.bounds = true;
  const InstanceHandle instance = one.engine.addInstance(bounded);
  const auto boxOf = [&](const Pose& pose) {
    const Streams streams = alone(one.packed, pose, bounded);
    std::vector<float> values(streams[positionStream].size() / 4);
    std::memcpy(values.data(), streams[positionStream].data(), streams[positionStream].size());
    Box box{{values[0], values[1], values[2]}, {values[0], values[1], values[2]}};
    for (std::size_t i = 0; i < values.size(); ++i) {
      box.min[i % 3] = std::min(box.min[i % 3], values[i]);
      box.max[i % 3] = std::max(box.max[i % 3], values[i]);
    }
    return box;
  };
  const auto expectBox = [&](const Box& expected) {
    const std::optional<Box> box = must(one.engine->bounds(instance));
    ASSERT_TRUE(box.has_value());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(box->min[axis], expected.min[axis]);
      EXPECT_EQ(box->max[axis], expected.max[axis]);
    }
  };
  EXPECT_FALSE(must(one.engine->bounds(instance)).has_value()) << "no frame is complete";
  one.engine.submit();
  one.engine.begin();
  ASSERT_NO_FATAL_FAILURE(expectBox(boxOf(systemPose(1))));
  EXPECT_FALSE(must(one.engine->bounds(one.instance)).has_value()) << "it did not ask for one";
  one.engine.writePose(bounded.pose, systemPose(2));
  one.engine.submit();
  one.engine.begin();
  ASSERT_NO_FATAL_FAILURE(expectBox(boxOf(systemPose(2))));
  one.engine.submit();
  // What was not skinned since keeps its box.
  for (int i = 0; i < 4; ++i) one.engine.runFrame();
  ASSERT_NO_FATAL_FAILURE(expectBox(boxOf(systemPose(2))));
}

// The frame with the box and an idle one become complete together.
TEST_F(SystemOutputTest, BoxesAreNotLostWhereTheNextFrameDoesNothing) {
  SingleInstance one(device(), context(), description(), plainLayout());
  InstanceDescription bounded = one.description;
  bounded.bounds = true;
  const InstanceHandle instance = one.engine.addInstance(bounded);
  one.engine.submit();
  one.engine.begin(1);
  one.engine.submit();
  one.engine.begin();
  EXPECT_EQ(one.engine.completedFrame(), 2u);
  EXPECT_TRUE(must(one.engine->bounds(instance)).has_value());
  one.engine.submit();
}

}  // namespace
}  // namespace dermis::test
