// What a system refuses: handles of things that are gone, and arguments that break a rule.

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>

#include "system_test.h"

namespace dermis::test {
namespace {

using vulkan::SceneRecorder;
using vulkan::SceneRecorderDescription;

class SystemHandlesTest : public SystemTest {
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

  template <typename T>
  static void expectRefused(const Result<T>& result, ErrorCode code, const std::string& text) {
    ASSERT_FALSE(result.ok()) << text;
    EXPECT_EQ(result.error().code, code) << text << ": " << result.error().message;
    EXPECT_NE(result.error().message.find(text), std::string::npos)
        << text << ": " << result.error().message;
  }
  template <typename T>
  static void expectInvalid(const Result<T>& result, const std::string& text) {
    expectRefused(result, ErrorCode::invalidArgument, text);
  }

  /// What is said of a handle that nothing has.
  template <typename Handle>
  static std::string unknown(const std::string& kind, Handle handle) {
    if (!handle) return "the " + kind + " handle is null";
    return "there is no " + kind + " " + std::to_string(handle.index) + " of generation " +
           std::to_string(handle.generation);
  }
  void expectStaleInstance(InstanceHandle instance) {
    Scene& scene = engine().scene();
    const std::string text = unknown("instance", instance);
    expectInvalid(scene.removeInstance(instance), text);
    expectInvalid(scene.change({.instance = instance, .visible = false}), text);
    expectInvalid(scene.change({.instance = instance, .updateInterval = 2}), text);
    expectInvalid(scene.change({.instance = instance, .teleports = true}), text);
    expectInvalid(scene.change({.instance = instance, .morphs = std::span<const MorphWeight>()}),
                  text);
    expectInvalid(scene.change({.instance = instance, .mesh = one_->description.mesh}), text);
    expectInvalid(scene.output(instance), text);
    expectInvalid(scene.bounds(instance), text);
    expectInvalid(scene.visibilityIndex(instance), text);
  }

  std::optional<SingleInstance> one_;
};

TEST_F(SystemHandlesTest, InstancesThatAreGoneAreNoticed) {
  expectStaleInstance({});
  expectStaleInstance({1000, 1});
  expectStaleInstance({one_->instance.index, one_->instance.generation + 1});
  const InstanceHandle old = one_->instance;
  must(engine()->removeInstance(old));
  expectStaleInstance(old);
  for (int i = 0; i < 4; ++i) {
    engine().submit();
    engine().begin();
    expectStaleInstance(old);
  }
  // Its place is given to others.
  for (int i = 0; i < 5; ++i) {
    const InstanceHandle next = engine().addInstance(one_->description);
    EXPECT_NE(next, old);
    EXPECT_TRUE(next);
    expectStaleInstance(old);
    must(engine()->removeInstance(next));
    expectStaleInstance(next);
  }
  engine().submit();
}

TEST_F(SystemHandlesTest, MeshesThatAreGoneAreNoticed) {
  const MeshHandle old = engine().addMesh(systemMesh(2, 30));
  must(engine()->removeMesh(old));
  for (int i = 0; i < 4; ++i) {
    for (const MeshHandle mesh : {old, MeshHandle{}, MeshHandle{1000, 1}}) {
      InstanceDescription instance = one_->description;
      instance.mesh = mesh;
      const std::string text = unknown("mesh", mesh);
      expectInvalid(engine()->addInstance(instance), text);
      expectInvalid(engine()->change({.instance = one_->instance, .mesh = mesh}), text);
      expectInvalid(engine()->removeMesh(mesh), text);
    }
    engine().submit();
    engine().begin();
    EXPECT_NE(engine().addMesh(systemMesh(3, 30)), old);
  }
}

TEST_F(SystemHandlesTest, PosesThatAreGoneAreNoticed) {
  const PoseHandle old = must(engine()->addPose(8));
  must(engine()->removePose(old));
  for (int i = 0; i < 4; ++i) {
    for (const PoseHandle palette : {old, PoseHandle{}, PoseHandle{1000, 1}}) {
      InstanceDescription instance = one_->description;
      instance.pose = palette;
      const std::string text = unknown("pose", palette);
      expectInvalid(engine()->addInstance(instance), text);
      expectInvalid(engine()->writePose(palette), text);
      expectInvalid(engine()->removePose(palette), text);
    }
    engine().submit();
    engine().begin();
    EXPECT_NE(must(engine()->addPose(8)), old);
  }
}

TEST_F(SystemHandlesTest, WhatAnInstanceUsesStays) {
  const MeshHandle first = one_->description.mesh;
  const std::string used = " is used by 1 instance";
  expectInvalid(engine()->removeMesh(first), "mesh " + std::to_string(first.index) + used);
  expectInvalid(engine()->removePose(one_->description.pose), "pose 0" + used);
  const MeshHandle second = engine().addMesh(systemMesh(2, 30));
  must(engine()->change({.instance = one_->instance, .mesh = second}));
  must(engine()->removeMesh(first));
  expectInvalid(engine()->removeMesh(second), "mesh " + std::to_string(second.index) + used);
  must(engine()->removeInstance(one_->instance));
  must(engine()->removeMesh(second));
  must(engine()->removePose(one_->description.pose));
  engine().submit();
}

TEST_F(SystemHandlesTest, DescriptionsThatBreakARuleAreRefused) {
  using Change = std::function<void(InstanceDescription&)>;
  const MeshHandle bare = engine().addMesh(must([] {
    OwnedMesh mesh = randomMesh(1, 20, 8, 4, false);
    return pack(mesh.view(), 8);
  }()));
  const PoseHandle narrow = must(engine()->addPose(1));
  const float infinity = std::numeric_limits<float>::infinity();
  const std::pair<const char*, Change> changes[] = {
      {"update interval must be at least 1", [](InstanceDescription& d) { d.updateInterval = 0; }},
      {"mesh needs a pose of 8 joints, but pose ",
       [&](InstanceDescription& d) { d.pose = narrow; }},
      {"positions cannot be stored as none",
       [](InstanceDescription& d) { d.layout.positions = VertexFormat::none; }},
      {"positions cannot be stored as octahedral16x2",
       [](InstanceDescription& d) { d.layout.positions = VertexFormat::octahedral16x2; }},
      {"tangents cannot be stored as float32x3",
       [](InstanceDescription& d) { d.layout.tangents = VertexFormat::float32x3; }},
      {"its mesh has none", [&](InstanceDescription& d) { d.mesh = bare; }},
      {"stride of 32 bytes is less than", [](InstanceDescription& d) { d.layout.stride = 32; }},
      {"the box of its snorm16 positions must be finite, with sides longer than 0",
       [](InstanceDescription& d) { d.layout.positions = VertexFormat::snorm16x4; }},
      {"the box of its snorm16 positions must be finite, with sides longer than 0",
       [&](InstanceDescription& d) {
         d.layout.positions = VertexFormat::snorm16x4;
         d.box = {{-1, -1, -1}, {1, 1, infinity}};
       }},
      {"centers of rotation",
       [&](InstanceDescription& d) {
         OwnedMesh mesh = randomMesh(1, 20, 8, 4);
         mesh.centersOfRotation.clear();
         d.mesh = engine().addMesh(must(pack(mesh.view(), 8)));
         d.method = Method::centerOfRotation;
       }},
  };
  for (const auto& [what, change] : changes) {
    InstanceDescription instance = one_->description;
    change(instance);
    expectInvalid(engine()->addInstance(instance), what);
  }
  engine().submit();
  EXPECT_EQ(engine().lastFrame().instances, 1u);
}

TEST_F(SystemHandlesTest, ChangesThatBreakARuleAreRefused) {
  const MorphWeight missing{3, 1}, twice[] = {{1, 1}, {1, 0.5f}};
  const MorphWeight infinite{0, std::numeric_limits<float>::infinity()};
  expectInvalid(engine()->change({.instance = one_->instance,
                                  .morphs = std::span<const MorphWeight>(&missing, 1)}),
                "there is no morph target 3 among the 3 of its mesh");
  expectInvalid(engine()->change({.instance = one_->instance, .morphs = twice}),
                "has morph target 1 twice");
  expectInvalid(engine()->change({.instance = one_->instance,
                                  .morphs = std::span<const MorphWeight>(&infinite, 1)}),
                "weight");
  expectInvalid(engine()->change({.instance = one_->instance, .updateInterval = 0}),
                "the update interval must be at least 1 frame, not 0");
  const MeshHandle wide = engine().addMesh(systemMesh(2, 30, 50));
  expectInvalid(engine()->change({.instance = one_->instance, .mesh = wide}),
                "needs a pose of 50 joints");
  engine().submit();
  expectSkinned(engine().read(one_->instance),
                alone(one_->packed, systemPose(1), one_->description));
}

TEST_F(SystemHandlesTest, BudgetsThatAreFullRefuse) {
  SceneRecorderDescription small = description();
  const PackedMesh mesh = systemMesh(1, 100);
  small.scene.meshCapacity = Capacity::fixed(mesh.bytes().size() + 16);
  small.scene.jointCapacity = Capacity::fixed(20);
  SystemEngine full(device(), context(), small);
  full.begin();
  const MeshHandle first = full.addMesh(mesh);
  expectRefused(full->addMesh(mesh), ErrorCode::limitExceeded, "bytes of meshes only 16 are free");
  const PoseHandle palette = must(full->addPose(12));
  expectRefused(full->addPose(12), ErrorCode::limitExceeded, "their maximum is 20");
  must(full->removeMesh(first));
  must(full->removePose(palette));
  full.submit();
  full.begin();
  full.submit();
  full.begin();
  full.addMesh(mesh);
  must(full->addPose(12));
  full.submit();
}

// Whatever another palette has left in its memory, and whether or not the frame in which it was
// added had anything else to do.
TEST_F(SystemHandlesTest, APoseRestsInTheIdentityUntilItIsWritten) {
  SceneRecorderDescription small = description();
  small.scene.jointCapacity = Capacity::fixed(8);
  for (const bool hasWork : {false, true}) {
    SingleInstance one(device(), context(), small, plainLayout());
    one.engine.submit();
    for (std::uint32_t frame = 0; frame < small.scene.framesInFlight; ++frame) {
      one.engine.begin();
      one.engine.writePose(one.description.pose, systemPose(3 + frame));
      one.engine.submit();
    }
    one.engine.begin();
    must(one.engine->removeInstance(one.instance));
    must(one.engine->removePose(one.description.pose));
    one.engine.submit();
    one.engine.begin();
    one.description.pose = must(one.engine->addPose(8));
    if (!hasWork) {
      one.engine.submit();
      EXPECT_EQ(one.engine.lastFrame().dispatches, 0u);
      one.engine.begin();
    }
    one.instance = one.engine.addInstance(one.description);
    one.engine.submit();
    expectSkinned(one.engine.read(one.instance), alone(one.packed, Pose(8), one.description));
  }
}

TEST_F(SystemHandlesTest, MoreInstancesAndBoundsThanBudgetedAreRefused) {
  SceneRecorderDescription small = description();
  small.scene.instanceCapacity = Capacity::fixed(3);
  small.scene.boundsCapacity = Capacity::fixed(1);
  SingleInstance first(device(), context(), small, plainLayout());
  EXPECT_EQ(first.engine->visibilityCount(), 3u);
  InstanceDescription bounded = first.description;
  bounded.bounds = true;
  const InstanceHandle second = first.engine.addInstance(bounded);
  expectRefused(first.engine->addInstance(bounded), ErrorCode::limitExceeded,
                "the maximum of boundsCapacity");
  first.engine.addInstance(first.description);
  expectRefused(first.engine->addInstance(first.description), ErrorCode::limitExceeded,
                "the maximum of instanceCapacity");
  must(first.engine->removeInstance(second));
  first.engine.addInstance(bounded);
  first.engine.submit();
  EXPECT_EQ(first.engine.lastFrame().instances, 3u);
}

TEST_F(SystemHandlesTest, FramesAreCountedUpwards) {
  SceneRecorder system = must(SceneRecorder::create(context(), description()));
  expectInvalid(system.record(VK_NULL_HANDLE), "beginFrame must be called before each frame");
  const PoseHandle palette = must(system.scene().addPose(4));
  must(system.scene().writePose(palette));  // for the first frame
  expectInvalid(system.scene().beginFrame(0, 0), "the frame must be larger than 0");
  must(system.scene().beginFrame(1, 0));
  expectInvalid(system.scene().beginFrame(1, 0), "the frame must be larger than 1");
  must(system.record(VK_NULL_HANDLE));  // nothing to do
  expectInvalid(system.scene().beginFrame(2, 2), "less than the frame");
  must(system.scene().beginFrame(2, 0));
  must(system.record(VK_NULL_HANDLE));
  expectInvalid(system.scene().beginFrame(3, 0),
                "more frames are in flight than framesInFlight, which is 2");
  must(system.scene().beginFrame(3, 2));
  expectInvalid(system.scene().beginFrame(4, 1), "the completed frame at least 2");
  expectInvalid(system.scene().beginFrame(2, 1), "the frame must be larger than 3");
  must(system.scene().beginFrame(4, 3));
}

TEST_F(SystemHandlesTest, RecordIsCalledOnceAFrame) {
  engine().submit();
  expectInvalid(engine().recorder().record(VK_NULL_HANDLE),
                "beginFrame must be called before each frame");
  expectInvalid(engine()->writePose(one_->description.pose), "only between beginFrame and record");
}

TEST_F(SystemHandlesTest, SystemsThatMakeNoSenseAreRefused) {
  using Change = std::function<void(SceneRecorderDescription&)>;
  const auto create = [](void*, const VkBufferCreateInfo&, vulkan::BufferUse,
                         const char*) -> Result<vulkan::CreatedBuffer> {
    return Error{ErrorCode::ioError, "never called"};
  };
  const std::pair<const char*, Change> changes[] = {
      {"framesInFlight", [](SceneRecorderDescription& d) { d.scene.framesInFlight = 0; }},
      {"meshCapacity",
       [](SceneRecorderDescription& d) { d.scene.meshCapacity = Capacity::fixed(0); }},
      {"jointCapacity",
       [](SceneRecorderDescription& d) {
         d.scene.jointCapacity = {2, 1};
       }},
      {"outputCapacity",
       [](SceneRecorderDescription& d) { d.scene.outputCapacity = Capacity::fixed(0); }},
      {"instanceCapacity",
       [](SceneRecorderDescription& d) { d.scene.instanceCapacity = Capacity::fixed(0); }},
      {"buffers", [&](SceneRecorderDescription& d) { d.buffers.create = create; }},
      {"Tuning::workgroupSize",
       [](SceneRecorderDescription& d) {
         d.tuning = Tuning{33, 4};
       }},
  };
  for (const auto& [field, change] : changes) {
    SceneRecorderDescription broken = description();
    change(broken);
    const Result<SceneRecorder> system = SceneRecorder::create(context(), broken);
    ASSERT_FALSE(system.ok()) << field;
    EXPECT_EQ(system.error().code, ErrorCode::invalidArgument) << field;
    EXPECT_NE(system.error().message.find(field), std::string::npos) << system.error().message;
  }
  SceneRecorderDescription large = description();
  large.scene.meshCapacity = Capacity::fixed(context().limits().maxStorageBufferRange + 4096);
  expectRefused(SceneRecorder::create(context(), large), ErrorCode::limitExceeded, "meshCapacity");
  // Sizes that no integer holds.
  large.scene.meshCapacity = Capacity::fixed(std::numeric_limits<std::uint64_t>::max());
  expectRefused(SceneRecorder::create(context(), large), ErrorCode::limitExceeded, "meshCapacity");
  large = description();
  large.scene.framesInFlight = std::numeric_limits<std::uint32_t>::max();
  large.scene.jointCapacity = Capacity::fixed(large.scene.framesInFlight);
  expectRefused(SceneRecorder::create(context(), large), ErrorCode::limitExceeded,
                "framesInFlight");
}

// The context may move to another place while a system lives, which goes on to make bindings and
// pipelines with it.
TEST_F(SystemHandlesTest, TheContextMayBeMoved) {
  std::optional<vulkan::Context> second;  // outlives the system
  std::optional<vulkan::Context> first = must(vulkan::Context::create(device().description()));
  SceneRecorderDescription own = description();
  SystemEngine engine(device(), *first, own);
  engine.begin();
  InstanceDescription instance;
  instance.layout = plainLayout();
  const PackedMesh packed = systemMesh(1, 20);
  instance.mesh = engine.addMesh(packed);
  instance.pose = engine.addPose(systemPose(1));
  std::vector<InstanceHandle> instances{engine.addInstance(instance)};
  engine.submit();
  second.emplace(std::move(*first));
  first.reset();
  // So many that new tables are needed.
  engine.begin();
  instance.culledOnGpu = true;
  must(engine.recorder().prepare(instance));
  instance.culledOnGpu = false;
  while (instances.size() < 3000) instances.push_back(must(engine->addInstance(instance)));
  engine.submit();
  EXPECT_EQ(engine.lastFrame().skinnedInstances, 2999u);
  const std::vector<std::byte> bytes = engine.readOutput();
  const Streams expected = alone(packed, systemPose(1), instance);
  for (const InstanceHandle handle : {instances.front(), instances.back()})
    expectSkinned(engine.read(bytes, handle), expected);
}

TEST_F(SystemHandlesTest, WhatWasNotPreparedIsTriedAgain) {
  // A context of its own, which has no pipelines yet.
  vulkan::Context fresh = must(vulkan::Context::create(device().description()));
  SceneRecorderDescription own = description();
  SystemEngine unprepared(device(), fresh, own);
  unprepared.begin();
  InstanceDescription instance = one_->description;
  instance.mesh = unprepared.addMesh(one_->packed);
  instance.pose = unprepared.addPose(systemPose(2));
  const InstanceHandle handle = must(unprepared->addInstance(instance));
  expectRefused(unprepared.trySubmit(), ErrorCode::notPrepared,
                "call SceneRecorder::prepare for it first");
  must(unprepared.recorder().prepare(instance));
  unprepared.runFrame();
  EXPECT_EQ(unprepared.lastFrame().skinnedInstances, 1u);
  EXPECT_TRUE(unprepared.read(handle) == alone(one_->packed, systemPose(2), instance));
  engine().submit();
}

TEST_F(SystemHandlesTest, ASystemCanBeMoved) {
  SceneRecorder first = must(SceneRecorder::create(context(), description()));
  const PoseHandle palette = must(first.scene().addPose(4));
  SceneRecorder second = std::move(first);
  must(second.scene().beginFrame(1, 0));
  EXPECT_EQ(must(second.scene().writePose(palette)).size(), 4u);
  second = must(SceneRecorder::create(context(), description()));
  expectInvalid(second.scene().removePose(palette), "belongs to another system");
}

}  // namespace
}  // namespace dermis::test
