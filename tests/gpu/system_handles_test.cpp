// What a system refuses: handles of things that are gone, and arguments that break a rule.

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "system_test.h"

namespace dermis::test {
namespace {

using vulkan::SkinningSystem;
using vulkan::SkinningSystemDescription;

class SystemHandlesTest : public SystemTest {
 protected:
  void SetUp() override {
    SystemTest::SetUp();
    if (device_ != nullptr) one_.emplace(device(), description(), motionLayout());
  }
  void TearDown() override {
    one_.reset();
    SystemTest::TearDown();
  }
  SystemEngine& engine() { return one_->engine; }

  template <typename T>
  static void expectRefused(const Result<T>& result, ErrorCode code, const char* what) {
    ASSERT_FALSE(result.ok()) << what;
    EXPECT_EQ(result.error().code, code) << what << ": " << result.error().message;
    EXPECT_FALSE(result.error().message.empty()) << what;
  }
  template <typename T>
  static void expectInvalid(const Result<T>& result, const char* what) {
    expectRefused(result, ErrorCode::invalidArgument, what);
  }

  void expectStaleInstance(InstanceHandle instance) {
    SkinningSystem& system = engine().system();
    expectInvalid(system.removeInstance(instance), "removeInstance");
    expectInvalid(system.change({.instance = instance, .visible = false}), "visible");
    expectInvalid(system.change({.instance = instance, .updateInterval = 2}), "updateInterval");
    expectInvalid(system.change({.instance = instance, .teleports = true}), "teleports");
    expectInvalid(system.change({.instance = instance, .morphs = std::span<const MorphWeight>()}),
                  "morphs");
    expectInvalid(system.change({.instance = instance, .mesh = one_->description.mesh}), "mesh");
    expectInvalid(system.output(instance), "output");
    expectInvalid(system.bounds(instance), "bounds");
    expectInvalid(system.visibilityIndex(instance), "visibilityIndex");
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
      expectInvalid(engine()->addInstance(instance), "addInstance");
      expectInvalid(engine()->change({.instance = one_->instance, .mesh = mesh}), "mesh");
      expectInvalid(engine()->removeMesh(mesh), "removeMesh");
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
      expectInvalid(engine()->addInstance(instance), "addInstance");
      expectInvalid(engine()->writePose(palette), "writePose");
      expectInvalid(engine()->removePose(palette), "removePose");
    }
    engine().submit();
    engine().begin();
    EXPECT_NE(must(engine()->addPose(8)), old);
  }
}

TEST_F(SystemHandlesTest, WhatAnInstanceUsesStays) {
  const MeshHandle first = one_->description.mesh;
  expectInvalid(engine()->removeMesh(first), "removeMesh");
  expectInvalid(engine()->removePose(one_->description.pose), "removePose");
  const MeshHandle second = engine().addMesh(systemMesh(2, 30));
  must(engine()->change({.instance = one_->instance, .mesh = second}));
  must(engine()->removeMesh(first));
  expectInvalid(engine()->removeMesh(second), "removeMesh");
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
      {"updateInterval", [](InstanceDescription& d) { d.updateInterval = 0; }},
      {"too few joints", [&](InstanceDescription& d) { d.pose = narrow; }},
      {"no positions", [](InstanceDescription& d) { d.layout.positions = VertexFormat::none; }},
      {"octahedral positions",
       [](InstanceDescription& d) { d.layout.positions = VertexFormat::octahedral16x2; }},
      {"tangents of three components",
       [](InstanceDescription& d) { d.layout.tangents = VertexFormat::float32x3; }},
      {"normals of a mesh without", [&](InstanceDescription& d) { d.mesh = bare; }},
      {"stride", [](InstanceDescription& d) { d.layout.stride = 32; }},
      {"a box without extent",
       [](InstanceDescription& d) { d.layout.positions = VertexFormat::snorm16x4; }},
      {"an infinite box",
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
                "target");
  expectInvalid(engine()->change({.instance = one_->instance, .morphs = twice}), "a target twice");
  expectInvalid(engine()->change({.instance = one_->instance,
                                  .morphs = std::span<const MorphWeight>(&infinite, 1)}),
                "weight");
  expectInvalid(engine()->change({.instance = one_->instance, .updateInterval = 0}), "interval");
  expectInvalid(engine()->addPose(0), "addPose");
  EXPECT_FALSE(engine()->addPose(maxPoseJoints + 1).ok());
  const MeshHandle wide = engine().addMesh(systemMesh(2, 30, 50));
  expectInvalid(engine()->change({.instance = one_->instance, .mesh = wide}), "mesh");
  engine().submit();
  expectSkinned(engine().read(one_->instance),
                alone(one_->packed, systemPose(1), one_->description));
}

TEST_F(SystemHandlesTest, BudgetsThatAreFullRefuse) {
  SkinningSystemDescription small = description();
  const PackedMesh mesh = systemMesh(1, 100);
  small.meshCapacity = Capacity::fixed(mesh.bytes().size() + 16);
  small.jointCapacity = Capacity::fixed(20);
  SystemEngine full(device(), small);
  full.begin();
  const MeshHandle first = full.addMesh(mesh);
  expectRefused(full->addMesh(mesh), ErrorCode::limitExceeded, "addMesh");
  const PoseHandle palette = must(full->addPose(12));
  expectRefused(full->addPose(12), ErrorCode::limitExceeded, "addPose");
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
  SkinningSystemDescription small = description();
  small.jointCapacity = Capacity::fixed(8);
  for (const bool hasWork : {false, true}) {
    SingleInstance one(device(), small, plainLayout());
    one.engine.submit();
    for (std::uint32_t frame = 0; frame < small.framesInFlight; ++frame) {
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
  SkinningSystemDescription small = description();
  small.instanceCapacity = Capacity::fixed(3);
  small.boundsCapacity = Capacity::fixed(1);
  SingleInstance first(device(), small, plainLayout());
  EXPECT_EQ(first.engine->visibilityCount(), 3u);
  InstanceDescription bounded = first.description;
  bounded.bounds = true;
  const InstanceHandle second = first.engine.addInstance(bounded);
  expectRefused(first.engine->addInstance(bounded), ErrorCode::limitExceeded, "bounds");
  first.engine.addInstance(first.description);
  expectRefused(first.engine->addInstance(first.description), ErrorCode::limitExceeded,
                "instances");
  must(first.engine->removeInstance(second));
  first.engine.addInstance(bounded);
  first.engine.submit();
  EXPECT_EQ(first.engine.lastFrame().instances, 3u);
}

TEST_F(SystemHandlesTest, FramesAreCountedUpwards) {
  SkinningSystem system = must(SkinningSystem::create(description()));
  expectInvalid(system.record(VK_NULL_HANDLE), "record before any frame");
  const PoseHandle palette = must(system.addPose(4));
  expectInvalid(system.writePose(palette), "writePose before any frame");
  expectInvalid(system.beginFrame(0, 0), "frames count from 1");
  must(system.beginFrame(1, 0));
  expectInvalid(system.beginFrame(1, 0), "the same frame");
  must(system.record(VK_NULL_HANDLE));  // nothing to do
  expectInvalid(system.beginFrame(2, 2), "complete before it began");
  must(system.beginFrame(2, 0));
  must(system.record(VK_NULL_HANDLE));
  expectInvalid(system.beginFrame(3, 0), "a third frame of two in flight");
  must(system.beginFrame(3, 1));
  expectInvalid(system.beginFrame(4, 0), "what was complete is so no longer");
  expectInvalid(system.beginFrame(2, 1), "backwards");
  must(system.beginFrame(4, 3));
}

TEST_F(SystemHandlesTest, RecordIsCalledOnceAFrame) {
  engine().submit();
  expectInvalid(engine()->record(VK_NULL_HANDLE), "record without another beginFrame");
  expectInvalid(engine()->writePose(one_->description.pose), "writePose after record");
}

TEST_F(SystemHandlesTest, SystemsThatMakeNoSenseAreRefused) {
  using Change = std::function<void(SkinningSystemDescription&)>;
  const auto create = [](void*, const vulkan::BufferRequest&) -> Result<vulkan::CreatedBuffer> {
    return Error{ErrorCode::ioError, "never called"};
  };
  const std::pair<const char*, Change> changes[] = {
      {"context", [](SkinningSystemDescription& d) { d.context = nullptr; }},
      {"framesInFlight", [](SkinningSystemDescription& d) { d.framesInFlight = 0; }},
      {"meshCapacity", [](SkinningSystemDescription& d) { d.meshCapacity = Capacity::fixed(0); }},
      {"jointCapacity",
       [](SkinningSystemDescription& d) {
         d.jointCapacity = {2, 1};
       }},
      {"outputCapacity",
       [](SkinningSystemDescription& d) { d.outputCapacity = Capacity::fixed(0); }},
      {"instanceCapacity",
       [](SkinningSystemDescription& d) { d.instanceCapacity = Capacity::fixed(0); }},
      {"buffers", [&](SkinningSystemDescription& d) { d.buffers.create = create; }},
      {"Tuning::workgroupSize",
       [](SkinningSystemDescription& d) {
         d.tuning = Tuning{33, 4};
       }},
  };
  for (const auto& [field, change] : changes) {
    SkinningSystemDescription broken = description();
    change(broken);
    const Result<SkinningSystem> system = SkinningSystem::create(broken);
    ASSERT_FALSE(system.ok()) << field;
    EXPECT_EQ(system.error().code, ErrorCode::invalidArgument) << field;
    EXPECT_NE(system.error().message.find(field), std::string::npos) << system.error().message;
  }
  SkinningSystemDescription large = description();
  large.meshCapacity = Capacity::fixed(context().limits().maxStorageBufferRange + 4096);
  expectRefused(SkinningSystem::create(large), ErrorCode::limitExceeded, "meshCapacity");
  // Sizes that no integer holds.
  large.meshCapacity = Capacity::fixed(std::numeric_limits<std::uint64_t>::max());
  expectRefused(SkinningSystem::create(large), ErrorCode::limitExceeded, "meshCapacity");
  large = description();
  large.framesInFlight = std::numeric_limits<std::uint32_t>::max();
  large.jointCapacity = Capacity::fixed(large.framesInFlight);
  expectRefused(SkinningSystem::create(large), ErrorCode::limitExceeded, "framesInFlight");
}

// The context may move to another place while a system lives, which goes on to make bindings and
// pipelines with it.
TEST_F(SystemHandlesTest, TheContextMayBeMoved) {
  std::optional<vulkan::Context> second;  // outlives the system
  std::optional<vulkan::Context> first = must(vulkan::Context::create(device().description()));
  SkinningSystemDescription own = description();
  own.context = &*first;
  SystemEngine engine(device(), own);
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
  must(engine->prepare(pipelineNeeds(instance)));
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
  SkinningSystemDescription own = description();
  own.context = &fresh;
  SystemEngine unprepared(device(), own);
  unprepared.begin();
  InstanceDescription instance = one_->description;
  instance.mesh = unprepared.addMesh(one_->packed);
  instance.pose = unprepared.addPose(systemPose(2));
  const InstanceHandle handle = must(unprepared->addInstance(instance));
  expectRefused(unprepared.trySubmit(), ErrorCode::notPrepared, "record");
  must(unprepared->prepare(pipelineNeeds(instance)));
  unprepared.runFrame();
  EXPECT_EQ(unprepared.lastFrame().skinnedInstances, 1u);
  EXPECT_TRUE(unprepared.read(handle) == alone(one_->packed, systemPose(2), instance));
  engine().submit();
}

TEST_F(SystemHandlesTest, ASystemCanBeMoved) {
  SkinningSystem first = must(SkinningSystem::create(description()));
  const PoseHandle palette = must(first.addPose(4));
  SkinningSystem second = std::move(first);
  must(second.beginFrame(1, 0));
  EXPECT_EQ(must(second.writePose(palette)).size(), 4u);
  second = must(SkinningSystem::create(description()));
  expectInvalid(second.removePose(palette), "a handle of another system");
}

}  // namespace
}  // namespace dermis::test
