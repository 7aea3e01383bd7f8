// Checks of a job, and code that does not depend on instruction sets.

#include "dermis/cpu.h"

#include <algorithm>
#include <string>

#include "cpu/task.h"
#include "cpu/thread_memory.h"
#include "plan/check.h"
#include "strict_floating_point.h"

namespace dermis::cpu {
namespace {

Error wrong(const std::string& what) {
  return {ErrorCode::invalidArgument, what};
}

/// Runs `checkJob` on the equivalent job in buffers: the only one, in buffers as large as it needs.
Result<void> checkLayout(const Job& job) {
  const MeshInfo& info = job.mesh->info();
  dermis::Job checked;
  checked.mesh = info;
  checked.method = job.method;
  checked.places = job.places;
  // Offsets are relative to the engine's addresses.
  for (OutputAttribute& attribute : checked.places.attributes) attribute.offset = 0;
  checked.box = {{-1, -1, -1}, {1, 1, 1}};
  const PoseDescription pose{info.requiredJoints, 0};
  Batch batch;
  batch.poses = {&pose, 1};
  batch.meshesSize = info.byteSize;
  batch.posesSize = info.requiredJoints * sizeof(JointMatrix);
  batch.outputSizes.fill(~std::uint64_t{0} / 4 * 4);
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  return checkJob(batch, checked, outputStreams(checked), {"the job"}, limits);
}

Result<void> checkPose(std::span<const JointMatrix> pose, const MeshInfo& info,
                       const Subject& subject) {
  if (pose.size() >= info.requiredJoints) return {};
  return wrong(subject.name() + ": its pose has " + std::to_string(pose.size()) +
               " joints, but its mesh requires " + std::to_string(info.requiredJoints));
}

Result<void> checkInstance(const Job& job, const Instance& instance, const Subject& subject) {
  const MeshInfo& info = job.mesh->info();
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (job.places.attributes[stream].format != VertexFormat::none &&
        instance.output[stream] == nullptr)
      return wrong(subject.name() + " has no output for its " + streamName(stream));
  }
  if (Result<void> good = checkPose(instance.pose, info, subject); !good) return good;
  if (Result<void> good = checkMorphs(instance.morphs, info.morphTargetCount, subject); !good)
    return good;
  if (!std::ranges::is_sorted(instance.morphs, {}, &MorphWeight::target))
    return wrong(subject.name() + ": its morph targets are not in ascending order");
  if (Result<void> good = checkPromise(instance.promise, subject); !good) return good;
  if (isSnormPosition(job.places[Stream::positions].format) && !isBox(instance.box)) {
    return wrong(subject.name() +
                 ": the box of its snorm16 positions must be finite, with sides longer than 0");
  }
  if (!job.places.hasMotion() && (instance.settles || instance.restartsMotion)) {
    return wrong(subject.name() + " settles or restarts its motion, but has no previous positions");
  }
  return {};
}

Result<void> check(const Job& job) {
  if (job.mesh == nullptr) return wrong("the job has no mesh");
  if (Result<void> good = checkMethod(job.method, "the job: "); !good) return good;
  const std::uint32_t end = std::min(job.vertexEnd, job.mesh->info().vertexCount);
  if (job.firstVertex > end) {
    return wrong("the job's firstVertex of " + std::to_string(job.firstVertex) +
                 " is after its last vertex; vertexEnd is " + std::to_string(job.vertexEnd) +
                 ", and the mesh has " + std::to_string(job.mesh->info().vertexCount) +
                 " vertices");
  }
  if (Result<void> good = checkLayout(job); !good) return good;
  for (std::size_t index = 0; index < job.instances.size(); ++index) {
    if (Result<void> good = checkInstance(job, job.instances[index], {"instance", index}); !good)
      return good;
  }
  return {};
}

TaskInstance taskInstance(const Instance& instance, const VertexPlaces& places) {
  TaskInstance own;
  own.pose = instance.pose;
  own.mayScale = instance.promise == JointPromise::scaling;
  own.restartsMotion = instance.restartsMotion;
  own.settles = instance.settles;
  own.morphs = instance.morphs;
  own.result = instance.result;
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    auto* const memory = static_cast<std::byte*>(instance.output[stream]);
    if (memory != nullptr) own.outputs[stream] = memory + places.attributes[stream].offset;
  }
  if (isSnormPosition(places[Stream::positions].format)) {
    const BoxScale scale = boxScale(instance.box);
    std::ranges::copy(scale.center, own.boxCenter);
    std::ranges::copy(scale.inverse, own.boxInverse);
  }
  return own;
}

void skinMesh(const Job& job, const MeshData& mesh) {
  std::vector<TaskInstance>& instances = threadMemory().instances;
  instances.clear();
  for (const Instance& instance : job.instances)
    instances.push_back(taskInstance(instance, job.places));
  skinTask({&mesh, job.method, job.places, job.firstVertex, job.vertexEnd, instances});
}

}  // namespace

Result<void> checkMethod(Method method, const char* subject) {
  if (!isForComparison(method)) return {};
  return wrong(subject + std::string(methodName(method)) +
               " is a method for comparison, which the CPU path does not support");
}

namespace {

/// Copies of the instances, whose lists of morph targets also have those that rigs drive. They are
/// valid until the thread's next call.
std::span<const TaskInstance> withDrivenTargets(std::span<const TaskInstance> instances) {
  ThreadMemory& memory = threadMemory();
  memory.drivenInstances.assign(instances.begin(), instances.end());
  std::vector<MorphWeight>& morphs = memory.drivenMorphs;
  morphs.clear();
  std::size_t most = 0;
  for (const TaskInstance& instance : instances)
    most += instance.morphs.size() + instance.drivenWeights.size();
  morphs.reserve(most);
  for (TaskInstance& instance : memory.drivenInstances) {
    const std::size_t first = morphs.size();
    morphs.insert(morphs.end(), instance.morphs.begin(), instance.morphs.end());
    std::uint32_t target = instance.firstDrivenTarget;
    for (const float weight : instance.drivenWeights) {
      if (weight != 0) morphs.push_back({target, weight});
      ++target;
    }
    instance.morphs = std::span<const MorphWeight>(morphs).subspan(first);
  }
  return memory.drivenInstances;
}

}  // namespace

void skinTask(const Task& task) {
  for (const TaskInstance& instance : task.instances) {
    if (instance.figure != nullptr) instance.figure->finish();
    if (instance.rig != nullptr) instance.rig->finish();
  }
  Task complete = task;
  if (std::ranges::any_of(task.instances, [](const TaskInstance& instance) {
        return !instance.drivenWeights.empty();
      }))
    complete.instances = withDrivenTargets(task.instances);
  dispatchTask(complete, threadMemory().scratch);
}

Result<void> skin(const Job& job) {
  if (Result<void> good = check(job); !good) return good;
  Job clipped = job;
  clipped.vertexEnd = std::min(job.vertexEnd, job.mesh->info().vertexCount);
  for (const Instance& instance : job.instances) {
    if (instance.result != nullptr) *instance.result = {};
  }
  if (clipped.firstVertex != clipped.vertexEnd) skinMesh(clipped, dataOf(*job.mesh));
  return {};
}

Result<void> skinVertices(const Mesh& mesh, Method method, const Instance& instance,
                          std::span<const std::uint32_t> vertices, std::span<float> positions) {
  const std::uint32_t vertexCount = mesh.info().vertexCount;
  for (const std::uint32_t vertex : vertices) {
    if (vertex < vertexCount) continue;
    return wrong("there is no vertex " + std::to_string(vertex) + " in a mesh of " +
                 std::to_string(vertexCount));
  }
  if (positions.size() != vertices.size() * 3) {
    return wrong(std::to_string(vertices.size()) +
                 " vertices need three floats each, but there are " +
                 std::to_string(positions.size()) + " floats");
  }
  Instance own;
  own.pose = instance.pose;
  own.promise = instance.promise;
  own.morphs = instance.morphs;
  float none = 0;  // of an empty list
  own.output[Stream::positions] = positions.empty() ? &none : positions.data();
  Job job;
  job.mesh = &mesh;
  job.method = method;
  job.instances = {&own, 1};
  const Result<VertexPlaces> places =
      placeVertices({}, static_cast<std::uint32_t>(vertices.size()));
  if (!places) return places.error();
  job.places = *places;
  if (Result<void> good = check(job); !good) return good;
  if (vertices.empty()) return {};
  const MeshData selected = dataOf(mesh).select(vertices, own.morphs);
  own.morphs = {};
  job.vertexEnd = static_cast<std::uint32_t>(vertices.size());
  skinMesh(job, selected);
  return {};
}

void addResult(InstanceResult& result, const InstanceResult& other) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.orderedMin[axis] = std::min(result.orderedMin[axis], other.orderedMin[axis]);
    result.orderedMax[axis] = std::max(result.orderedMax[axis], other.orderedMax[axis]);
  }
  result.clampedVertices += other.clampedVertices;
}

}  // namespace dermis::cpu
