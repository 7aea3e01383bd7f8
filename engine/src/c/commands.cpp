// Batches and scenes as lists of commands.
#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>

#include "convert.h"
#include "dermis/vulkan/context.h"

namespace {

/// The engine's functions for buffers.
struct EngineMemory {
  void* user;
  dermis_code (*create)(void* user, const dermis_scene_buffer* buffer, void** mapped,
                        dermis_error* error);
  void (*release)(void* user, std::uint32_t number);

  static dermis::Result<void*> createBuffer(void* self, const dermis::SceneBuffer& buffer) {
    const EngineMemory& memory = *static_cast<const EngineMemory*>(self);
    dermis_scene_buffer wanted{};
    wanted.size = sizeof(wanted);
    wanted.number = buffer.number;
    wanted.role = static_cast<dermis_buffer_role>(buffer.role);
    wanted.is_mapped = buffer.isMapped ? 1 : 0;
    wanted.requirement = dermis::c::requirementOf(buffer.requirement);
    void* mapped = nullptr;
    dermis_error error{};
    const dermis_code code = memory.create(memory.user, &wanted, &mapped, &error);
    if (code != DERMIS_OK) return dermis::c::callbackError(code, error, "create_buffer");
    return mapped;
  }
  static void releaseBuffer(void* self, std::uint32_t number) {
    const EngineMemory& memory = *static_cast<const EngineMemory*>(self);
    memory.release(memory.user, number);
  }
};

}  // namespace

struct dermis_commands : dermis::c::Object {
  EngineMemory memory;
  std::optional<dermis::SceneCommands> commands;
  dermis_scene scene;
  dermis::c::CommandList list;
};

using namespace dermis;
using namespace dermis::c;

extern "C" {

dermis_code dermis_make_plan(const dermis_batch* callers, const dermis_limits* limits,
                             const dermis_tuning* tuning, dermis_plan** plan, dermis_error* error) {
  return guarded(error, [&] {
    dermis_plan*& result = required(plan, "plan");
    std::unique_ptr<dermis_plan> made;
    if (result == nullptr) made = std::make_unique<dermis_plan>();
    dermis_plan& filled = made ? *made : *result;
    // It is empty if anything below fails.
    filled.list.fill({});
    filled.pipelines.clear();
    filled.firstResult = 0;
    must(makePlan({}, {}, {}, filled.plan));

    const dermis_batch desc = in(callers, "batch");
    std::vector<PoseDescription> poses;
    for (const dermis_batch_pose& pose : array(desc.poses, desc.pose_count, "poses"))
      poses.push_back({pose.joint_count, pose.matrix_offset, promiseOf(pose.promise)});
    std::vector<Job> jobs;
    for (const dermis_job& job : inArray(desc.jobs, desc.job_count, "jobs")) {
      Job converted;
      converted.mesh = infoOf(in(job.mesh, "the mesh of a job"));
      converted.meshOffset = job.mesh_offset;
      converted.pose = job.pose;
      converted.method = methodOf(job.method);
      converted.places = placesOf(job.places);
      converted.box = boxOf(job.box);
      converted.morphs = morphsOf(job.morphs, job.morph_count);
      converted.restartsMotion = job.restarts_motion != 0;
      converted.settles = job.settles != 0;
      converted.bounds = job.wants_bounds != 0;
      jobs.push_back(converted);
    }
    Batch batch;
    batch.poses = poses;
    batch.jobs = jobs;
    batch.meshesSize = desc.mesh_bytes;
    batch.posesSize = desc.pose_bytes;
    std::copy_n(desc.output_bytes, streamCount, batch.outputSizes.begin());
    batch.isOneOutput = desc.has_separate_outputs == 0;

    must(makePlan(batch, limitsOf(limits), tuningOf(tuning), filled.plan));
    filled.list.fill(filled.plan.commands());
    for (const PipelineId id : filled.plan.pipelines())
      filled.pipelines.push_back(static_cast<std::uint64_t>(id));
    for (std::uint32_t job = 0; job < jobs.size(); ++job) {
      if (const auto offset = filled.plan.resultOffset(job)) {
        filled.firstResult = *offset;
        break;
      }
    }
    if (made) result = made.release();
  });
}

dermis_code dermis_plan_contents(const dermis_plan* plan, dermis_plan_info* info,
                                 dermis_error* error) {
  return guarded(error, [&] {
    const dermis_plan& source = required(plan, "plan");
    checkOut(info, "info");
    dermis_plan_info result{};
    result.commands = source.list.commands.data();
    result.command_count = static_cast<std::uint32_t>(source.list.commands.size());
    result.pipelines = source.pipelines.data();
    result.pipeline_count = static_cast<std::uint32_t>(source.pipelines.size());
    result.first_result = source.firstResult;
    result.dispatch_count = source.plan.dispatchCount();
    for (std::uint32_t role = 0; role < std::size(result.buffers); ++role)
      result.buffers[role] = requirementOf(source.plan.buffer(static_cast<BufferRole>(role)));
    give(info, result);
  });
}

dermis_code dermis_write_tables(const dermis_plan* plan, void* bytes, size_t byte_count,
                                dermis_error* error) {
  return guarded(error, [&] {
    const dermis_plan& source = required(plan, "plan");
    must(writeTables(source.plan, array(static_cast<std::byte*>(bytes), byte_count, "bytes")));
  });
}

dermis_code dermis_list_pipelines(const dermis_scene* scene, const dermis_instance_desc* desc,
                                  const dermis_limits* limits, const dermis_tuning* tuning,
                                  uint64_t* ids, uint32_t capacity, uint32_t* count,
                                  dermis_error* error) {
  return guarded(error, [&] {
    const auto listed = must(pipelines(needsOf(scene, desc), limitsOf(limits), tuningOf(tuning)));
    const std::span<uint64_t> results = array(ids, capacity, "pipelines");
    required(count, "count") = static_cast<std::uint32_t>(listed.size());
    for (std::size_t i = 0; i < std::min(results.size(), listed.size()); ++i)
      results[i] = static_cast<std::uint64_t>(listed[i]);
  });
}

dermis_code dermis_describe_pipeline(uint64_t pipeline, dermis_pipeline_info* info,
                                     dermis_error* error) {
  return guarded(error, [&] {
    checkOut(info, "info");
    const auto description = must(vulkan::pipelineDescription(static_cast<PipelineId>(pipeline)));
    dermis_pipeline_info result{};
    if (description.module.size() >= sizeof(result.module) ||
        description.constants.size() > std::size(result.constants))
      fail("the pipeline is larger than its description", DERMIS_LIMIT_EXCEEDED);
    result.spirv = description.spirv.data();
    result.word_count = static_cast<std::uint32_t>(description.spirv.size());
    std::memcpy(result.module, description.module.data(), description.module.size());
    std::copy(description.constants.begin(), description.constants.end(), result.constants);
    result.constant_count = static_cast<std::uint32_t>(description.constants.size());
    result.storage_buffers = description.storageBuffers;
    result.texel_buffers = description.texelBuffers;
    give(info, result);
  });
}

dermis_code dermis_commands_create(const dermis_commands_desc* callers, dermis_commands** commands,
                                   dermis_error* error) {
  return guarded(error, [&] {
    const dermis_commands_desc desc = in(callers, "desc");
    dermis_commands*& result = required(commands, "commands");
    if (desc.create_buffer == nullptr || desc.release_buffer == nullptr)
      fail("create_buffer and release_buffer are required");
    auto made = std::make_unique<dermis_commands>();
    made->memory = {desc.user, desc.create_buffer, desc.release_buffer};
    SceneCommandsDescription description;
    description.scene = sceneOf(desc.scene);
    description.limits = limitsOf(desc.limits);
    description.tuning = tuningOf(desc.tuning);
    description.user = &made->memory;
    description.createBuffer = EngineMemory::createBuffer;
    description.releaseBuffer = EngineMemory::releaseBuffer;
    description.outputOffset = desc.output_offset;
    made->commands.emplace(must(SceneCommands::create(description)));
    made->scene.scene = &made->commands->scene();
    result = made.release();
  });
}

dermis_scene* dermis_commands_scene(dermis_commands* commands) {
  return commands == nullptr ? nullptr : &commands->scene;
}

dermis_code dermis_commands_plan(dermis_commands* commands, void* tables, size_t table_bytes,
                                 const dermis_command** list, uint32_t* count,
                                 dermis_error* error) {
  return guarded(error, [&] {
    dermis_commands& lender = required(commands, "commands");
    const dermis_command*& first = required(list, "list");
    std::uint32_t& size = required(count, "count");
    const std::span<std::byte> room = array(static_cast<std::byte*>(tables), table_bytes, "tables");
    lender.list.fill(must(lender.commands->plan(room)));
    first = lender.list.commands.data();
    size = static_cast<std::uint32_t>(lender.list.commands.size());
  });
}

dermis_code dermis_commands_commit(dermis_commands* commands, uint32_t* output_buffer,
                                   dermis_error* error) {
  return guarded(error, [&] {
    dermis_commands& lender = required(commands, "commands");
    must(lender.commands->commit());
    if (output_buffer != nullptr) *output_buffer = lender.commands->outputBuffer();
  });
}

dermis_code dermis_commands_read_back(dermis_commands* commands, uint64_t frame, const void* bytes,
                                      size_t byte_count, dermis_error* error) {
  return guarded(error, [&] {
    dermis_commands& lender = required(commands, "commands");
    must(lender.commands->readBack(
        frame, array(static_cast<const std::byte*>(bytes), byte_count, "bytes")));
  });
}

dermis_code dermis_commands_pose_part(const dermis_commands* commands, dermis_pose pose,
                                      dermis_part* part, dermis_error* error) {
  return guarded(error, [&] {
    const dermis_commands& lender = required(commands, "commands");
    dermis_part& result = required(part, "part");
    result = partOf(must(lender.commands->posePart(handleOf(pose))));
  });
}

dermis_code dermis_commands_weights_part(const dermis_commands* commands, dermis_instance instance,
                                         dermis_part* part, dermis_error* error) {
  return guarded(error, [&] {
    const dermis_commands& lender = required(commands, "commands");
    dermis_part& result = required(part, "part");
    result = partOf(must(lender.commands->weightsPart(handleOf(instance))));
  });
}

dermis_code dermis_commands_driven_part(const dermis_commands* commands, dermis_pose pose,
                                        dermis_part* part, dermis_error* error) {
  return guarded(error, [&] {
    const dermis_commands& lender = required(commands, "commands");
    dermis_part& result = required(part, "part");
    result = partOf(must(lender.commands->drivenPart(handleOf(pose))));
  });
}

}  // extern "C"
