// The C interface against that of C++: scenes, on the CPU and as commands, batches and glTF. What
// both do must be the same to the bit.

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "c_helpers.h"
#include "dermis/cpu.h"
#include "dermis/gltf.h"
#include "dermis/scene.h"
#include "dermis/vulkan/context.h"
#include "rigged.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t vertices = 50, jointCount = 8;

/// The same scene twice.
struct Twins {
  Twins() {
    expectOk(dermis_runner_create(nullptr, &runner, &error));
    scene = dermis_runner_scene(runner);
    const PackedMesh mesh = must(pack(source.mesh.view(), jointCount));
    expectOk(dermis_pack(&source.view, jointCount, &packed, &error));
    meshes.push_back(must(same.scene().addMesh(mesh)));
    cMeshes.emplace_back();
    expectOk(dermis_add_mesh(scene, packed, &cMeshes.back(), &error));
  }
  std::size_t addPose(JointPromise promise = JointPromise::scaling) {
    poses.push_back(must(same.scene().addPose(jointCount, {false, promise})));
    cPoses.emplace_back();
    dermis_pose_desc desc = sized<dermis_pose_desc>();
    desc.joint_count = jointCount;
    desc.promise = static_cast<dermis_promise>(promise);
    expectOk(dermis_add_poses(scene, &desc, 1, &cPoses.back(), &error));
    return poses.size() - 1;
  }
  dermis_instance_desc describe(std::size_t pose, const InstanceDescription& like) const {
    dermis_instance_desc desc = sized<dermis_instance_desc>();
    desc.mesh = cMeshes[0];
    desc.pose = cPoses[pose];
    desc.method = static_cast<dermis_method>(static_cast<int>(like.method) + 1);
    desc.layout = {static_cast<dermis_format>(like.layout.positions),
                   static_cast<dermis_format>(like.layout.normals),
                   static_cast<dermis_format>(like.layout.tangents),
                   like.layout.motion ? 1u : 0u,
                   like.layout.planar ? 1u : 0u,
                   like.layout.stride};
    std::copy_n(like.box.min, 3, desc.box.min);
    std::copy_n(like.box.max, 3, desc.box.max);
    desc.wants_bounds = like.bounds ? 1 : 0;
    desc.update_interval = like.updateInterval;
    desc.interpolates = like.interpolates ? 1 : 0;
    return desc;
  }
  std::size_t add(std::size_t pose, InstanceDescription description = {}) {
    const dermis_instance_desc desc = describe(pose, description);
    description.mesh = meshes[0];
    description.pose = poses[pose];
    instances.push_back(must(same.scene().addInstance(description)));
    cInstances.emplace_back();
    expectOk(dermis_add_instance(scene, &desc, &cInstances.back(), &error));
    return instances.size() - 1;
  }
  void begin() {
    ++frame;
    must(same.scene().beginFrame(frame, frame - 1));
    expectOk(dermis_begin_frame(scene, frame, frame - 1, &error));
  }
  void write(std::size_t pose, std::uint32_t seed) {
    const Pose joints = systemPose(seed);
    std::ranges::copy(joints, must(same.scene().writePose(poses[pose])).begin());
    dermis_joint* memory = nullptr;
    expectOk(dermis_write_poses(scene, &cPoses[pose], 1, &memory, nullptr, &error));
    ASSERT_NE(memory, nullptr);
    std::memcpy(memory, joints.data(), joints.size() * sizeof(*memory));
  }
  void change(const InstanceChange& change, dermis_change sameInC) {
    must(same.scene().change(change));
    sameInC.size = sizeof(sameInC);
    expectOk(dermis_change_instances(scene, &sameInC, 1, &error));
  }
  /// Runs the jobs of both, and compares all instances, and the lists.
  void run() {
    for (const cpu::PlannedJob& job : *same.jobs(16)) cpu::run(job);
    dermis_runner_frame jobs = sized<dermis_runner_frame>();
    expectOk(dermis_runner_jobs(runner, 16, &jobs, &error));
    for (std::uint32_t job = 0; job < jobs.job_count; ++job)
      expectOk(dermis_run_job(runner, job, &error));
    expectError(dermis_run_job(runner, jobs.job_count, &error), "no job");
    const std::span output(static_cast<const std::byte*>(jobs.output), jobs.output_byte_count);
    for (std::size_t i = 0; i < instances.size(); ++i) {
      const InstanceOutput expected = must(same.scene().output(instances[i]));
      dermis_instance_info info = sized<dermis_instance_info>();
      expectOk(dermis_instance_contents(scene, cInstances[i], &info, &error));
      EXPECT_EQ(info.is_written, expected.isWritten ? 1u : 0u);
      EXPECT_EQ(info.offset, expected.offset);
      EXPECT_EQ(info.interpolation, expected.interpolation);
      EXPECT_EQ(info.motion_scale, expected.motionScale);
      interpolations += info.interpolation < 1;
      EXPECT_EQ(info.mesh.index, expected.mesh.index);
      EXPECT_EQ(info.mesh.generation, expected.mesh.generation);
      EXPECT_EQ(info.is_due, must(same.scene().isDue(instances[i])) ? 1u : 0u);
      const auto bounds = must(same.scene().bounds(instances[i]));
      EXPECT_EQ(info.has_bounds, bounds ? 1u : 0u);
      if (bounds) {
        EXPECT_TRUE(isSame(&info.bounds, &*bounds, sizeof(Box)));
      }
      for (std::size_t stream = 0; stream < streamCount; ++stream) {
        const OutputAttribute& attribute = expected.places.attributes[stream];
        EXPECT_EQ(info.places.streams[stream].offset, attribute.offset);
        EXPECT_EQ(info.places.streams[stream].stride, attribute.stride);
        if (expected.isWritten) {
          EXPECT_EQ(readAttribute(output, attribute, vertices),
                    readAttribute(same.output(), attribute, vertices));
        }
      }
    }
    dermis_scene_info info = sized<dermis_scene_info>();
    expectOk(dermis_scene_contents(scene, &info, &error));
    const SceneStatistics statistics = same.scene().statistics();
    EXPECT_EQ(info.frame, frame);
    EXPECT_EQ(info.instances, statistics.lastFrame.instances);
    EXPECT_EQ(info.skinned_vertices, statistics.lastFrame.skinnedVertices);
    EXPECT_EQ(info.written_bytes, statistics.lastFrame.writtenBytes);
    EXPECT_EQ(info.converted_poses, statistics.lastFrame.convertedPoses);
    EXPECT_EQ(info.outputs.capacity, statistics.outputs.capacity);
    EXPECT_EQ(info.outputs.used, statistics.outputs.used);
    EXPECT_EQ(info.outputs.largest_free, statistics.outputs.largestFree);
    ASSERT_EQ(info.skinned_count, same.scene().skinnedInstances().size());
    for (std::uint32_t i = 0; i < info.skinned_count; ++i)
      EXPECT_EQ(info.skinned[i].index, same.scene().skinnedInstances()[i].index);
    ASSERT_EQ(info.settled_count, same.scene().settledInstances().size());
    for (std::uint32_t i = 0; i < info.settled_count; ++i)
      EXPECT_EQ(info.settled[i].generation, same.scene().settledInstances()[i].generation);
  }

  CMesh source{1, vertices, jointCount};
  cpu::SceneRunner same = must(cpu::SceneRunner::create());
  Owned<dermis_runner> runner;
  dermis_scene* scene = nullptr;
  Owned<dermis_packed> packed;
  std::vector<MeshHandle> meshes;
  std::vector<PoseHandle> poses;
  std::vector<InstanceHandle> instances;
  std::size_t interpolations = 0;  ///< instances that were to be drawn between two updates
  std::vector<dermis_mesh> cMeshes;
  std::vector<dermis_pose> cPoses;
  std::vector<dermis_instance> cInstances;
  std::uint64_t frame = 0;
};

constexpr Box wide{{-9, -9, -9}, {9, 9, 9}};

TEST(CSceneTest, InstancesOfEveryMethodAndLayout) {
  Twins twins;
  for (const Method method : allMethods) {
    if (isForComparison(method)) continue;
    const std::size_t pose = twins.addPose(method == Method::linear ? JointPromise::scaleIgnored
                                                                    : JointPromise::scaling);
    InstanceDescription description;
    description.method = method;
    description.layout = {VertexFormat::snorm16x4, VertexFormat::octahedral16x2,
                          VertexFormat::float16x4, true, method == Method::blended};
    description.box = wide;
    description.bounds = true;
    twins.add(pose, description);
    description.layout = {
        VertexFormat::float32x3, VertexFormat::float32x3, VertexFormat::none, false, false, 32};
    description.updateInterval = 2;
    twins.add(pose, description);
    description.layout.stride = 0;
    description.layout.motion = description.interpolates = true;
    twins.add(pose, description);
  }
  for (std::uint32_t frame = 0; frame < 4; ++frame) {
    twins.begin();
    for (std::size_t pose = 0; pose < twins.poses.size(); ++pose)
      twins.write(pose, 5 * frame + static_cast<std::uint32_t>(pose));
    twins.run();
  }
  EXPECT_GT(twins.interpolations, 0u);
}

TEST(CSceneTest, EveryChange) {
  Twins twins;
  const std::size_t a = twins.addPose(), b = twins.addPose();
  InstanceDescription description;
  description.layout = {VertexFormat::snorm16x4, VertexFormat::float32x3, VertexFormat::none, true};
  description.box = wide;
  const std::size_t one = twins.add(a, description);
  twins.add(a, {});
  const auto next = [&](std::uint32_t seed) {
    twins.begin();
    twins.write(a, seed);
    twins.write(b, seed + 1);
  };
  next(1);
  twins.run();

  const InstanceHandle instance = twins.instances[one];
  const auto changes = [&](std::uint32_t what) {
    dermis_change change{};
    change.instance = twins.cInstances[one];
    change.what = what;
    // What is not named must not count.
    change.visible = (what & DERMIS_CHANGE_VISIBLE) != 0 ? 0 : 1;
    return change;
  };
  next(2);
  twins.change({.instance = instance, .visible = false}, changes(DERMIS_CHANGE_VISIBLE));
  twins.run();
  dermis_change change = changes(DERMIS_CHANGE_VISIBLE);
  change.visible = 1;
  next(3);
  twins.change({.instance = instance, .visible = true}, change);
  twins.run();
  change = changes(DERMIS_CHANGE_UPDATE_INTERVAL);
  change.update_interval = 3;
  for (std::uint32_t frame = 0; frame < 4; ++frame) {
    next(4 + frame);
    if (frame == 0) twins.change({.instance = instance, .updateInterval = 3}, change);
    twins.run();
  }
  change = changes(DERMIS_CHANGE_POSE | DERMIS_CHANGE_METHOD | DERMIS_CHANGE_UPDATE_INTERVAL);
  change.pose = twins.cPoses[b];
  change.method = DERMIS_METHOD_BLENDED;
  change.update_interval = 1;
  next(10);
  twins.change({.instance = instance,
                .method = Method::blended,
                .updateInterval = 1,
                .pose = twins.poses[b]},
               change);
  twins.run();
  change = changes(DERMIS_CHANGE_BOX | DERMIS_CHANGE_MORPHS);
  change.box = {{-7, -7, -7}, {7, 8, 7}};
  const dermis_morph_weight weights[] = {{0, 0.25f}, {2, 1}};
  const MorphWeight sameWeights[] = {{0, 0.25f}, {2, 1}};
  change.morphs = weights;
  change.morph_count = 2;
  next(11);
  twins.change({.instance = instance,
                .box = Box{{-7, -7, -7}, {7, 8, 7}},
                .morphs = std::span<const MorphWeight>(sameWeights)},
               change);
  twins.run();
  next(12);
  twins.change({.instance = instance, .teleports = true}, changes(DERMIS_CHANGE_TELEPORT));
  twins.run();

  // Another mesh.
  CMesh other(9, vertices, jointCount);
  Owned<dermis_packed> packed;
  expectOk(dermis_pack(&other.view, jointCount, &packed, &error));
  twins.cMeshes.emplace_back();
  expectOk(dermis_add_mesh(twins.scene, packed, &twins.cMeshes.back(), &error));
  twins.meshes.push_back(
      must(twins.same.scene().addMesh(must(pack(other.mesh.view(), jointCount)))));
  change = changes(DERMIS_CHANGE_MESH);
  change.mesh = twins.cMeshes[1];
  next(13);
  twins.change({.instance = instance, .mesh = twins.meshes[1]}, change);
  twins.run();
}

TEST(CSceneTest, AFailedChangeKeepsThoseBeforeIt) {
  Twins twins;
  const std::size_t pose = twins.addPose();
  const std::size_t one = twins.add(pose), two = twins.add(pose);
  twins.begin();
  twins.write(pose, 1);
  for (const std::uint32_t wrong : {0u, 1u}) {
    dermis_change changes[3] = {};
    for (std::size_t i = 0; i < 3; ++i) {
      changes[i].size = sizeof(dermis_change);
      changes[i].instance = twins.cInstances[i == 0 ? one : two];
      changes[i].what = DERMIS_CHANGE_VISIBLE;
    }
    if (wrong == 0) {
      static const dermis_morph_weight missing = {99, 1};  // the scene refuses it
      changes[1].what |= DERMIS_CHANGE_MORPHS;
      changes[1].morphs = &missing;
      changes[1].morph_count = 1;
    } else {
      changes[1].what |= 256;
    }
    expectError(dermis_change_instances(twins.scene, changes, 3, &error), "change 1: ");
    InstanceChange first{.instance = twins.instances[one], .visible = false};
    must(twins.same.scene().change(first));
  }
  twins.run();
}

TEST(CSceneTest, RemovedAndWrongHandlesAreRefused) {
  Twins twins;
  const std::size_t pose = twins.addPose(), unused = twins.addPose();
  const std::size_t one = twins.add(pose);
  const dermis_instance instance = twins.cInstances[one];
  expectError(dermis_remove_mesh(twins.scene, twins.cMeshes[0], &error), "instance");
  expectError(dermis_remove_pose(twins.scene, twins.cPoses[pose], &error), "instance");
  expectOk(dermis_remove_pose(twins.scene, twins.cPoses[unused], &error));
  expectError(dermis_remove_pose(twins.scene, twins.cPoses[unused], &error), "");
  expectOk(dermis_remove_instance(twins.scene, instance, &error));
  dermis_instance_info info = sized<dermis_instance_info>();
  expectError(dermis_instance_contents(twins.scene, instance, &info, &error), "");
  expectError(dermis_remove_instance(twins.scene, {}, &error), "");

  // A handle of another kind.
  dermis_pose wrong{};
  std::memcpy(&wrong, &twins.cMeshes[0], sizeof(wrong));
  expectError(dermis_remove_pose(twins.scene, wrong, &error), "pose: this is the handle of a mesh");
  wrong.kind = 77;
  expectError(dermis_remove_pose(twins.scene, wrong, &error), "nothing that Dermis made");
  dermis_destroy(twins.scene);  // it is lent: nothing happens
  expectOk(dermis_remove_mesh(twins.scene, twins.cMeshes[0], &error));
}

TEST(CSceneTest, SeveralPosesAreWrittenUntilOneFails) {
  Twins twins;
  for (std::size_t i = 0; i < 3; ++i) twins.addPose();
  twins.begin();
  dermis_joint* joints[3] = {};
  std::uint32_t counts[3] = {};
  expectOk(dermis_write_poses(twins.scene, twins.cPoses.data(), 3, joints, counts, &error));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(counts[i], jointCount);
    dermis_joint* alone = nullptr;
    expectOk(dermis_write_poses(twins.scene, &twins.cPoses[i], 1, &alone, nullptr, &error));
    EXPECT_EQ(alone, joints[i]);
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(joints[i], joints[j]);
  }
  dermis_joint* const first = joints[0];
  twins.cPoses[1].kind = 77;
  expectError(dermis_write_poses(twins.scene, twins.cPoses.data(), 3, joints, counts, &error),
              "nothing that Dermis made");
  EXPECT_EQ(joints[0], first);
  EXPECT_EQ(counts[0], jointCount);
  for (std::size_t i = 1; i < 3; ++i) {
    EXPECT_EQ(joints[i], nullptr);
    EXPECT_EQ(counts[i], 0u);
  }
  expectError(dermis_write_poses(twins.scene, twins.cPoses.data(), 3, nullptr, counts, &error),
              "joints");
}

TEST(CSceneTest, JobsEndWithTheFrame) {
  Twins twins;
  const std::size_t pose = twins.addPose();
  twins.add(pose);
  twins.begin();
  twins.write(pose, 1);
  dermis_runner_frame jobs = sized<dermis_runner_frame>();
  expectError(dermis_run_job(twins.runner, 0, &error), "no job");
  expectOk(dermis_runner_jobs(twins.runner, 0, &jobs, &error));
  ASSERT_GT(jobs.job_count, 0u);
  expectOk(dermis_abandon_frame(twins.scene, twins.frame, &error));
  expectError(dermis_run_job(twins.runner, 0, &error), "a function of the scene was called");
  expectOk(dermis_runner_jobs(twins.runner, 0, &jobs, &error));
  expectOk(dermis_run_job(twins.runner, 0, &error));
  EXPECT_EQ(dermis_runner_scene(nullptr), nullptr);
}

TEST(CSceneTest, CapacitiesAndLentMemory) {
  std::vector<std::byte> memory(64 << 10);
  dermis_scene_desc scene = sized<dermis_scene_desc>();
  scene.instances = {2, 2};
  scene.joints.maximum = 8;
  dermis_runner_desc desc = sized<dermis_runner_desc>();
  desc.scene = &scene;
  desc.output = memory.data();
  desc.output_byte_count = memory.size();
  Owned<dermis_runner> runner;
  expectOk(dermis_runner_create(&desc, &runner, &error));
  dermis_scene* lent = dermis_runner_scene(runner);
  CMesh source(1);
  Owned<dermis_packed> packed;
  dermis_instance_desc figure = sized<dermis_instance_desc>();
  expectOk(dermis_pack(&source.view, 8, &packed, &error));
  expectOk(dermis_add_mesh(lent, packed, &figure.mesh, &error));
  dermis_pose_desc pose = sized<dermis_pose_desc>();
  pose.joint_count = 8;
  expectOk(dermis_add_poses(lent, &pose, 1, &figure.pose, &error));
  dermis_pose more{};
  expectError(dermis_add_poses(lent, &pose, 1, &more, &error), "", DERMIS_LIMIT_EXCEEDED);
  dermis_instance instance{};
  expectOk(dermis_add_instance(lent, &figure, &instance, &error));
  expectOk(dermis_add_instance(lent, &figure, &instance, &error));
  expectError(dermis_add_instance(lent, &figure, &instance, &error), "", DERMIS_LIMIT_EXCEEDED);
  expectOk(dermis_begin_frame(lent, 1, 0, &error));
  dermis_runner_frame jobs = sized<dermis_runner_frame>();
  expectOk(dermis_runner_jobs(runner, 0, &jobs, &error));
  EXPECT_EQ(jobs.output, memory.data());
  dermis_scene_info info = sized<dermis_scene_info>();
  expectOk(dermis_scene_contents(lent, &info, &error));
  EXPECT_EQ(info.outputs.capacity, memory.size());
  desc.output_byte_count = 2;
  Owned<dermis_runner> small;
  expectError(dermis_runner_create(&desc, &small, &error), "");
}

TEST(CSceneTest, IndexedDraws) {
  Twins twins;
  const std::size_t pose = twins.addPose();
  for (int i = 0; i < 3; ++i) twins.add(pose);
  twins.begin();
  twins.write(pose, 1);
  twins.run();
  const dermis_index_range range = {6, 30};
  std::array<dermis_indexed_draw, 3> draws{};
  expectOk(dermis_indexed_draws(twins.scene, twins.cInstances.data(), 3, &range, 1, draws.data(),
                                &error));
  const IndexRange same{6, 30};
  std::array<IndexedDraw, 3> expected;
  must(twins.same.scene().indexedDraws(twins.instances, {&same, 1}, expected));
  EXPECT_TRUE(isSame(draws.data(), expected.data(), sizeof(expected)));
  EXPECT_EQ(draws[2].index_count, 30u);
  EXPECT_EQ(draws[2].first_index, 6u);
  EXPECT_EQ(draws[2].instance_count, 1u);
  EXPECT_EQ(draws[2].first_instance, 2u);
  expectError(dermis_indexed_draws(twins.scene, twins.cInstances.data(), 3, &range, 0, draws.data(),
                                   &error),
              "");
  expectError(dermis_indexed_draws(twins.scene, nullptr, 3, &range, 1, draws.data(), &error),
              "instances is null");
}

// -- Commands.

/// The engine's buffers.
struct Buffers {
  static dermis_code create(void* user, const dermis_scene_buffer* buffer, void** mapped,
                            dermis_error* failure) {
    auto& self = *static_cast<Buffers*>(user);
    if (buffer->requirement.byte_count > self.most) {
      failure->code = DERMIS_VULKAN_ERROR;
      failure->vulkan_result = -2;
      std::strcpy(failure->message, "the engine has no memory");
      return DERMIS_VULKAN_ERROR;
    }
    self.buffers[buffer->number].resize(buffer->requirement.byte_count);
    self.roles.push_back(buffer->role);
    if (self.maps && buffer->is_mapped != 0) *mapped = self.buffers[buffer->number].data();
    return DERMIS_OK;
  }
  static void release(void* user, std::uint32_t number) {
    EXPECT_EQ(static_cast<Buffers*>(user)->buffers.erase(number), 1u);
  }

  std::uint64_t most = ~std::uint64_t{0};
  bool maps = true;
  std::map<std::uint32_t, std::vector<std::byte>> buffers;
  std::vector<dermis_buffer_role> roles;
};

void expectPart(const dermis_part& part, const BufferPart& expected) {
  EXPECT_EQ(part.buffer, expected.buffer);
  EXPECT_EQ(part.offset, expected.offset);
  EXPECT_EQ(part.byte_count, expected.size);
}

void expectCommands(std::span<const dermis_command> commands, std::span<const Command> expected) {
  ASSERT_EQ(commands.size(), expected.size());
  for (std::size_t i = 0; i < commands.size(); ++i) {
    const dermis_command& command = commands[i];
    ASSERT_EQ(command.kind, static_cast<int>(expected[i].index()));
    if (const auto* dispatch = std::get_if<DispatchCommand>(&expected[i])) {
      const dermis_dispatch& found = command.as.dispatch;
      EXPECT_EQ(found.pipeline, static_cast<std::uint64_t>(dispatch->pipeline));
      EXPECT_EQ(found.group_count_x, dispatch->groupCountX);
      EXPECT_EQ(found.group_count_y, dispatch->groupCountY);
      EXPECT_EQ(found.indirect.byte_count, dispatch->indirect.size);
      EXPECT_EQ(found.indirect.offset, dispatch->indirect.offset);
      EXPECT_EQ(found.indirect.buffer, dispatch->indirect.buffer);
      ASSERT_EQ(found.constant_count, dispatch->constantCount);
      EXPECT_TRUE(isSame(found.constants, dispatch->constants.data(), 4 * found.constant_count));
      ASSERT_EQ(found.binding_count, dispatch->bindings.size());
      for (std::size_t binding = 0; binding < found.binding_count; ++binding) {
        EXPECT_EQ(found.bindings[binding].slot, dispatch->bindings[binding].slot);
        EXPECT_EQ(found.bindings[binding].is_texel_buffer,
                  dispatch->bindings[binding].isTexelBuffer ? 1u : 0u);
        expectPart(found.bindings[binding].part, dispatch->bindings[binding].part);
      }
    } else if (const auto* upload = std::get_if<UploadCommand>(&expected[i])) {
      expectPart(command.as.upload.to, upload->to);
      ASSERT_EQ(command.as.upload.to.byte_count, upload->bytes.size());
      EXPECT_TRUE(isSame(command.as.upload.bytes, upload->bytes.data(), upload->bytes.size()));
    } else if (const auto* copy = std::get_if<CopyCommand>(&expected[i])) {
      EXPECT_EQ(command.as.copy.from, copy->from);
      EXPECT_EQ(command.as.copy.to, copy->to);
      EXPECT_EQ(command.as.copy.from_offset, copy->fromOffset);
      EXPECT_EQ(command.as.copy.to_offset, copy->toOffset);
      EXPECT_EQ(command.as.copy.byte_count, copy->size);
    } else if (const auto* clear = std::get_if<ClearCommand>(&expected[i])) {
      expectPart(command.as.clear, clear->part);
    } else if (const auto* barrier = std::get_if<BarrierCommand>(&expected[i])) {
      EXPECT_EQ(command.as.barrier.before, static_cast<std::uint32_t>(barrier->before));
      EXPECT_EQ(command.as.barrier.after, static_cast<std::uint32_t>(barrier->after));
    }
  }
}

/// The limits of a device without large buffers.
dermis_limits smallLimits() {
  dermis_limits limits = sized<dermis_limits>();
  limits.max_storage_buffer_range = 1 << 24;
  limits.min_storage_buffer_offset_alignment = 64;
  limits.max_workgroup_count_x = 70000;
  limits.max_workgroup_count_y = 65536;
  limits.max_storage_buffers_per_stage = 8;
  return limits;
}
DeviceLimits smallLimitsOfCpp() {
  DeviceLimits limits;
  limits.maxStorageBufferRange = 1 << 24;
  limits.minStorageBufferOffsetAlignment = 64;
  limits.maxWorkgroupCountX = 70000;
  limits.maxWorkgroupCountY = 65536;
  limits.maxStorageBuffersPerStage = 8;
  return limits;
}

TEST(CCommandsTest, AreThoseOfCpp) {
  Buffers buffers;
  const dermis_limits limits = smallLimits();
  dermis_tuning tuning = sized<dermis_tuning>();
  tuning.instances_per_invocation = 2;
  dermis_commands_desc desc = sized<dermis_commands_desc>();
  desc.limits = &limits;
  desc.tuning = &tuning;
  desc.output_offset = 192;
  dermis_scene_desc sceneDesc = sized<dermis_scene_desc>();
  sceneDesc.frames_in_flight = 3;
  sceneDesc.mesh_bytes.initial = 1 << 20;
  sceneDesc.output_bytes = {1 << 18, 1 << 20};
  sceneDesc.bounds.initial = 128;
  desc.scene = &sceneDesc;
  desc.user = &buffers;
  desc.create_buffer = Buffers::create;
  desc.release_buffer = Buffers::release;
  Owned<dermis_commands> commands;
  expectOk(dermis_commands_create(&desc, &commands, &error));
  dermis_scene* scene = dermis_commands_scene(commands);

  std::map<std::uint32_t, std::vector<std::byte>> memory;
  SceneCommandsDescription description;
  description.limits = smallLimitsOfCpp();
  description.tuning.instancesPerInvocation = 2;
  description.outputOffset = 192;
  description.scene.framesInFlight = 3;
  description.scene.meshCapacity.initial = 1 << 20;
  description.scene.outputCapacity = {1 << 18, 1 << 20};
  description.scene.boundsCapacity.initial = 128;
  description.user = &memory;
  description.createBuffer = [](void* user, const SceneBuffer& buffer) -> Result<void*> {
    auto& all = *static_cast<decltype(memory)*>(user);
    all[buffer.number].resize(buffer.requirement.size);
    return buffer.isMapped ? all[buffer.number].data() : nullptr;
  };
  description.releaseBuffer = [](void*, std::uint32_t) {};
  SceneCommands same = must(SceneCommands::create(description));
  for (const auto& [number, bytes] : memory)
    EXPECT_EQ(buffers.buffers[number].size(), bytes.size()) << "buffer " << number;

  CMesh source(1);
  Owned<dermis_packed> packed;
  expectOk(dermis_pack(&source.view, 8, &packed, &error));
  dermis_instance_desc figure = sized<dermis_instance_desc>();
  figure.wants_bounds = 1;
  figure.culled_on_gpu = 1;
  expectOk(dermis_add_mesh(scene, packed, &figure.mesh, &error));
  dermis_pose_desc poseDesc = sized<dermis_pose_desc>();
  poseDesc.joint_count = 8;
  poseDesc.written_by_gpu = 1;
  dermis_pose poses[2];
  expectOk(dermis_add_poses(scene, &poseDesc, 2, poses, &error));
  InstanceDescription instance;
  instance.bounds = true;
  instance.culledOnGpu = true;
  instance.mesh = must(same.scene().addMesh(must(pack(source.mesh.view(), 8))));
  std::array<PoseHandle, 2> samePoses;
  must(same.scene().addPoses(samePoses, 8, {.writtenByGpu = true}));
  dermis_instance instances[2];
  InstanceHandle sameWritten;
  for (std::size_t i = 0; i < 2; ++i) {
    figure.pose = poses[i];
    instance.pose = samePoses[i];
    dermis_instance& added = instances[i];
    figure.morph_writer = i == 0 ? DERMIS_MORPH_WRITER_CPU : DERMIS_MORPH_WRITER_GPU;
    instance.morphWriter = i == 0 ? MorphWriter::cpu : MorphWriter::gpu;
    expectOk(dermis_add_instance(scene, &figure, &added, &error));
    const InstanceHandle sameInstance = must(same.scene().addInstance(instance));
    dermis_part part{};
    expectOk(dermis_commands_pose_part(commands, poses[i], &part, &error));
    expectPart(part, must(same.posePart(samePoses[i])));
    if (i == 0) {
      expectError(dermis_commands_weights_part(commands, added, &part, &error), "morph weights");
    } else {
      expectOk(dermis_commands_weights_part(commands, added, &part, &error));
      expectPart(part, must(same.weightsPart(sameInstance)));
      sameWritten = sameInstance;
    }
    dermis_instance_info info = sized<dermis_instance_info>();
    expectOk(dermis_instance_contents(scene, added, &info, &error));
    EXPECT_GE(info.offset, 192u);
    EXPECT_EQ(info.offset, must(same.scene().output(sameInstance)).offset);
  }
  for (std::uint64_t frame = 1; frame <= 3; ++frame) {
    expectOk(dermis_begin_frame(scene, frame, frame - 1, &error));
    must(same.scene().beginFrame(frame, frame - 1));
    expectOk(dermis_mark_written(scene, poses, 2, &error));
    must(same.scene().markWritten(samePoses));
    expectOk(dermis_mark_morphs_written(scene, &instances[1], 1, &error));
    must(same.scene().markMorphsWritten({&sameWritten, 1}));
    expectError(dermis_mark_morphs_written(scene, &instances[0], 1, &error), "morph weights");
    const dermis_command* list = nullptr;
    std::uint32_t count = 0;
    expectOk(dermis_commands_plan(commands, nullptr, 0, &list, &count, &error));
    expectCommands({list, count}, must(same.plan()));
    std::uint32_t output = 0;
    expectOk(dermis_commands_commit(commands, &output, &error));
    must(same.commit());
    EXPECT_EQ(output, same.outputBuffer());
    expectError(dermis_commands_commit(commands, nullptr, &error), "");
    EXPECT_EQ(dermis_commands_read_back(commands, frame, nullptr, 0, nullptr) == DERMIS_OK,
              same.readBack(frame, {}).ok());
  }

  // The pipelines of such instances.
  std::vector<std::uint64_t> pipelineIds(100);
  std::uint32_t count = 0;
  expectOk(dermis_list_pipelines(scene, &figure, &limits, &tuning, pipelineIds.data(), 100, &count,
                                 &error));
  const auto expected = must(pipelines(must(same.scene().pipelineNeeds(instance)),
                                       description.limits, description.tuning));
  ASSERT_EQ(count, expected.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    EXPECT_EQ(pipelineIds[i], static_cast<std::uint64_t>(expected[i]));
    dermis_pipeline_info info = sized<dermis_pipeline_info>();
    expectOk(dermis_describe_pipeline(pipelineIds[i], &info, &error));
    const auto pipeline = must(vulkan::pipelineDescription(expected[i]));
    EXPECT_EQ(info.spirv, pipeline.spirv.data());
    EXPECT_EQ(info.word_count, pipeline.spirv.size());
    EXPECT_EQ(info.module, pipeline.module);
    ASSERT_EQ(info.constant_count, pipeline.constants.size());
    EXPECT_TRUE(isSame(info.constants, pipeline.constants.data(), 4 * info.constant_count));
    EXPECT_EQ(info.storage_buffers, pipeline.storageBuffers);
    EXPECT_EQ(info.texel_buffers, pipeline.texelBuffers);
  }
  std::uint32_t any = 0;
  expectOk(dermis_list_pipelines(nullptr, &figure, nullptr, nullptr, nullptr, 0, &any, &error));
  EXPECT_GT(any, count);
  dermis_pipeline_info info = sized<dermis_pipeline_info>();
  expectError(dermis_describe_pipeline(~std::uint64_t{0}, &info, &error), "");
}

TEST(CCommandsTest, RigsAreThoseOfCpp) {
  Buffers buffers, sameBuffers;
  const dermis_limits limits = smallLimits();
  dermis_commands_desc desc = sized<dermis_commands_desc>();
  desc.limits = &limits;
  desc.user = &buffers;
  desc.create_buffer = Buffers::create;
  desc.release_buffer = Buffers::release;
  Owned<dermis_commands> commands;
  expectOk(dermis_commands_create(&desc, &commands, &error));
  dermis_scene* const scene = dermis_commands_scene(commands);
  SceneCommandsDescription description;
  description.limits = smallLimitsOfCpp();
  description.user = &sameBuffers;
  description.createBuffer = [](void* user, const SceneBuffer& buffer) -> Result<void*> {
    auto& memory = static_cast<Buffers*>(user)->buffers[buffer.number];
    memory.resize(buffer.requirement.size);
    return buffer.isMapped ? memory.data() : nullptr;
  };
  description.releaseBuffer = [](void* user, std::uint32_t number) {
    static_cast<Buffers*>(user)->buffers.erase(number);
  };
  SceneCommands same = must(SceneCommands::create(description));

  const PackedRig packedSame = riggedPose();
  Owned<dermis_packed_rig> packedRig;
  expectOk(dermis_packed_rig_load(packedSame.bytes().data(), packedSame.bytes().size(), &packedRig,
                                  &error));
  dermis_rig rig{};
  expectOk(dermis_add_rig(scene, packedRig, &rig, &error));
  const RigHandle sameRig = must(same.scene().addRig(packedSame));
  CMesh source(1, vertices, riggedJoints + drivenJoints);
  Owned<dermis_packed> packed;
  expectOk(dermis_pack(&source.view, source.jointCount, &packed, &error));
  dermis_instance_desc figure = sized<dermis_instance_desc>();
  expectOk(dermis_add_mesh(scene, packed, &figure.mesh, &error));
  InstanceDescription instance;
  instance.mesh = must(same.scene().addMesh(must(pack(source.mesh.view(), source.jointCount))));
  std::array<dermis_pose, 3> poses{};  // the CPU, the GPU; the last without a rig
  std::array<PoseHandle, 3> samePoses;
  std::array<dermis_instance, 3> instances{};
  for (std::size_t i = 0; i < 3; ++i) {
    dermis_pose_desc poseDesc = sized<dermis_pose_desc>();
    poseDesc.joint_count = i == 2 ? source.jointCount : riggedJoints;
    poseDesc.written_by_gpu = i == 1 ? 1 : 0;
    if (i != 2) poseDesc.rig = rig;
    expectOk(dermis_add_poses(scene, &poseDesc, 1, &poses[i], &error));
    PoseOptions options;
    options.writtenByGpu = i == 1;
    if (i != 2) options.rig = sameRig;
    samePoses[i] = must(same.scene().addPose(poseDesc.joint_count, options));
    figure.pose = poses[i];
    instance.pose = samePoses[i];
    figure.driven_targets = instance.drivenTargets = 2;
    figure.first_driven_weight = instance.firstDrivenWeight = 3;
    expectOk(dermis_add_instance(scene, &figure, &instances[i], &error));
    must(same.scene().addInstance(instance));
  }
  dermis_part part{};
  for (std::size_t i = 0; i < 2; ++i) {
    expectOk(dermis_commands_driven_part(commands, poses[i], &part, &error));
    expectPart(part, must(same.drivenPart(samePoses[i])));
  }
  expectOk(dermis_commands_pose_part(commands, poses[1], &part, &error));
  expectPart(part, must(same.posePart(samePoses[1])));
  expectOk(dermis_begin_frame(scene, 1, 0, &error));
  must(same.scene().beginFrame(1, 0));
  float* memory[2] = {};
  std::uint32_t counts[2] = {9, 9};
  const dermis_pose written[2] = {poses[0], poses[2]};
  expectOk(dermis_write_pose_weights(scene, written, 2, memory, counts, &error));
  EXPECT_EQ(counts[0], givenWeights);
  EXPECT_EQ(counts[1], 0u);
  const std::span<float> sameMemory = must(same.scene().writePoseWeights(samePoses[0]));
  must(same.scene().writePoseWeights(samePoses[2]));
  dermis_joint* joints = nullptr;
  expectOk(dermis_write_poses(scene, poses.data(), 1, &joints, counts, &error));
  EXPECT_EQ(counts[0], riggedJoints);
  EXPECT_EQ(reinterpret_cast<float*>(joints + riggedJoints), memory[0]);
  const std::span<JointMatrix> sameJoints = must(same.scene().writePose(samePoses[0]));
  const Pose matrices = systemPose(7);
  ASSERT_EQ(matrices.size(), sameJoints.size());
  std::ranges::copy(matrices, sameJoints.begin());
  std::memcpy(joints, matrices.data(), sameJoints.size_bytes());
  for (std::size_t i = 0; i < givenWeights; ++i) memory[0][i] = sameMemory[i] = 0.25f;
  expectOk(dermis_mark_written(scene, &poses[1], 1, &error));
  must(same.scene().markWritten({&samePoses[1], 1}));
  const dermis_command* list = nullptr;
  std::uint32_t count = 0;
  std::vector<std::byte> tables(1 << 16);
  expectOk(dermis_commands_plan(commands, tables.data(), tables.size(), &list, &count, &error));
  expectCommands({list, count}, must(same.plan()));
  const auto upload =
      std::ranges::find(std::span(list, count), DERMIS_UPLOAD, &dermis_command::kind);
  ASSERT_NE(upload, std::span(list, count).end());
  EXPECT_EQ(upload->as.upload.bytes, tables.data());
  EXPECT_EQ(buffers.buffers, sameBuffers.buffers);

  // The pipelines of such instances, with and without a scene.
  const auto expectPipelines = [&](const dermis_scene* of, const PipelineNeeds& needs) {
    std::vector<std::uint64_t> ids(200);
    expectOk(dermis_list_pipelines(of, &figure, &limits, nullptr, ids.data(), 200, &count, &error));
    const auto expected = must(pipelines(needs, description.limits, {}));
    ASSERT_EQ(count, expected.size());
    for (std::uint32_t i = 0; i < count; ++i)
      EXPECT_EQ(ids[i], static_cast<std::uint64_t>(expected[i]));
  };
  figure.pose = poses[0];
  instance.pose = samePoses[0];
  expectPipelines(scene, must(same.scene().pipelineNeeds(instance)));
  expectPipelines(nullptr, {.morphsOnGpu = true, .rigs = true});
  figure.driven_targets = 0;
  expectPipelines(nullptr, {});

  // What is wrong is said.
  expectError(dermis_add_rig(scene, nullptr, &rig, &error), "packed is null");
  expectError(dermis_add_rig(scene, packedRig, nullptr, &error), "rig is null");
  expectError(dermis_add_rig(nullptr, packedRig, &rig, &error), "scene is null");
  expectError(dermis_remove_rig(scene, rig, &error), "is used by 2 poses");
  expectError(dermis_remove_rig(nullptr, rig, &error), "scene is null");
  dermis_rig misused{};
  std::memcpy(&misused, &figure.mesh, sizeof(misused));
  expectError(dermis_remove_rig(scene, misused, &error), "rig: this is the handle of a mesh");
  dermis_mesh mesh{};
  std::memcpy(&mesh, &rig, sizeof(mesh));
  expectError(dermis_remove_mesh(scene, mesh, &error), "this is the handle of a rig");
  dermis_pose_desc wrong = sized<dermis_pose_desc>();
  wrong.joint_count = riggedJoints + 1;
  wrong.rig = rig;
  dermis_pose none{};
  expectError(dermis_add_poses(scene, &wrong, 1, &none, &error), "written ones");
  wrong.rig = misused;
  expectError(dermis_add_poses(scene, &wrong, 1, &none, &error), "the handle of a mesh");
  figure.driven_targets = 4;
  dermis_instance more{};
  expectError(dermis_add_instance(scene, &figure, &more, &error), "has 4 driven targets");
  figure.driven_targets = 3;
  figure.first_driven_weight = 5;
  expectError(dermis_add_instance(scene, &figure, &more, &error), "from weight 5 on");
  expectError(dermis_commands_driven_part(commands, poses[2], &part, &error), "has no rig");
  expectError(dermis_commands_driven_part(commands, poses[0], nullptr, &error), "part is null");
  expectError(dermis_commands_driven_part(nullptr, poses[0], &part, &error), "commands is null");
  expectError(dermis_write_pose_weights(scene, nullptr, 1, memory, nullptr, &error),
              "poses is null");
  expectError(dermis_write_pose_weights(scene, written, 1, nullptr, nullptr, &error),
              "weights is null");
  expectError(dermis_write_pose_weights(nullptr, written, 1, memory, nullptr, &error),
              "scene is null");
  counts[0] = 9;
  expectError(dermis_write_pose_weights(scene, &poses[1], 1, memory, counts, &error),
              "written by the GPU");
  EXPECT_EQ(memory[0], nullptr);
  EXPECT_EQ(counts[0], 0u);
  for (std::size_t i = 0; i < 3; ++i) {
    expectOk(dermis_remove_instance(scene, instances[i], &error));
    expectOk(dermis_remove_pose(scene, poses[i], &error));
  }
  expectOk(dermis_remove_rig(scene, rig, &error));
  expectError(dermis_remove_rig(scene, rig, &error), "it was removed");
}

TEST(CCommandsTest, AnErrorOfTheEngineIsThatOfTheFunction) {
  Buffers buffers;
  buffers.most = 100;
  dermis_commands_desc desc = sized<dermis_commands_desc>();
  desc.user = &buffers;
  desc.create_buffer = Buffers::create;
  Owned<dermis_commands> commands;
  expectError(dermis_commands_create(&desc, &commands, &error), "release_buffer");
  desc.release_buffer = Buffers::release;
  EXPECT_EQ(dermis_commands_create(&desc, &commands, &error), DERMIS_VULKAN_ERROR);
  EXPECT_EQ(error.vulkan_result, -2);
  expectError(error.code, "the engine has no memory", DERMIS_VULKAN_ERROR);
  desc.create_buffer = [](void*, const dermis_scene_buffer*, void**, dermis_error*) {
    return DERMIS_OUT_OF_MEMORY;  // without a message
  };
  expectError(dermis_commands_create(&desc, &commands, &error), "create_buffer returned 13",
              DERMIS_VULKAN_ERROR);
}

TEST(CBatchTest, IsThatOfCpp) {
  CMesh source(1);
  Owned<dermis_packed> packed;
  expectOk(dermis_pack(&source.view, 8, &packed, &error));
  dermis_packed_info mesh = sized<dermis_packed_info>();
  expectOk(dermis_packed_contents(packed, &mesh, &error));
  const MeshInfo sameMesh = must(pack(source.mesh.view(), 8)).info();
  const dermis_layout layout = {
      DERMIS_FORMAT_SNORM16X4, DERMIS_FORMAT_OCTAHEDRAL16X2, DERMIS_FORMAT_NONE, 1, 0, 0};
  const VertexLayout sameLayout{VertexFormat::snorm16x4, VertexFormat::octahedral16x2,
                                VertexFormat::none, true};
  std::vector<dermis_batch_pose> poses = {{0, 8, DERMIS_PROMISE_SCALING},
                                          {384, 8, DERMIS_PROMISE_RIGID}};
  const std::vector<PoseDescription> samePoses = {{8, 0, JointPromise::scaling},
                                                  {8, 384, JointPromise::rigid}};
  const dermis_morph_weight morphs[] = {{1, 0.5f}};
  const MorphWeight sameMorphs[] = {{1, 0.5f}};
  std::vector<dermis_job> jobs;
  std::vector<Job> sameJobs;
  const std::uint64_t alignment = must(placeVertices(sameLayout, vertices)).alignment;
  const std::uint64_t size = must(placeVertices(sameLayout, vertices)).size;
  const std::uint64_t step = (size + alignment - 1) / alignment * alignment;
  for (std::uint32_t i = 0; i < 6; ++i) {
    dermis_job job = sized<dermis_job>();
    Job same;
    job.mesh = &mesh;
    same.mesh = sameMesh;
    job.mesh_offset = same.meshOffset = 32;
    job.pose = same.pose = i % 2;
    job.method = static_cast<dermis_method>(i % 3);  // the default, linear, dual quaternions
    same.method = i % 3 == 1 ? Method::linear : Method::dualQuaternion;
    expectOk(dermis_place_vertices(&layout, vertices, i * step, &job.places, &error));
    same.places = must(placeVertices(sameLayout, vertices, i * step));
    job.box = {{-9, -9, -9}, {9, 9, 9}};
    same.box = wide;
    job.wants_bounds = i % 2;
    same.bounds = i % 2 == 1;
    job.restarts_motion = i == 4 ? 1 : 0;
    same.restartsMotion = i == 4;
    job.settles = i == 5 ? 1 : 0;
    same.settles = i == 5;
    if (i == 2) {
      job.morphs = morphs;
      job.morph_count = 1;
      same.morphs = sameMorphs;
    }
    jobs.push_back(job);
    sameJobs.push_back(same);
  }
  dermis_batch batch = sized<dermis_batch>();
  batch.poses = poses.data();
  batch.pose_count = 2;
  batch.jobs = jobs.data();
  batch.job_count = 6;
  batch.mesh_bytes = 32 + mesh.byte_count;
  batch.pose_bytes = 768;
  for (std::uint64_t& bytes : batch.output_bytes) bytes = 6 * step;
  Batch same;
  same.poses = samePoses;
  same.jobs = sameJobs;
  same.meshesSize = batch.mesh_bytes;
  same.posesSize = 768;
  same.outputSizes = ByStream<std::uint64_t>::all(6 * step);
  const dermis_limits limits = smallLimits();
  Plan expected;
  must(makePlan(same, smallLimitsOfCpp(), {}, expected));

  Owned<dermis_plan> plan;
  for (int again = 0; again < 2; ++again) {
    expectOk(dermis_make_plan(&batch, &limits, nullptr, &plan, &error));
    dermis_plan_info info = sized<dermis_plan_info>();
    expectOk(dermis_plan_contents(plan, &info, &error));
    expectCommands({info.commands, info.command_count}, expected.commands());
    ASSERT_EQ(info.pipeline_count, expected.pipelines().size());
    for (std::uint32_t i = 0; i < info.pipeline_count; ++i)
      EXPECT_EQ(info.pipelines[i], static_cast<std::uint64_t>(expected.pipelines()[i]));
    EXPECT_EQ(info.first_result, *expected.resultOffset(0));
    EXPECT_EQ(info.dispatch_count, expected.dispatchCount());
    for (std::uint32_t role = 0; role < 9; ++role) {
      const BufferRequirement requirement = expected.buffer(static_cast<BufferRole>(role));
      EXPECT_EQ(info.buffers[role].byte_count, requirement.size);
      EXPECT_EQ(info.buffers[role].alignment, requirement.alignment);
      EXPECT_EQ(info.buffers[role].usage, requirement.usage);
    }
    const std::uint64_t tableBytes = info.buffers[DERMIS_BUFFER_TABLES].byte_count;
    std::vector<std::byte> tables(tableBytes), sameTables(tableBytes);
    expectOk(dermis_write_tables(plan, tables.data(), tables.size(), &error));
    must(writeTables(expected, sameTables));
    EXPECT_EQ(tables, sameTables);
    expectError(dermis_write_tables(plan, tables.data(), tables.size() - 1, &error), "");
  }
  // Positions and normals in buffers of their own.
  batch.has_separate_outputs = 1;
  same.isOneOutput = false;
  const Result<void> apart = makePlan(same, smallLimitsOfCpp(), {}, expected);
  EXPECT_EQ(dermis_make_plan(&batch, &limits, nullptr, &plan, &error) == DERMIS_OK, apart.ok());
  EXPECT_FALSE(apart.ok()) << "formats of 2 bytes must be in one buffer";
  batch.has_separate_outputs = 0;
  // An error leaves an empty plan.
  poses[0].joint_count = 1;
  expectError(dermis_make_plan(&batch, &limits, nullptr, &plan, &error), "joints");
  dermis_plan_info info = sized<dermis_plan_info>();
  expectOk(dermis_plan_contents(plan, &info, &error));
  EXPECT_EQ(info.command_count, 0u);
  EXPECT_EQ(info.pipeline_count, 0u);
  Owned<dermis_plan> none;
  expectError(dermis_make_plan(&batch, &limits, nullptr, &none, &error), "joints");
  EXPECT_EQ(none.object, nullptr);
  poses[0].joint_count = 8;
  jobs[3].mesh = nullptr;
  expectError(dermis_make_plan(&batch, &limits, nullptr, &none, &error),
              "the mesh of a job is null");
}

// -- glTF.

TEST(CModelTest, IsThatOfCpp) {
  const std::string path = std::string(sampleModels) + "/figure.glb";
  dermis_model_source source = sized<dermis_model_source>();
  source.path = path.c_str();
  Owned<dermis_model> model;
  expectOk(dermis_model_load(&source, &model, &error));
  const gltf::Model expected = must(gltf::load(path));
  dermis_model_info info = sized<dermis_model_info>();
  expectOk(dermis_model_contents(model, &info, &error));
  ASSERT_EQ(info.primitive_count, expected.skinnedPrimitives.size());
  ASSERT_EQ(info.clip_count, expected.clips.size());
  ASSERT_EQ(info.note_count, expected.notes.size());
  ASSERT_GT(info.clip_count, 0u);
  EXPECT_EQ(info.clips[0].name, expected.clips[0].name);
  EXPECT_EQ(info.clips[0].duration, expected.clips[0].duration);
  for (std::uint32_t i = 0; i < info.primitive_count; ++i) {
    const gltf::SkinnedPrimitive& skinned = expected.skinnedPrimitives[i];
    const gltf::Primitive& same = expected.meshes[skinned.mesh].primitives[skinned.primitive];
    dermis_primitive primitive = sized<dermis_primitive>();
    expectOk(dermis_model_primitive(model, i, &primitive, &error));
    const gltf::Skin& skin = expected.skins[skinned.skin];
    EXPECT_EQ(primitive.skin, skinned.skin);
    ASSERT_EQ(primitive.joint_count, skin.joints.size());
    EXPECT_EQ(primitive.mesh->name, same.name);
    ASSERT_EQ(primitive.index_count, same.triangles.size());
    EXPECT_TRUE(isSame(primitive.triangles, same.triangles.data(), 4 * primitive.index_count));
    Owned<dermis_packed> packed;
    expectOk(dermis_pack(primitive.mesh, primitive.joint_count, &packed, &error));
    const gltf::PrimitiveView view(same);
    const PackedMesh mesh = must(pack(view.mesh(), primitive.joint_count));
    dermis_packed_info contents = sized<dermis_packed_info>();
    expectOk(dermis_packed_contents(packed, &contents, &error));
    ASSERT_EQ(contents.byte_count, mesh.bytes().size());
    EXPECT_TRUE(isSame(contents.bytes, mesh.bytes().data(), contents.byte_count));

    std::vector<dermis_joint> joints(primitive.joint_count);
    for (const std::uint32_t clip : {0u, static_cast<std::uint32_t>(DERMIS_REST_POSE)}) {
      expectOk(dermis_model_pose(model, i, clip, 0.3, joints.data(), primitive.joint_count, nullptr,
                                 0, &error));
      const auto pose = gltf::pose(expected, skinned.skin, clip == 0 ? 0 : noIndex, 0.3);
      EXPECT_TRUE(isSame(joints.data(), pose.data(), joints.size() * sizeof(dermis_joint)));
    }
    expectError(dermis_model_pose(model, i, 0, 0, joints.data(), primitive.joint_count - 1, nullptr,
                                  0, &error),
                "joint_count is ");
    expectError(dermis_model_pose(model, i, info.clip_count, 0, joints.data(),
                                  primitive.joint_count, nullptr, 0, &error),
                "no clip");
  }
  dermis_primitive primitive = sized<dermis_primitive>();
  expectError(dermis_model_primitive(model, info.primitive_count, &primitive, &error),
              "no skinned primitive");
}

TEST(CModelTest, ItsRigIsThatOfCpp) {
  const std::string path = std::string(sampleModels) + "/rigged_arm.glb";
  dermis_model_source source = sized<dermis_model_source>();
  source.path = path.c_str();
  Owned<dermis_model> model;
  expectOk(dermis_model_load(&source, &model, &error));
  gltf::Model same = must(gltf::load(path));
  Owned<dermis_packed_rig> rig;
  expectError(dermis_model_apply_rig(model, 9, nullptr, &rig, &error), "no skin 9");
  expectError(dermis_model_apply_rig(model, 0, "{", &rig, &error), "", DERMIS_INVALID_DATA);
  EXPECT_EQ(rig.object, nullptr);
  expectOk(dermis_model_apply_rig(model, 0, nullptr, &rig, &error));
  const PackedRig expected = must(packRig(*must(gltf::applyRig(same, 0, same.skins[0].rig))));
  dermis_packed_rig_info info = sized<dermis_packed_rig_info>();
  expectOk(dermis_packed_rig_contents(rig, &info, &error));
  ASSERT_EQ(info.byte_count, expected.bytes().size());
  EXPECT_TRUE(isSame(info.bytes, expected.bytes().data(), info.byte_count));
  const std::uint32_t joints = expected.writtenJoints() + expected.drivenJoints();
  for (std::uint32_t i = 0; i < same.skinnedPrimitives.size(); ++i) {
    const gltf::SkinnedPrimitive& skinned = same.skinnedPrimitives[i];
    const gltf::PrimitiveView view(same.meshes[skinned.mesh].primitives[skinned.primitive]);
    dermis_primitive primitive = sized<dermis_primitive>();
    expectOk(dermis_model_primitive(model, i, &primitive, &error));
    EXPECT_EQ(primitive.joint_count, expected.writtenJoints());
    Owned<dermis_packed> packed;
    expectOk(dermis_pack(primitive.mesh, joints, &packed, &error));
    const PackedMesh mesh = must(pack(view.mesh(), joints));
    dermis_packed_info contents = sized<dermis_packed_info>();
    expectOk(dermis_packed_contents(packed, &contents, &error));
    ASSERT_EQ(contents.byte_count, mesh.bytes().size());
    EXPECT_TRUE(isSame(contents.bytes, mesh.bytes().data(), contents.byte_count));
  }
  expectError(dermis_model_apply_rig(nullptr, 0, nullptr, &rig, &error), "model is null");
}

// A triangle with two morph targets, the second of which the node activates.
TEST(CModelTest, MorphTargetsAndFilesInMemory) {
  const std::string text =
      R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
    "nodes": [{"mesh": 0, "skin": 0, "weights": [0, 0.75]}, {"name": "joint"}],
    "skins": [{"joints": [1]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2},
      "targets": [{"POSITION": 0}, {"POSITION": 0}]}]}],
    "accessors": [
      {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0,0,0], "max": [0,0,0]},
      {"bufferView": 0, "componentType": 5121, "count": 3, "type": "VEC4"},
      {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 3, "type": "VEC4"}],
    "bufferViews": [{"buffer": 0, "byteLength": 60}],
    "buffers": [{"byteLength": 60, "uri": "data:application/octet-stream;base64,)" +
      std::string(80, 'A') + "\"}]}";
  dermis_model_source source = sized<dermis_model_source>();
  source.bytes = text.data();
  source.byte_count = text.size();
  Owned<dermis_model> model;
  expectOk(dermis_model_load(&source, &model, &error));
  dermis_primitive primitive = sized<dermis_primitive>();
  expectOk(dermis_model_primitive(model, 0, &primitive, &error));
  ASSERT_EQ(primitive.mesh->morph_target_count, 2u);
  EXPECT_EQ(primitive.triangles != nullptr, primitive.index_count > 0);
  EXPECT_EQ(primitive.texcoords, nullptr);
  EXPECT_EQ(primitive.base_color[3], 1);
  dermis_joint joint{};
  float weights[2] = {9, 9};
  expectOk(dermis_model_pose(model, 0, DERMIS_REST_POSE, 0, &joint, 1, weights, 2, &error));
  EXPECT_EQ(weights[0], 0);
  EXPECT_EQ(weights[1], 0.75f);
  expectError(dermis_model_pose(model, 0, DERMIS_REST_POSE, 0, &joint, 1, weights, 3, &error),
              "morph_weight_count is 3");
  dermis_clips_source clips = sized<dermis_clips_source>();
  expectOk(dermis_model_clips(model, &clips, &error));
  ASSERT_EQ(clips.nodes[0].weight_count, 2u);
  EXPECT_EQ(clips.nodes[0].weights[0], 0);
  EXPECT_EQ(clips.nodes[0].weights[1], 0.75f);
  EXPECT_EQ(clips.nodes[1].weight_count, 0u);

  source.is_strict = 1;
  Owned<dermis_model> strict;
  source.byte_count -= 2;
  expectError(dermis_model_load(&source, &strict, &error), "", DERMIS_INVALID_DATA);
  source.path = "both";
  expectError(dermis_model_load(&source, &strict, &error), "either a path or bytes");
  source = sized<dermis_model_source>();
  source.path = "does-not-exist.glb";
  expectError(dermis_model_load(&source, &strict, &error), "does-not-exist.glb", DERMIS_IO_ERROR);
  EXPECT_EQ(strict.object, nullptr);
}

}  // namespace
}  // namespace dermis::test
