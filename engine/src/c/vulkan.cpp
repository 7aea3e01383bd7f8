// Contexts, batches and scenes on a Vulkan device.
#include <vulkan/vulkan_core.h>

#include <memory>
#include <optional>

#include "convert.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"

using namespace dermis;
using namespace dermis::c;

namespace {

/// The engine's kernels.
struct EngineKernels {
  void* user;
  dermis_code (*get)(void* user, const char* module, const std::uint32_t** words,
                     std::size_t* wordCount, dermis_error* error);

  static Result<std::vector<std::uint32_t>> getModule(void* self, std::string_view name) {
    const EngineKernels& kernels = *static_cast<const EngineKernels*>(self);
    const std::uint32_t* words = nullptr;
    std::size_t count = 0;
    dermis_error error{};
    const dermis_code code =
        kernels.get(kernels.user, std::string(name).c_str(), &words, &count, &error);
    if (code != DERMIS_OK) return callbackError(code, error, "get_kernel");
    if (words == nullptr) count = 0;
    return std::vector<std::uint32_t>(words, words + count);
  }
};

/// The engine's allocator.
struct EngineBuffers {
  void* user;
  dermis_code (*create)(void* user, const VkBufferCreateInfo* info, dermis_memory_use use,
                        const char* name, dermis_created_buffer* buffer, dermis_error* error);
  void (*destroy)(void* user, const dermis_created_buffer* buffer);

  static Result<vulkan::CreatedBuffer> createBuffer(void* self, const VkBufferCreateInfo& info,
                                                    vulkan::BufferUse use, const char* name) {
    const EngineBuffers& buffers = *static_cast<const EngineBuffers*>(self);
    dermis_created_buffer made{};
    dermis_error error{};
    const dermis_code code = buffers.create(
        buffers.user, &info, static_cast<dermis_memory_use>(use), name, &made, &error);
    if (code != DERMIS_OK) return callbackError(code, error, "create_buffer");
    return vulkan::CreatedBuffer{made.buffer, made.mapped, made.allocation};
  }
  static void destroyBuffer(void* self, const vulkan::CreatedBuffer& buffer) {
    const EngineBuffers& buffers = *static_cast<const EngineBuffers*>(self);
    const dermis_created_buffer destroyed{buffer.buffer, buffer.mapped, buffer.allocation};
    buffers.destroy(buffers.user, &destroyed);
  }
};

std::optional<bool> choiceOf(const dermis_choice& choice, const char* name) {
  const std::uint8_t number = enumerator(choice, DERMIS_CHOICE_YES, name);
  if (number == DERMIS_CHOICE_DEFAULT) return std::nullopt;
  return number == DERMIS_CHOICE_YES;
}

Use useOf(std::uint32_t uses) {
  if (uses >= DERMIS_USE_INDIRECT_READ * 2u) fail("a use has no meaning");
  return static_cast<Use>(uses);
}

vulkan::BufferRange rangeOf(const dermis_range& range) {
  return {range.buffer, range.offset, range.byte_count};
}

}  // namespace

struct dermis_context : Object {
  EngineKernels kernels{};
  std::optional<vulkan::Context> context;
};

struct dermis_bindings : Object {
  explicit dermis_bindings(vulkan::Bindings made) : bindings(std::move(made)) {}

  vulkan::Bindings bindings;
};

struct dermis_recorder : Object {
  EngineBuffers buffers{};
  std::optional<vulkan::SceneRecorder> recorder;
  dermis_scene scene;
};

namespace {

const vulkan::Context& contextOf(const dermis_context* context) {
  return *required(context, "context").context;
}

/// Everything but the allocator.
vulkan::SceneRecorderDescription recorderOf(const dermis_recorder_desc& desc) {
  vulkan::SceneRecorderDescription result;
  result.scene = sceneOf(desc.scene);
  result.meshes = rangeOf(desc.meshes);
  result.poses = rangeOf(desc.poses);
  result.mappedPoses = desc.mapped_poses;
  result.gpuPoses = rangeOf(desc.gpu_poses);
  result.output = rangeOf(desc.output);
  if (desc.output_usage != 0) result.outputUsage = desc.output_usage;
  result.measuresGpuTime = desc.measures_gpu_time != 0;
  if (desc.tuning != nullptr) result.tuning = tuningOf(desc.tuning);
  return result;
}

}  // namespace

extern "C" {

dermis_code dermis_barrier_between(uint32_t before, uint32_t after, dermis_transfer transfer,
                                   dermis_barrier* barrier, dermis_error* error) {
  return guarded(error, [&] {
    dermis_barrier& result = required(barrier, "barrier");
    const vulkan::Barrier made =
        vulkan::barrierBetween(useOf(before), useOf(after),
                               static_cast<vulkan::QueueTransfer>(
                                   enumerator(transfer, DERMIS_TRANSFER_ACQUIRE, "transfer")));
    result = {made.sourceStages, made.sourceAccesses, made.destinationStages,
              made.destinationAccesses};
  });
}

dermis_code dermis_context_create(const dermis_device_desc* callers, dermis_limits* limits,
                                  dermis_tuning* tuning, dermis_context** context,
                                  dermis_error* error) {
  return guarded(error, [&] {
    const dermis_device_desc desc = in(callers, "desc");
    if (limits != nullptr) checkOut(limits, "limits");
    if (tuning != nullptr) checkOut(tuning, "tuning");
    dermis_context*& result = required(context, "context");
    auto made = std::make_unique<dermis_context>();
    vulkan::DeviceDescription device;
    device.instance = desc.instance;
    device.physicalDevice = desc.physical_device;
    device.device = desc.device;
    device.getInstanceProcAddr = desc.get_instance_proc_addr;
    device.apiVersion = desc.api_version;
    device.enabledExtensions = array(desc.extensions, desc.extension_count, "extensions");
    device.enabledFeatures = desc.features;
    device.hasScalarBlockLayout = desc.has_scalar_block_layout != 0;
    device.hasShaderInt64 = desc.has_shader_int64 != 0;
    device.texelBuffers = choiceOf(desc.texel_buffers, "texel_buffers");
    device.stagedStores = choiceOf(desc.staged_stores, "staged_stores");
    if (desc.get_kernel != nullptr) {
      made->kernels = {desc.user, desc.get_kernel};
      device.kernelSource = {&made->kernels, EngineKernels::getModule};
    }
    device.pipelineCache = desc.pipeline_cache;
    device.allocator = desc.allocator;
    made->context.emplace(must(vulkan::Context::create(device)));
    if (limits != nullptr) {
      const DeviceLimits& known = made->context->limits();
      dermis_limits filled{};
      filled.min_storage_buffer_offset_alignment = known.minStorageBufferOffsetAlignment;
      filled.max_storage_buffer_range = known.maxStorageBufferRange;
      filled.max_workgroup_count_x = known.maxWorkgroupCountX;
      filled.max_workgroup_count_y = known.maxWorkgroupCountY;
      filled.max_storage_buffers_per_stage = known.maxStorageBuffersPerStage;
      filled.one_output_range = known.separateRanges ? 0 : 1;
      filled.texel_buffers = known.texelBuffers ? 1 : 0;
      filled.staged_stores = known.stagedStores ? 1 : 0;
      filled.no_comparison_methods = known.comparisonMethods ? 0 : 1;
      give(limits, filled);
    }
    if (tuning != nullptr) {
      const Tuning known = made->context->tuning();
      dermis_tuning filled{};
      filled.workgroup_size = known.workgroupSize;
      filled.instances_per_invocation = known.instancesPerInvocation;
      filled.min_workgroups = known.minWorkgroups;
      filled.vertices_per_invocation = known.verticesPerInvocation;
      give(tuning, filled);
    }
    result = made.release();
  });
}

dermis_code dermis_prepare(const dermis_context* context, const dermis_scene* scene,
                           const dermis_instance_desc* desc, dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::Context& target = contextOf(context);
    if (scene != nullptr && scene->recorder != nullptr) {  // its tuning may differ
      must(scene->recorder->recorder->prepare(instanceOf(in(desc, "desc"))));
    } else {
      must(target.prepare(needsOf(scene, desc)));
    }
  });
}

dermis_code dermis_prepare_pipelines(const dermis_context* context, const uint64_t* pipelines,
                                     uint32_t count, dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::Context& target = contextOf(context);
    std::vector<PipelineId> ids;
    for (const std::uint64_t id : array(pipelines, count, "pipelines"))
      ids.push_back(static_cast<PipelineId>(id));
    must(target.prepare(ids));
  });
}

dermis_code dermis_record_barrier(const dermis_context* context, VkCommandBuffer command_buffer,
                                  uint32_t before, uint32_t after, dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::Context& recording = contextOf(context);
    required(command_buffer, "command_buffer");
    recording.recordBarrier(command_buffer, useOf(before), useOf(after));
  });
}

dermis_code dermis_bindings_create(const dermis_context* context,
                                   const dermis_batch_buffers* callers, dermis_bindings** bindings,
                                   dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::Context& target = contextOf(context);
    const dermis_batch_buffers buffers = in(callers, "buffers");
    dermis_bindings*& result = required(bindings, "bindings");
    vulkan::BatchBuffers converted;
    converted.meshes = rangeOf(buffers.meshes);
    converted.poses = rangeOf(buffers.poses);
    converted.tables = rangeOf(buffers.tables);
    converted.palettes = rangeOf(buffers.palettes);
    converted.results = rangeOf(buffers.results);
    for (std::size_t i = 0; i < streamCount; ++i)
      converted.outputs.at(i) = rangeOf(buffers.outputs[i]);
    result = new dermis_bindings(must(target.createBindings(converted)));
  });
}

dermis_code dermis_record_plan(const dermis_context* context, VkCommandBuffer command_buffer,
                               const dermis_plan* plan, const dermis_bindings* bindings,
                               dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::Context& recording = contextOf(context);
    required(command_buffer, "command_buffer");
    must(recording.record(command_buffer, required(plan, "plan").plan,
                          required(bindings, "bindings").bindings));
  });
}

dermis_code dermis_recorder_requirement(const dermis_context* context,
                                        const dermis_recorder_desc* callers,
                                        dermis_buffer_role role, const dermis_layout* layouts,
                                        uint32_t layout_count, dermis_requirement* requirement,
                                        dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::Context& target = contextOf(context);
    const auto description = recorderOf(inOrDefault(callers, "desc"));
    dermis_requirement& result = required(requirement, "requirement");
    std::vector<VertexLayout> converted;
    for (const dermis_layout& layout : array(layouts, layout_count, "layouts"))
      converted.push_back(layoutOf(layout));
    result = requirementOf(must(vulkan::SceneRecorder::requirement(
        target, description,
        static_cast<BufferRole>(enumerator(role, DERMIS_BUFFER_HISTORY, "role")), converted)));
  });
}

dermis_code dermis_recorder_create(const dermis_context* context,
                                   const dermis_recorder_desc* callers, dermis_recorder** recorder,
                                   dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::Context& target = contextOf(context);
    const dermis_recorder_desc desc = inOrDefault(callers, "desc");
    dermis_recorder*& result = required(recorder, "recorder");
    auto made = std::make_unique<dermis_recorder>();
    vulkan::SceneRecorderDescription description = recorderOf(desc);
    if ((desc.create_buffer == nullptr) != (desc.destroy_buffer == nullptr))
      fail("set both create_buffer and destroy_buffer, or none");
    if (desc.create_buffer != nullptr) {
      made->buffers = {desc.user, desc.create_buffer, desc.destroy_buffer};
      description.buffers = {&made->buffers, EngineBuffers::createBuffer,
                             EngineBuffers::destroyBuffer};
    }
    made->recorder.emplace(must(vulkan::SceneRecorder::create(target, description)));
    made->scene.scene = &made->recorder->scene();
    made->scene.recorder = made.get();
    result = made.release();
  });
}

dermis_scene* dermis_recorder_scene(dermis_recorder* recorder) {
  return recorder == nullptr ? nullptr : &recorder->scene;
}

dermis_code dermis_record(dermis_recorder* recorder, VkCommandBuffer command_buffer,
                          VkBuffer visibility, VkDeviceSize visibility_offset,
                          dermis_error* error) {
  return guarded(error, [&] {
    vulkan::SceneRecorder& target = *required(recorder, "recorder").recorder;
    required(command_buffer, "command_buffer");
    const VkDeviceSize words = target.scene().visibilityCount();
    must(target.record(command_buffer, {visibility, visibility_offset, words * 4}));
  });
}

dermis_code dermis_recorder_contents(const dermis_recorder* recorder, dermis_recorder_info* info,
                                     dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::SceneRecorder& source = *required(recorder, "recorder").recorder;
    checkOut(info, "info");
    const vulkan::RecorderStatistics statistics = source.statistics();
    dermis_recorder_info result{};
    result.output_buffer = source.outputBuffer();
    result.output_generation = source.outputGeneration();
    result.dispatches = statistics.dispatches;
    result.workgroups = statistics.workgroups;
    result.uploaded_bytes = statistics.uploadedBytes;
    result.device_memory = statistics.deviceMemory;
    result.plan_seconds = statistics.planSeconds;
    result.record_seconds = statistics.recordSeconds;
    result.gpu_seconds = statistics.gpuSeconds.value_or(-1);
    give(info, result);
  });
}

dermis_code dermis_pose_range(const dermis_recorder* recorder, dermis_pose pose,
                              dermis_range* range, dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::SceneRecorder& source = *required(recorder, "recorder").recorder;
    dermis_range& result = required(range, "range");
    const vulkan::BufferRange found = must(source.poseRange(handleOf(pose)));
    result = {found.buffer, found.offset, found.size};
  });
}

dermis_code dermis_weights_range(const dermis_recorder* recorder, dermis_instance instance,
                                 dermis_range* range, dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::SceneRecorder& source = *required(recorder, "recorder").recorder;
    dermis_range& result = required(range, "range");
    const vulkan::BufferRange found = must(source.weightsRange(handleOf(instance)));
    result = {found.buffer, found.offset, found.size};
  });
}

dermis_code dermis_driven_range(const dermis_recorder* recorder, dermis_pose pose,
                                dermis_range* range, dermis_error* error) {
  return guarded(error, [&] {
    const vulkan::SceneRecorder& source = *required(recorder, "recorder").recorder;
    dermis_range& result = required(range, "range");
    const vulkan::BufferRange found = must(source.drivenRange(handleOf(pose)));
    result = {found.buffer, found.offset, found.size};
  });
}

}  // extern "C"
