// How the buffers of a scene grow, without a device: what the engine is asked for, and what happens
// where a storage buffer range, a maximum or the engine's memory ends.

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "planned_scene.h"
#include "played_clips.h"
#include "rigged.h"

namespace dermis::test {
namespace {

constexpr std::uint64_t range = 65536;
constexpr std::uint32_t vertices = 1000;  ///< of 24 bytes: three outputs in 65536 bytes, not more
/// Of a packed mesh: header, and positions and normals.
constexpr std::uint32_t meshBytes = 80 + 16 + 2 * 16 * vertices;

MeshInfo meshInfo() {
  MeshInfo info;
  info.vertexCount = vertices;
  info.requiredJoints = 4;
  info.maxInfluences = 4;
  info.morphTargetCount = 2;
  info.hasNormals = true;
  info.byteSize = meshBytes;
  return info;
}

class SceneGrowthTest : public ::testing::Test {
 protected:
  SceneGrowthTest() {
    description.limits.maxStorageBufferRange = range;
    description.limits.maxStorageBuffersPerStage = storageBuffersWanted;
    description.scene.meshCapacity = {meshBytes};
    description.scene.outputCapacity = {range};
  }

  void create() {
    owner.emplace();
    owner->refuses = [this](const SceneBuffer& wanted) -> Result<void> {
      if (wanted.requirement.size <= most) return {};
      return Error{ErrorCode::vulkanError, "no memory"};
    };
    must(owner->tryToCreate(description));
    scene = &owner->scene();
    owner->asked.clear();
    instance.mesh = owner->addMesh(meshInfo()).value();
    instance.pose = scene->addPose(4).value();
    instance.layout.normals = VertexFormat::float32x3;
  }

  /// Number of the runs in which a frame skins what is due.
  std::size_t plannedRuns() {
    ++frame;
    EXPECT_TRUE(scene->beginFrame(frame, frame - 1).ok());
    owner->record();
    std::size_t runs = 0;
    for (const PlannedDispatch& dispatch : dispatchesOf(owner->planned)) {
      if (dispatch.variant.kernel == Kernel::skin) runs += dispatch.skinPush().groupCount;
    }
    return runs;
  }

  template <typename T>
  static void expectRefused(const Result<T>& result, ErrorCode code, const std::string& text) {
    ASSERT_FALSE(result.ok()) << text;
    EXPECT_EQ(result.error().code, code) << result.error().message;
    EXPECT_NE(result.error().message.find(text), std::string::npos) << result.error().message;
  }

  std::uint64_t most = ~std::uint64_t{0};  ///< of one buffer
  SceneCommandsDescription description;
  std::optional<PlannedScene> owner;
  Scene* scene = nullptr;
  InstanceDescription instance;
  std::uint64_t frame = 0;
};

// It is longer than what always fits into one range, and lies in one.
TEST_F(SceneGrowthTest, AnInstanceThatIsCulledOnTheGpuChangesAfterTheOutputHasGrownBeyondARange) {
  create();
  instance.culledOnGpu = true;
  const InstanceHandle culled = scene->addInstance(instance).value();
  instance.culledOnGpu = false;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(scene->addInstance(instance).ok());
  ASSERT_GT(scene->statistics().outputs.capacity, range);
  const MorphWeight morph{1, 0.5f};
  InstanceChange change{.instance = culled, .method = Method::linear};
  change.morphs = std::span(&morph, 1);
  const Result<void> changed = scene->change(change);
  EXPECT_TRUE(changed.ok()) << changed.error().message;
  change.method.reset();
  change.morphs = std::span<const MorphWeight>();
  EXPECT_TRUE(scene->change(change).ok());
  // One beyond the end of the first range is in two runs; the GPU would choose each for itself.
  EXPECT_GT(plannedRuns(), 4u);
  instance.culledOnGpu = true;
  bool isRefused = false;
  for (int i = 0; i < 3; ++i) isRefused |= !scene->addInstance(instance);
  EXPECT_TRUE(isRefused);
}

TEST_F(SceneGrowthTest, WhatWouldLieInTwoRangesStaysWhereItIs) {
  description.scene.outputCapacity = {range * 4};
  create();
  std::vector<InstanceHandle> before;
  for (int i = 0; i < 3; ++i) before.push_back(scene->addInstance(instance).value());
  instance.culledOnGpu = true;
  Result<InstanceHandle> culled = scene->addInstance(instance);
  while (!culled) {
    // Room between, until it lies in one range.
    instance.culledOnGpu = false;
    before.push_back(scene->addInstance(instance).value());
    instance.culledOnGpu = true;
    culled = scene->addInstance(instance);
  }
  plannedRuns();
  const std::uint64_t offset = scene->output(*culled)->offset;
  ASSERT_TRUE(scene->removeInstance(before[2]).ok());
  plannedRuns();
  plannedRuns();
  const std::uint64_t used = scene->statistics().outputs.used;
  scene->compact(~std::uint64_t{0});
  plannedRuns();
  plannedRuns();
  EXPECT_EQ(scene->output(*culled)->offset, offset);
  EXPECT_EQ(scene->statistics().outputs.used, used) << "the place where it cannot stand is free";
  const MorphWeight morph{0, 1};
  const InstanceChange change{.instance = *culled, .morphs = std::span(&morph, 1)};
  EXPECT_TRUE(scene->change(change).ok()) << "it is skinned to where it is";
}

// Whatever frames are in flight.
TEST_F(SceneGrowthTest, FiguresAndPosesThatAreRefusedTakeNothing) {
  description.scene.gpuJointCapacity = Capacity::fixed(playedSkins * 8 + 4);
  create();
  const ClipsHandle clips = scene->addClips(PackedClips(playedClips())).value();
  const RigHandle rig = scene->addRig(riggedPose(1, 0)).value();
  ASSERT_TRUE(scene->beginFrame(1, 0).ok());
  const std::uint64_t used = scene->statistics().palettes.used;
  expectRefused(scene->addFigure(clips, std::array{RigHandle(), rig}), ErrorCode::limitExceeded,
                "joints");
  EXPECT_EQ(scene->statistics().palettes.used, used);
  const Result<FigureHandle> figure = scene->addFigure(clips);
  ASSERT_TRUE(figure.ok()) << figure.error().message;
  ASSERT_TRUE(scene->removeFigure(*figure).ok());
  ASSERT_TRUE(scene->beginFrame(2, 1).ok());
  std::array<PoseHandle, 2> poses;
  expectRefused(scene->addPoses(poses, riggedJoints, {.writtenByGpu = true, .rig = rig}),
                ErrorCode::limitExceeded, "joints");
  EXPECT_TRUE(scene->addPoses(poses, riggedJoints, {.writtenByGpu = true}).ok());
}

// The rig kernel keeps the rotations of inputs, and the functions of up to 64 examples.
TEST_F(SceneGrowthTest, PosesWithCorrectivesHaveRoomForWhatTheKernelKeeps) {
  description.limits.minStorageBufferOffsetAlignment = 16;  // without a gap between the poses
  create();
  const RigHandle rig = scene->addRig(riggedPose()).value();
  const PoseOptions options{.rig = rig};
  const std::array poses{scene->addPose(riggedJoints, options).value(),
                         scene->addPose(riggedJoints, options).value()};
  std::array<BufferPart, 2> parts;
  for (std::size_t i = 0; i < poses.size(); ++i)
    parts[i] = owner->books().drivenPart(poses[i]).value();
  EXPECT_EQ(parts[0].size, sizeof(JointMatrix) * drivenJoints + 4 * (givenWeights + drivenWeights));
  if (parts[0].offset > parts[1].offset) std::swap(parts[0], parts[1]);
  ASSERT_EQ(parts[0].buffer, parts[1].buffer);
  const std::uint64_t firstKept = (parts[0].offset + parts[0].size + 15) / 16 * 16;
  constexpr std::uint64_t mostInputs = 2;
  EXPECT_LE(firstKept + 16 * mostInputs + 4 * maxRigExamples, parts[1].offset);
}

TEST_F(SceneGrowthTest, AttributesThatTheDeviceCannotBindApartAreRefusedWhereTheyAreAdded) {
  description.scene.outputCapacity = {range * 2};
  for (const bool separate : {true, false}) {
    description.limits.separateRanges = separate;
    create();
    instance.layout.planar = true;
    bool isRefused = false;
    for (int i = 0; i < 8; ++i) {
      const Result<InstanceHandle> added = scene->addInstance(instance);
      if (added) continue;
      isRefused = true;
      expectRefused(added, ErrorCode::limitExceeded, "separateRanges");
      break;
    }
    EXPECT_NE(isRefused, separate);
    instance.layout.planar = false;
    for (int i = 0; i < 8; ++i) EXPECT_TRUE(scene->addInstance(instance).ok());
    frame = 0;
    EXPECT_GT(plannedRuns(), 2u);
  }
}

TEST_F(SceneGrowthTest, TheLeastIsAskedForWhereThereIsNoMemoryForTwice) {
  create();
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(scene->addInstance(instance).ok());
  most = range + 24'000;
  ASSERT_TRUE(scene->addInstance(instance).ok());
  ASSERT_EQ(owner->asked.size(), 2u);
  EXPECT_EQ(owner->asked[0].requirement.size, 2 * range);
  EXPECT_EQ(owner->asked[1].requirement.size, 3 * 24'000u);
  EXPECT_EQ(owner->sizeOf(BufferRole::positions), 3 * 24'000u);
  expectRefused(scene->addInstance(instance), ErrorCode::vulkanError, "no memory");
  EXPECT_EQ(owner->sizeOf(BufferRole::positions), 3 * 24'000u);
  // Of poses, another buffer.
  owner->asked.clear();
  most = 200 * 2 * sizeof(JointMatrix);
  ASSERT_TRUE(scene->addPose(100).ok());
  ASSERT_TRUE(scene->addPose(200).ok());
  ASSERT_EQ(owner->asked.size(), 2u);
  EXPECT_EQ(owner->asked[0].requirement.size, 256 * 2 * sizeof(JointMatrix));
  EXPECT_EQ(owner->asked[1].requirement.size, 200 * 2 * sizeof(JointMatrix));
  expectRefused(scene->addPose(201), ErrorCode::vulkanError, "no memory");
}

TEST_F(SceneGrowthTest, MaximaThatAreNoWholeUnitsEndBeforeThem) {
  description.scene.meshCapacity = {meshBytes, 2 * meshBytes + 9};
  description.scene.outputCapacity = {24'000, 72'003};
  create();
  EXPECT_TRUE(owner->addMesh(meshInfo()).ok());
  expectRefused(owner->addMesh(meshInfo()), ErrorCode::limitExceeded, "of 64192 bytes");
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(scene->addInstance(instance).ok());
  expectRefused(scene->addInstance(instance), ErrorCode::limitExceeded, "of 72000 bytes");
  EXPECT_EQ(owner->sizeOf(BufferRole::meshes), 2u * meshBytes);
  EXPECT_EQ(owner->sizeOf(BufferRole::positions), 72'000u);
  description.scene.outputCapacity = {5, 6};
  EXPECT_EQ(PlannedScene(description).sizeOf(BufferRole::positions), 8u);
}

// The device's alignment may be larger than a joint matrix.
TEST_F(SceneGrowthTest, PosesThatTheGpuWritesCanBeBoundAtTheirOffset) {
  description.limits.minStorageBufferOffsetAlignment = 256;
  create();
  for (const std::uint32_t joints : {5u, 1u, 100u, 7u, 70u}) {
    const PoseHandle pose = scene->addPose(joints, {.writtenByGpu = true}).value();
    EXPECT_EQ(owner->books().posePart(pose)->offset % 256, 0u) << joints;
  }
}

TEST_F(SceneGrowthTest, WhyThereIsNoRoomForJointsIsSaid) {
  description.scene.jointCapacity = {256, 600};
  create();
  ASSERT_TRUE(scene->addPose(250).ok());
  expectRefused(scene->addPose(400), ErrorCode::limitExceeded,
                "a pose takes 400 joints in one pose buffer, which holds at most 682; all pose "
                "buffers that the CPU writes hold 256 joints, of which 254 are in use; their "
                "maximum is 600");
  std::vector<PoseHandle> poses(1000);
  expectRefused(scene->addPoses(poses, 20, {.writtenByGpu = true}), ErrorCode::limitExceeded,
                "1000 poses take 20000 joints in one pose buffer, which holds at most 1365");
}

TEST_F(SceneGrowthTest, MeshesThatAreNotPackedAreRefused) {
  create();
  for (const std::uint32_t size : {0u, 8u, meshBytes + 8, meshBytes - 16}) {
    MeshInfo info = meshInfo();
    info.byteSize = size;
    expectRefused(owner->addMesh(info), ErrorCode::invalidArgument,
                  "no packed mesh has 1000 vertices in " + std::to_string(size) + " bytes");
  }
  for (const std::uint32_t count : {0u, 1001u, 0xffffffffu}) {
    MeshInfo info = meshInfo();
    info.vertexCount = count;
    expectRefused(owner->addMesh(info), ErrorCode::invalidArgument,
                  "no packed mesh has " + std::to_string(count) + " vertices");
  }
}

}  // namespace
}  // namespace dermis::test
