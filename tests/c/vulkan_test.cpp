// The C interface on the pretended driver, against that of C++: what the engine passes reaches
// Dermis.

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "c_helpers.h"
#include "mock_batch.h"
#include "rigged.h"

namespace dermis::test {
namespace {

class CVulkanTest : public MockContextTest {
 protected:
  dermis_device_desc describe() {
    const vulkan::DeviceDescription same = mock.description();
    dermis_device_desc desc = sized<dermis_device_desc>();
    desc.api_version = same.apiVersion;
    desc.instance = same.instance;
    desc.physical_device = same.physicalDevice;
    desc.device = same.device;
    desc.get_instance_proc_addr = same.getInstanceProcAddr;
    desc.extensions = same.enabledExtensions.data();
    desc.extension_count = static_cast<std::uint32_t>(same.enabledExtensions.size());
    desc.features = same.enabledFeatures;
    desc.pipeline_cache = same.pipelineCache;
    desc.allocator = same.allocator;
    return desc;
  }
  void createInC() {
    const dermis_device_desc desc = describe();
    expectOk(dermis_context_create(&desc, nullptr, nullptr, &cContext, &error));
    ASSERT_NE(cContext.object, nullptr);
  }

  Owned<dermis_context> cContext;
};

TEST_F(CVulkanTest, LimitsAndTuningAreThoseOfCpp) {
  for (const dermis_choice choice : {DERMIS_CHOICE_DEFAULT, DERMIS_CHOICE_NO, DERMIS_CHOICE_YES}) {
    mock.extensions = {VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME};
    dermis_device_desc desc = describe();
    desc.staged_stores = choice;
    desc.has_scalar_block_layout = desc.has_shader_int64 = 1;
    desc.texel_buffers = choice;
    dermis_limits limits = sized<dermis_limits>();
    dermis_tuning tuning = sized<dermis_tuning>();
    Owned<dermis_context> made;
    expectOk(dermis_context_create(&desc, &limits, &tuning, &made, &error));
    vulkan::DeviceDescription same = mock.description();
    same.hasScalarBlockLayout = same.hasShaderInt64 = true;
    if (choice != DERMIS_CHOICE_DEFAULT)
      same.stagedStores = same.texelBuffers = choice == DERMIS_CHOICE_YES;
    const vulkan::Context expected = must(vulkan::Context::create(same));
    const DeviceLimits& known = expected.limits();
    EXPECT_EQ(limits.max_storage_buffer_range, known.maxStorageBufferRange);
    EXPECT_EQ(limits.min_storage_buffer_offset_alignment, known.minStorageBufferOffsetAlignment);
    EXPECT_EQ(limits.max_workgroup_count_x, known.maxWorkgroupCountX);
    EXPECT_EQ(limits.max_workgroup_count_y, known.maxWorkgroupCountY);
    EXPECT_EQ(limits.max_storage_buffers_per_stage, known.maxStorageBuffersPerStage);
    EXPECT_EQ(limits.one_output_range, known.separateRanges ? 0u : 1u);
    EXPECT_EQ(limits.texel_buffers, known.texelBuffers ? 1u : 0u);
    EXPECT_EQ(limits.staged_stores, known.stagedStores ? 1u : 0u);
    EXPECT_EQ(limits.no_comparison_methods, known.comparisonMethods ? 0u : 1u);
    const Tuning sameTuning = expected.tuning();
    EXPECT_EQ(tuning.workgroup_size, sameTuning.workgroupSize);
    EXPECT_EQ(tuning.instances_per_invocation, sameTuning.instancesPerInvocation);
    EXPECT_EQ(tuning.min_workgroups, sameTuning.minWorkgroups);
    EXPECT_EQ(tuning.vertices_per_invocation, sameTuning.verticesPerInvocation);
  }
  for (const std::string missing : {"instance", "physical", "device", "proc"}) {
    dermis_device_desc desc = describe();
    if (missing == "instance") desc.instance = nullptr;
    if (missing == "physical") desc.physical_device = nullptr;
    if (missing == "device") desc.device = nullptr;
    if (missing == "proc") desc.get_instance_proc_addr = nullptr;
    Owned<dermis_context> refused;
    EXPECT_EQ(dermis_context_create(&desc, nullptr, nullptr, &refused, &error),
              DERMIS_INVALID_ARGUMENT)
        << missing;
  }
  dermis_device_desc desc = describe();
  desc.api_version = 0;
  Owned<dermis_context> refused;
  expectError(dermis_context_create(&desc, nullptr, nullptr, &refused, &error), "api_version");
}

TEST_F(CVulkanTest, TheEnginesPipelineCacheAndAllocator) {
  const VkAllocationCallbacks callbacks{};
  mock.allocator = &callbacks;
  dermis_device_desc desc = describe();
  desc.pipeline_cache = reinterpret_cast<VkPipelineCache>(std::uintptr_t{77});
  Owned<dermis_context> made;
  expectOk(dermis_context_create(&desc, nullptr, nullptr, &made, &error));
  const dermis_instance_desc like = sized<dermis_instance_desc>();
  expectOk(dermis_prepare(made, nullptr, &like, &error));
  ASSERT_FALSE(mock.cachesOfPipelines.empty());
  for (const VkPipelineCache cache : mock.cachesOfPipelines) EXPECT_EQ(cache, desc.pipeline_cache);
  dermis_destroy(made.object);
  made.object = nullptr;
  EXPECT_FALSE(mock.wrongAllocator);
}

TEST_F(CVulkanTest, Barriers) {
  createInC();
  for (const auto transfer :
       {DERMIS_TRANSFER_NONE, DERMIS_TRANSFER_RELEASE, DERMIS_TRANSFER_ACQUIRE}) {
    dermis_barrier barrier{};
    expectOk(dermis_barrier_between(DERMIS_USE_DERMIS,
                                    DERMIS_USE_VERTEX_INPUT | DERMIS_USE_RAY_TRACING, transfer,
                                    &barrier, &error));
    expectBarrier({barrier.source_stages, barrier.source_accesses, barrier.destination_stages,
                   barrier.destination_accesses},
                  vulkan::barrierBetween(Use::dermis, Use::vertexInput | Use::rayTracing,
                                         static_cast<vulkan::QueueTransfer>(transfer)));
  }
  dermis_barrier barrier{};
  expectError(dermis_barrier_between(1 << 15, 1, DERMIS_TRANSFER_NONE, &barrier, &error), "use");
  mock.memoryBarriers.clear();
  expectOk(dermis_record_barrier(cContext, commandBuffer, DERMIS_USE_DERMIS, DERMIS_USE_COPY_READ,
                                 &error));
  ASSERT_EQ(mock.memoryBarriers.size(), 1u);
  expectError(dermis_record_barrier(cContext, nullptr, 1, 2, &error), "command_buffer is null");
}

TEST_F(CVulkanTest, ABatchIsRecorded) {
  ASSERT_NO_FATAL_FAILURE(create());
  createInC();
  Owned<dermis_packed> packed;
  CMesh source(1);
  expectOk(dermis_pack(&source.view, 8, &packed, &error));
  dermis_packed_info mesh = sized<dermis_packed_info>();
  expectOk(dermis_packed_contents(packed, &mesh, &error));
  const dermis_layout layout{};
  dermis_job job = sized<dermis_job>();
  job.mesh = &mesh;
  expectOk(dermis_place_vertices(&layout, 50, 0, &job.places, &error));
  const dermis_batch_pose pose = {0, 8, DERMIS_PROMISE_RIGID};
  dermis_batch batch = sized<dermis_batch>();
  batch.poses = &pose;
  batch.jobs = &job;
  batch.pose_count = batch.job_count = 1;
  batch.mesh_bytes = mesh.byte_count;
  batch.pose_bytes = 384;
  for (std::uint64_t& bytes : batch.output_bytes) bytes = 600;
  dermis_limits limits = sized<dermis_limits>();
  dermis_tuning tuning = sized<dermis_tuning>();
  const dermis_device_desc device = describe();
  Owned<dermis_context> second;
  expectOk(dermis_context_create(&device, &limits, &tuning, &second, &error));
  Owned<dermis_plan> plan;
  expectOk(dermis_make_plan(&batch, &limits, &tuning, &plan, &error));
  dermis_plan_info info = sized<dermis_plan_info>();
  expectOk(dermis_plan_contents(plan, &info, &error));

  dermis_batch_buffers buffers = sized<dermis_batch_buffers>();
  const auto range = [&](dermis_buffer_role role) {
    return dermis_range{bufferOf(static_cast<BufferRole>(role)), 0,
                        (info.buffers[role].byte_count + 3) / 4 * 4};
  };
  buffers.meshes = range(DERMIS_BUFFER_MESHES);
  buffers.poses = range(DERMIS_BUFFER_POSES);
  buffers.tables = range(DERMIS_BUFFER_TABLES);
  buffers.palettes = range(DERMIS_BUFFER_PALETTES);
  for (dermis_range& output : buffers.outputs) output = range(DERMIS_BUFFER_OUTPUT);
  Owned<dermis_bindings> bindings;
  expectOk(dermis_bindings_create(second, &buffers, &bindings, &error));
  mock.dispatches.clear();
  expectError(dermis_record_plan(second, commandBuffer, plan, bindings, &error), "dermis_prepare",
              DERMIS_NOT_PREPARED);
  dermis_instance_desc like = sized<dermis_instance_desc>();
  expectOk(dermis_prepare(second, nullptr, &like, &error));
  expectOk(dermis_record_plan(second, commandBuffer, plan, bindings, &error));
  EXPECT_EQ(mock.dispatches.size(), info.dispatch_count);
  // Another tuning has other pipelines.
  tuning.workgroup_size = tuning.workgroup_size == 32 ? 64 : 32;
  expectOk(dermis_make_plan(&batch, &limits, &tuning, &plan, &error));
  expectError(dermis_record_plan(second, commandBuffer, plan, bindings, &error), "dermis_prepare",
              DERMIS_NOT_PREPARED);
  std::uint32_t count = 0;
  expectOk(dermis_list_pipelines(nullptr, &like, &limits, &tuning, nullptr, 0, &count, &error));
  std::vector<std::uint64_t> pipelines(count);
  expectOk(dermis_list_pipelines(nullptr, &like, &limits, &tuning, pipelines.data(), count, &count,
                                 &error));
  expectOk(dermis_prepare_pipelines(second, pipelines.data(), count, &error));
  expectOk(dermis_record_plan(second, commandBuffer, plan, bindings, &error));
  expectError(dermis_prepare_pipelines(second, nullptr, 1, &error), "pipelines is null");
  buffers.meshes.offset = 1;
  Owned<dermis_bindings> misaligned;
  expectError(dermis_bindings_create(second, &buffers, &misaligned, &error), "");
}

/// The engine's allocator. A handle is the address of the buffer's memory.
struct Allocator {
  static dermis_code create(void* user, const VkBufferCreateInfo* info, dermis_memory_use use,
                            const char* name, dermis_created_buffer* buffer,
                            dermis_error* failure) {
    auto& self = *static_cast<Allocator*>(user);
    if (self.isEmpty) {
      std::strcpy(failure->message, "the allocator is empty");
      failure->vulkan_result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
      return DERMIS_VULKAN_ERROR;
    }
    EXPECT_NE(std::string(name).find("dermis"), std::string::npos);
    self.usages.push_back(info->usage);
    self.memory.push_back(std::make_unique<std::vector<std::byte>>(info->size));
    buffer->buffer = reinterpret_cast<VkBuffer>(self.memory.back().get());
    if (use != DERMIS_MEMORY_DEVICE) buffer->mapped = self.memory.back()->data();
    buffer->allocation = self.memory.back().get();
    ++self.live;
    return DERMIS_OK;
  }
  static void destroy(void* user, const dermis_created_buffer* buffer) {
    EXPECT_EQ(reinterpret_cast<void*>(buffer->buffer), buffer->allocation);
    --static_cast<Allocator*>(user)->live;
  }

  bool isEmpty = false;
  int live = 0;
  std::vector<VkBufferUsageFlags> usages;
  std::vector<std::unique_ptr<std::vector<std::byte>>> memory;
};

TEST_F(CVulkanTest, ARecorderWithTheEnginesMemory) {
  createInC();
  Allocator allocator;
  dermis_scene_desc sceneDesc = sized<dermis_scene_desc>();
  sceneDesc.gpu_joints.initial = 16;
  dermis_recorder_desc desc = sized<dermis_recorder_desc>();
  desc.scene = &sceneDesc;
  desc.output_usage = VK_BUFFER_USAGE_INDEX_BUFFER_BIT;
  desc.user = &allocator;
  desc.create_buffer = Allocator::create;
  {
    Owned<dermis_recorder> recorder;
    expectError(dermis_recorder_create(cContext, &desc, &recorder, &error), "destroy_buffer");
    desc.destroy_buffer = Allocator::destroy;
    allocator.isEmpty = true;
    expectError(dermis_recorder_create(cContext, &desc, &recorder, &error), "allocator is empty",
                DERMIS_VULKAN_ERROR);
    EXPECT_EQ(error.vulkan_result, 0);
    allocator.isEmpty = false;
    dermis_tuning tuning = sized<dermis_tuning>();
    tuning.workgroup_size = 3;
    desc.tuning = &tuning;
    expectError(dermis_recorder_create(cContext, &desc, &recorder, &error), "workgroup");
    tuning.workgroup_size = 32;  // not that of the context
    expectOk(dermis_recorder_create(cContext, &desc, &recorder, &error));
    EXPECT_TRUE(std::ranges::any_of(allocator.usages, [](VkBufferUsageFlags usage) {
      return (usage & VK_BUFFER_USAGE_INDEX_BUFFER_BIT) != 0;
    }));
    dermis_scene* scene = dermis_recorder_scene(recorder);
    CMesh source(1);
    Owned<dermis_packed> packed;
    expectOk(dermis_pack(&source.view, 8, &packed, &error));
    dermis_instance_desc figure = sized<dermis_instance_desc>();
    expectOk(dermis_add_mesh(scene, packed, &figure.mesh, &error));
    dermis_pose_desc poseDesc = sized<dermis_pose_desc>();
    poseDesc.joint_count = 8;
    poseDesc.written_by_gpu = 1;
    expectOk(dermis_add_poses(scene, &poseDesc, 1, &figure.pose, &error));
    dermis_range range{};
    expectOk(dermis_pose_range(recorder, figure.pose, &range, &error));
    EXPECT_EQ(range.byte_count, 8 * sizeof(dermis_joint));
    figure.morph_writer = DERMIS_MORPH_WRITER_GPU;
    expectOk(dermis_prepare(cContext, scene, &figure, &error));
    dermis_instance instance{};
    expectOk(dermis_add_instance(scene, &figure, &instance, &error));
    expectOk(dermis_weights_range(recorder, instance, &range, &error));
    EXPECT_EQ(range.byte_count, source.targets.size() * sizeof(float));
    const PackedRig rigOfCpp = riggedPose();
    Owned<dermis_packed_rig> packedRig;
    expectOk(dermis_packed_rig_load(rigOfCpp.bytes().data(), rigOfCpp.bytes().size(), &packedRig,
                                    &error));
    expectOk(dermis_add_rig(scene, packedRig, &poseDesc.rig, &error));
    dermis_pose rigged{};
    expectOk(dermis_add_poses(scene, &poseDesc, 1, &rigged, &error));
    expectOk(dermis_driven_range(recorder, rigged, &range, &error));
    EXPECT_EQ(range.byte_count,
              drivenJoints * sizeof(dermis_joint) + (givenWeights + drivenWeights) * sizeof(float));
    expectError(dermis_driven_range(recorder, figure.pose, &range, &error), "has no rig");
    expectError(dermis_driven_range(recorder, rigged, nullptr, &error), "range is null");
    expectError(dermis_driven_range(nullptr, rigged, &range, &error), "recorder is null");
    expectOk(dermis_begin_frame(scene, 1, 0, &error));
    std::array poses{figure.pose, figure.pose};
    poses[1].kind = 77;
    expectError(dermis_mark_written(scene, poses.data(), 2, &error), "nothing that Dermis made");
    expectOk(dermis_record(recorder, commandBuffer, VK_NULL_HANDLE, 0, &error));
    dermis_recorder_info info = sized<dermis_recorder_info>();
    expectOk(dermis_recorder_contents(recorder, &info, &error));
    EXPECT_EQ(info.dispatches, mock.dispatches.size());
    EXPECT_GT(info.dispatches, 0u) << "the pose before the wrong one is marked";
    EXPECT_LT(info.gpu_seconds, 0);
    EXPECT_TRUE(std::ranges::any_of(allocator.memory, [&](const auto& memory) {
      return reinterpret_cast<VkBuffer>(memory.get()) == info.output_buffer;
    }));
    expectError(dermis_record(recorder, commandBuffer, VK_NULL_HANDLE, 0, &error),
                "dermis_begin_frame");
    // Culled on the GPU: the visibility buffer is missing.
    figure.culled_on_gpu = 1;
    expectOk(dermis_prepare(cContext, scene, &figure, &error));
    expectOk(dermis_add_instance(scene, &figure, &instance, &error));
    expectOk(dermis_begin_frame(scene, 2, 1, &error));
    expectError(dermis_record(recorder, commandBuffer, VK_NULL_HANDLE, 0, &error), "visibility");
    expectOk(dermis_record(recorder, commandBuffer,
                           reinterpret_cast<VkBuffer>(std::uintptr_t{1} << 22), 0, &error));
  }
  EXPECT_EQ(allocator.live, 0);
}

TEST_F(CVulkanTest, ARangeOfTheEngine) {
  createInC();
  dermis_requirement requirement{};
  const dermis_layout layout{};
  expectOk(dermis_recorder_requirement(cContext, nullptr, DERMIS_BUFFER_OUTPUT, &layout, 1,
                                       &requirement, &error));
  ASSERT_NO_FATAL_FAILURE(create());
  const VertexLayout same;
  const BufferRequirement expected = must(
      vulkan::SceneRecorder::requirement(*context, {}, BufferRole::positions, std::span(&same, 1)));
  EXPECT_EQ(requirement.byte_count, expected.size);
  EXPECT_EQ(requirement.alignment, expected.alignment);
  EXPECT_EQ(requirement.usage, expected.usage);

  std::vector<dermis_joint> poses(256);
  dermis_recorder_desc desc = sized<dermis_recorder_desc>();
  const std::uint64_t alignment = requirement.alignment;
  desc.output = {bufferOf(BufferRole::positions), 2 * alignment, 4800};
  desc.poses = {bufferOf(BufferRole::poses), 0, poses.size() * sizeof(dermis_joint)};
  desc.mapped_poses = poses.data();
  Owned<dermis_recorder> recorder;
  expectOk(dermis_recorder_create(cContext, &desc, &recorder, &error));
  dermis_scene* scene = dermis_recorder_scene(recorder);
  dermis_pose_desc poseDesc = sized<dermis_pose_desc>();
  poseDesc.joint_count = 8;
  dermis_pose pose{};
  expectOk(dermis_add_poses(scene, &poseDesc, 1, &pose, &error));
  dermis_joint* memory = nullptr;
  expectOk(dermis_write_poses(scene, &pose, 1, &memory, nullptr, &error));
  EXPECT_GE(memory, poses.data());
  EXPECT_LT(memory, poses.data() + poses.size());
  dermis_recorder_info info = sized<dermis_recorder_info>();
  expectOk(dermis_recorder_contents(recorder, &info, &error));
  EXPECT_EQ(info.output_buffer, bufferOf(BufferRole::positions));
}

TEST_F(CVulkanTest, TheEnginesKernels) {
  std::vector<std::string> names;
  dermis_device_desc desc = describe();
  desc.user = &names;
  desc.get_kernel = [](void* user, const char* module, const uint32_t** words, size_t* count,
                       dermis_error* failure) {
    auto& asked = *static_cast<std::vector<std::string>*>(user);
    asked.emplace_back(module);
    static const uint32_t code[] = {0x07230203, 0x00010300, 0, 1, 0};
    *words = code;
    *count = 5;
    if (asked.size() < 2) return DERMIS_OK;
    std::strcpy(failure->message, "the engine has no such kernel");
    return DERMIS_SHADER_ERROR;
  };
  Owned<dermis_context> made;
  expectOk(dermis_context_create(&desc, nullptr, nullptr, &made, &error));
  const dermis_instance_desc like = sized<dermis_instance_desc>();
  expectError(dermis_prepare(made, nullptr, &like, &error), "no such kernel", DERMIS_SHADER_ERROR);
  EXPECT_EQ(names.size(), 2u);
  EXPECT_FALSE(names[0].empty());
}

}  // namespace
}  // namespace dermis::test
