// cpu::SceneRunner: what the model-based test (gpu/system_model_test.cpp) does not do.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "cpu_engine.h"
#include "dermis/cpu.h"
#include "dermis/mesh.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t sceneJoints = 8, sceneVertices = 1001;

PackedMesh meshOf(std::uint32_t vertices) {
  OwnedMesh mesh = randomMesh(1, vertices, sceneJoints, 4);
  addTangents(mesh, 2);
  addMorphs(mesh, 3, 3);
  return must(pack(mesh.view(), sceneJoints));
}

/// Instances of one mesh in a pose each.
class CpuSceneTest : public ::testing::Test {
 protected:
  void add(std::uint32_t count, const VertexLayout& layout, bool bounds = false) {
    if (!mesh_) mesh_ = engine_.addMesh(packed_);
    InstanceDescription description;
    description.mesh = mesh_;
    description.layout = layout;
    description.bounds = bounds;
    description.box = {{-2, -2, -2}, {2, 2, 2}};
    for (std::uint32_t i = 0; i < count; ++i) {
      description.pose = must(engine_->addPose(sceneJoints));
      poses_.push_back(description.pose);
      descriptions_.push_back(description);
      instances_.push_back(must(engine_->addInstance(description)));
    }
  }
  void writePoses(std::uint32_t seed) {
    for (std::size_t i = 0; i < poses_.size(); ++i) engine_.writePose(poses_[i], poseOf(seed, i));
  }
  static std::vector<JointMatrix> poseOf(std::uint32_t seed, std::size_t index) {
    return randomPose(seed * 100 + static_cast<std::uint32_t>(index), sceneJoints, Rigidity::rigid);
  }
  /// What a job of the instance alone writes, and finds out.
  std::vector<std::byte> alone(std::size_t index, std::uint32_t seed, InstanceResult& found) const {
    const std::vector<JointMatrix> pose = poseOf(seed, index);
    cpu::Instance instance;
    instance.pose = pose;
    instance.box = descriptions_[index].box;
    instance.result = &found;
    return skinOne(packed_, descriptions_[index].method, descriptions_[index].layout, instance);
  }

  PackedMesh packed_ = meshOf(sceneVertices);
  CpuEngine engine_{{}};
  MeshHandle mesh_;
  std::vector<PoseHandle> poses_;
  std::vector<InstanceHandle> instances_;
  std::vector<InstanceDescription> descriptions_;
};

VertexLayout normalsToo() {
  VertexLayout layout;
  layout.normals = VertexFormat::float32x3;
  return layout;
}

TEST_F(CpuSceneTest, BoundsAndClampedVerticesAreThoseOfAllJobsTogether) {
  engine_.verticesPerJob = 100;  // several jobs for each instance
  VertexLayout snorm = normalsToo();
  snorm.positions = VertexFormat::snorm16x4;
  add(5, normalsToo(), true);
  add(6, snorm, true);
  for (std::uint32_t frame = 1; frame <= 3; ++frame) {
    engine_.begin();
    for (std::size_t i = 0; frame > 1 && i < instances_.size(); ++i) {
      InstanceResult found;
      alone(i, frame - 1, found);
      const std::optional<Box> box = must(engine_->bounds(instances_[i]));
      ASSERT_TRUE(box && found.box());
      for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(box->min[axis], found.box()->min[axis]);
        EXPECT_EQ(box->max[axis], found.box()->max[axis]);
      }
    }
    writePoses(frame);
    engine_.submit();
  }
  const std::vector<std::byte> bytes = engine_.readOutput();
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    InstanceResult found;
    const std::vector<std::byte> expected = alone(i, 3, found);
    const InstanceOutput output = must(engine_->output(instances_[i]));
    EXPECT_EQ(std::memcmp(bytes.data() + output.offset, expected.data(), expected.size()), 0) << i;
  }
}

TEST_F(CpuSceneTest, NoBitDependsOnHowLongJobsAre) {
  add(9, normalsToo());
  std::vector<std::byte> first;
  std::uint64_t frame = 0;
  for (const std::uint32_t vertices : {1u, 7u, 64u, 1000u, 5000u, 1u << 20}) {
    engine_.verticesPerJob = vertices;
    engine_.begin();
    writePoses(1);
    std::uint64_t planned = 0;
    const std::span<const cpu::PlannedJob> jobs = must(engine_.runner().jobs(vertices));
    for (const cpu::PlannedJob& job : jobs) {
      planned += job.vertexCount();
      // A job of up to sixteen instances has at least a block of each.
      EXPECT_LE(job.vertexCount(), std::max(vertices, 128u));
      cpu::run(job);
    }
    EXPECT_EQ(planned, 9u * sceneVertices);
    EXPECT_EQ(engine_->statistics().lastFrame.skinnedVertices, planned);
    EXPECT_EQ(engine_->statistics().lastFrame.frame, ++frame);
    if (first.empty()) first = engine_.readOutput();
    EXPECT_TRUE(engine_.readOutput() == first) << vertices;
  }
}

TEST_F(CpuSceneTest, TheOutputMayBeTheEngines) {
  const std::uint64_t size = std::uint64_t{sceneVertices} * 24;
  // Room for a third one but for its last word, of which half is there.
  std::vector<std::byte> memory(size * 3 - 2 + 64, std::byte{0xa5});
  CpuEngine engine({}, std::span(memory).subspan(32, size * 3 - 2));
  engine.begin();
  InstanceDescription instance;
  instance.mesh = engine.addMesh(packed_);
  instance.pose = must(engine->addPose(sceneJoints));
  instance.layout = normalsToo();
  static_cast<void>(must(engine->addInstance(instance)));
  static_cast<void>(must(engine->addInstance(instance)));
  const Result<InstanceHandle> third = engine->addInstance(instance);
  ASSERT_FALSE(third.ok());
  EXPECT_EQ(third.error().code, ErrorCode::limitExceeded);
  engine.submit();
  EXPECT_EQ(engine.runner().output().data(), memory.data() + 32);
  const auto isUntouched = [](std::byte byte) { return byte == std::byte{0xa5}; };
  EXPECT_TRUE(std::all_of(memory.begin(), memory.begin() + 32, isUntouched));
  EXPECT_TRUE(std::all_of(memory.end() - 32, memory.end(), isUntouched));
  EXPECT_FALSE(std::all_of(memory.begin() + 32, memory.end() - 32, isUntouched));
}

TEST_F(CpuSceneTest, WhatIsTheGpusIsRefused) {
  add(2, normalsToo());
  const auto expectRefused = [](const auto& result, const char* words) {
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(result.error().message.find(words), std::string::npos) << result.error().message;
  };
  expectRefused(engine_->addPose(sceneJoints, {.writtenByGpu = true}), "GPU");
  InstanceDescription description = descriptions_[0];
  description.culledOnGpu = true;
  expectRefused(engine_->addInstance(description), "culled on the GPU");
  description = descriptions_[0];
  description.method = Method::logMatrix;
  expectRefused(engine_->addInstance(description), "log_matrix");
  description = descriptions_[0];
  description.morphWriter = MorphWriter::gpu;
  expectRefused(engine_->addInstance(description), "the CPU skins it");
  const InstanceChange wrong{.instance = instances_[0], .method = Method::sphericalBlend};
  expectRefused(engine_->change(wrong), "spherical_blend");
  // The one before it is made.
  const std::array<InstanceChange, 3> changes{{{.instance = instances_[0], .visible = false},
                                               wrong,
                                               {.instance = instances_[1], .visible = false}}};
  expectRefused(engine_->change(changes), "1");
  engine_.begin();
  static_cast<void>(must(engine_.runner().jobs()));
  EXPECT_EQ(engine_->skinnedInstances().size(), 1u);
  EXPECT_EQ(engine_->skinnedInstances()[0], instances_[1]);
  expectRefused(engine_.runner().jobs(), "beginFrame");
  std::byte little[3];
  expectRefused(cpu::SceneRunner::create({}, little), "output");
}

// On a 32-bit system these bytes would be counted modulo 2^32.
TEST(CpuSceneCreationTest, MoreOutputThanAnObjectCanHoldIsRefused) {
  SceneDescription description;
  description.outputCapacity =
      Capacity::fixed(std::uint64_t{std::numeric_limits<std::ptrdiff_t>::max()} + 64);
  const auto system = cpu::SceneRunner::create(description);
  ASSERT_FALSE(system);
  EXPECT_NE(system.error().message.find("outputCapacity"), std::string::npos)
      << system.error().message;
}

// What a neighbor finds out later does not take it away either.
TEST_F(CpuSceneTest, BoundsStayWhereAnInstanceRests) {
  VertexLayout layout = normalsToo();
  layout.motion = true;
  add(3, layout, true);
  engine_.begin();
  writePoses(1);
  engine_.submit();
  engine_.begin();
  const Box first = must(engine_->bounds(instances_[1])).value();
  for (std::uint32_t frame = 2; frame < 5; ++frame) {
    engine_.writePose(poses_[0], poseOf(frame, 0));
    engine_.writePose(poses_[2], poseOf(frame, 2));
    engine_.submit();
    engine_.begin();
    const Box now = must(engine_->bounds(instances_[1])).value();
    EXPECT_EQ(std::memcmp(&first, &now, sizeof(now)), 0);
  }
  // Until it is skinned again, it has none.
  engine_.abandon([] {});
  engine_.begin();
  EXPECT_FALSE(must(engine_->bounds(instances_[1])).has_value());
  engine_.submit();
  engine_.begin();
  EXPECT_TRUE(must(engine_->bounds(instances_[1])).has_value());
}

// Whatever its interval is. Positions stored relative to two boxes are no motion.
TEST_F(CpuSceneTest, ANewBoxIsSkinnedAtOnceAndRestartsMotion) {
  VertexLayout layout = normalsToo();
  layout.positions = VertexFormat::snorm16x4;
  layout.motion = true;
  add(2, layout);
  for (const InstanceHandle instance : instances_)
    must(engine_->change({.instance = instance, .updateInterval = 4}));
  engine_.begin();
  writePoses(1);
  engine_.submit();
  for (std::uint32_t frame = 2; frame < 6; ++frame) {
    const float side = static_cast<float>(frame + 1);
    std::array<InstanceChange, 2> changes;
    for (std::size_t i = 0; i < 2; ++i) {
      changes[i].instance = instances_[i];
      changes[i].box = descriptions_[i].box = {{-side, -2, -2}, {side, 2, 2}};
    }
    // With something that needs another kernel.
    changes[1].method = descriptions_[1].method =
        frame % 2 == 0 ? Method::linear : Method::dualQuaternion;
    engine_.begin();
    must(engine_->change(changes));
    engine_.submit();
    EXPECT_EQ(engine_->skinnedInstances().size(), 2u) << frame;
    const std::vector<std::byte> bytes = engine_.readOutput();
    for (std::size_t i = 0; i < 2; ++i) {
      InstanceResult found;
      const std::vector<std::byte> expected = alone(i, 1, found);
      const Streams streams = engine_.read(bytes, instances_[i]);
      EXPECT_TRUE(streams[positionStream] ==
                  readAttribute(expected,
                                must(placeVertices(layout, sceneVertices))[Stream::positions],
                                sceneVertices))
          << frame << ", " << i;
      EXPECT_TRUE(streams[previousStream] == streams[positionStream]) << frame << ", " << i;
    }
  }
}

// The vertices are those that a job with this instance alone writes.
TEST_F(CpuSceneTest, PosesThatMayNotScaleDoNot) {
  engine_.begin();
  mesh_ = engine_.addMesh(packed_);
  const std::vector<JointMatrix> pose = randomPose(1, sceneJoints, Rigidity::shear);
  std::vector<std::vector<std::byte>> outputs;
  // With normals it is the fast path.
  for (const VertexLayout& layout : {VertexLayout(), normalsToo()}) {
    for (const JointPromise promise : {JointPromise::scaling, JointPromise::scaleIgnored}) {
      InstanceDescription description;
      description.mesh = mesh_;
      description.layout = layout;
      description.pose = must(engine_->addPose(sceneJoints, {.promise = promise}));
      engine_.writePose(description.pose, pose);
      instances_.push_back(must(engine_->addInstance(description)));
      cpu::Instance instance;
      instance.pose = pose;
      instance.promise = promise;
      outputs.push_back(skinOne(packed_, description.method, description.layout, instance));
    }
  }
  engine_.submit();
  EXPECT_NE(outputs[0], outputs[1]);
  EXPECT_NE(outputs[2], outputs[3]);
  const std::vector<std::byte> bytes = engine_.readOutput();
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const InstanceOutput output = must(engine_->output(instances_[i]));
    ASSERT_EQ(output.places.size, outputs[i].size());
    EXPECT_EQ(std::memcmp(bytes.data() + output.offset, outputs[i].data(), output.places.size), 0)
        << i;
  }
}

TEST_F(CpuSceneTest, PosesAreTheIdentityUntilTheyAreWritten) {
  engine_.begin();
  const PoseHandle other = must(engine_->addPose(sceneJoints));  // whose place is used again
  engine_.writePose(other, poseOf(1, 0));
  must(engine_->removePose(other));
  engine_.submit();
  engine_.begin();
  add(1, normalsToo());
  engine_.submit();
  const InstanceOutput output = must(engine_->output(instances_[0]));
  const OwnedMesh source = randomMesh(1, sceneVertices, sceneJoints, 4);
  const std::vector<std::byte> positions =
      readAttribute(engine_.readOutput(), output.places[Stream::positions], sceneVertices);
  for (std::size_t i = 0; i < sceneVertices * 3u; ++i) {
    float value;
    std::memcpy(&value, positions.data() + i * 4, 4);
    ASSERT_NEAR(value, source.positions[i], 1e-6f * (1 + std::abs(value))) << i;
  }
}

}  // namespace
}  // namespace dermis::test
