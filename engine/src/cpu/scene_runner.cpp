// Runs a Scene on the CPU: divides the work of each frame into jobs.

#include "dermis/cpu.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <deque>
#include <limits>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "abi.h"
#include "cpu/clip_plan.h"
#include "cpu/task.h"
#include "plan/check.h"
#include "plan/work.h"
#include "scene/books.h"
#include "strict_floating_point.h"

namespace dermis::cpu {

struct PlannedTask : Task {};

void run(const PlannedJob& job) {
  skinTask(*job.task_);
}

namespace {

constexpr std::uint32_t noResult = 0xffffffff;
/// Instances that the widest vectors skin at a time.
constexpr std::uint64_t instancesTogether = 16;

/// The largest size of an object, a multiple of 64. Buffers are smaller, so that their sizes fit
/// `std::size_t` on 32-bit systems too.
constexpr std::uint64_t largestSize = std::numeric_limits<std::ptrdiff_t>::max() / 64 * 64;

/// As large as offsets in the tables allow.
DeviceLimits limitsOfMemory() {
  DeviceLimits limits;
  limits.maxStorageBufferRange = std::min<std::uint64_t>(0xfffffffc, largestSize);
  limits.minStorageBufferOffsetAlignment = 64;
  limits.maxWorkgroupCountX = limits.maxWorkgroupCountY = 0xffffffff;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  limits.comparisonMethods = false;
  return limits;
}

/// The floats behind the first matrices of a pose's memory.
std::span<float> weightsBehind(std::span<JointMatrix> memory, std::size_t joints) {
  const std::span<JointMatrix> rest = memory.subspan(joints);
  return {reinterpret_cast<float*>(rest.data()), rest.size_bytes() / sizeof(float)};
}

}  // namespace

struct SceneRunner::State {
  Result<void*> createBuffer(const SceneBuffer& wanted);
  SceneBooks& books() const { return SceneAccess::books(*scene); }

  void readBackResults();
  std::span<std::byte> memoryOf(std::uint32_t buffer);
  TaskInstance taskInstance(const Work::Instance& instance, const Group& group);
  void placeFigures();
  void placeRigs();
  void placeInstances(const Work& work);
  void addGroup(const Group& group, std::uint64_t verticesPerJob);
  void addInstances(const Task& task, std::size_t first, std::size_t count,
                    std::uint64_t verticesPerJob);
  void addTask(const Task& task, std::size_t first, std::size_t count);
  void finishTasks();

  std::unique_ptr<Scene> scene;
  const std::uint64_t windowStep = outputWindowStep(limitsOfMemory());
  bool isPlanned = false;  ///< the jobs of the frame were made

  std::unordered_map<std::uint64_t, Mesh> meshes;  ///< by their offset in a mesh buffer
  std::unordered_map<const PackedClips*, ClipPlan> plans;
  std::span<std::byte> lent;  ///< the engine's memory for the output
  struct Memory {
    std::vector<CacheLine> lines;
    std::size_t size = 0;  ///< bytes
  };
  std::unordered_map<std::uint32_t, Memory> buffers;  ///< by number
  std::span<std::byte> output;                        ///< of the frame

  std::deque<FigureTask> figures;  ///< that the frame samples, and more
  std::deque<RigTask> rigs;        ///< that the frame evaluates, and more
  std::vector<RigTask*> openRigs;  ///< of each rig: the task to which poses are added
  std::vector<RigTask*> rigOf;     ///< of each pose whose rig the frame evaluates
  std::vector<TaskInstance> instances;
  std::vector<std::uint32_t> resultOf;  ///< of each instance: index of its result, or `noResult`
  /// A task's result for an instance. Other tasks may skin other vertices of the same instance.
  struct Part {
    std::uint32_t result;
    InstanceResult found;
  };
  std::vector<Part> parts;
  std::vector<std::uint32_t> filled;  ///< of each group: instances that have their place
  std::vector<std::byte> readBack;    ///< as a GPU would write it
  struct Extent {
    std::size_t first, count;
  };
  std::vector<PlannedTask> tasks;
  std::vector<Extent> extents;  ///< of each task: its range of `instances`
  std::vector<PlannedJob> jobs;
};

/// Only poses and the output need memory.
Result<void*> SceneRunner::State::createBuffer(const SceneBuffer& wanted) {
  const bool isOutput = wanted.role == BufferRole::positions;
  if (isOutput && !lent.empty()) return static_cast<void*>(lent.data());
  if (!isOutput && wanted.role != BufferRole::poses) return static_cast<void*>(nullptr);
  const auto size = static_cast<std::size_t>(wanted.requirement.size);
  Memory& memory = buffers[wanted.number];
  memory.lines.resize(size / sizeof(CacheLine) + 1);
  memory.size = size;
  return static_cast<void*>(memory.lines.data());
}

SceneRunner::SceneRunner() = default;
SceneRunner::~SceneRunner() = default;
SceneRunner::SceneRunner(SceneRunner&&) noexcept = default;
SceneRunner& SceneRunner::operator=(SceneRunner&&) noexcept = default;

Result<SceneRunner> SceneRunner::create(const SceneDescription& description,
                                        std::span<std::byte> output) {
  if (!output.empty() && output.size() < 4)
    return Error{ErrorCode::invalidArgument, "the output has fewer than 4 bytes"};
  SceneSetup setup{description, limitsOfMemory(), {128, 32}};
  setup.scene.framesInFlight = 1;
  if (!output.empty()) setup.scene.outputCapacity = Capacity::fixed(output.size() / 4 * 4);
  Capacity& capacity = setup.scene.outputCapacity;
  capacity.maximum = std::min(capacity.maximum, largestSize);
  SceneRunner runner;
  runner.state_ = std::make_unique<State>();
  State& state = *runner.state_;
  state.lent = output.first(output.size() / 4 * 4);
  SceneOwner owner;
  owner.user = &state;
  owner.createBuffer = [](void* user, const SceneBuffer& wanted) {
    return static_cast<State*>(user)->createBuffer(wanted);
  };
  owner.releaseBuffer = [](void* user, std::uint32_t number) {
    static_cast<State*>(user)->buffers.erase(number);
  };
  owner.isCpu = true;
  owner.frameBegun = [](void* user, std::uint64_t) {
    State& begun = *static_cast<State*>(user);
    if (std::exchange(begun.isPlanned, false)) begun.readBackResults();
    begun.jobs.clear();
  };
  owner.frameAbandoned = [](void* user) {
    static_cast<State*>(user)->isPlanned = false;
    static_cast<State*>(user)->jobs.clear();
  };
  owner.meshAdded = [](void* user, std::uint64_t offset, const PackedMesh& mesh) -> Result<void> {
    Result<Mesh> made = Mesh::create(mesh);
    if (!made) return made.error();
    static_cast<State*>(user)->meshes.insert_or_assign(offset, std::move(*made));
    return {};
  };
  owner.meshRemoved = [](void* user, std::uint64_t offset) {
    static_cast<State*>(user)->meshes.erase(offset);
  };
  owner.clipsAdded = [](void* user, const PackedClips& clips) {
    static_cast<State*>(user)->plans.emplace(&clips, ClipPlan(clips));
  };
  owner.clipsRemoved = [](void* user, const PackedClips& clips) {
    static_cast<State*>(user)->plans.erase(&clips);
  };
  Result<std::unique_ptr<Scene>> scene = SceneAccess::create(setup, owner);
  if (!scene) return scene.error();
  state.scene = std::move(*scene);
  return runner;
}

Scene& SceneRunner::scene() const {
  return *state_->scene;
}

Result<MeshHandle> SceneRunner::addMesh(Mesh mesh) {
  SceneBooks& books = SceneAccess::changed(scene());
  Result<MeshHandle> handle = books.addMesh(mesh.info(), nullptr);
  if (handle) {
    const std::uint64_t offset = books.meshes_.at(handle->index).bytes.offset;
    state_->meshes.insert_or_assign(offset, std::move(mesh));
  }
  return handle;
}

/// Of an output buffer.
std::span<std::byte> SceneRunner::State::memoryOf(std::uint32_t buffer) {
  if (!lent.empty()) return lent;
  Memory& memory = buffers.at(buffer);
  return std::as_writable_bytes(std::span(memory.lines)).first(memory.size);
}

Result<std::span<const PlannedJob>> SceneRunner::jobs(std::uint32_t verticesPerJob) {
  State& state = *state_;
  SceneBooks& books = state.books();
  if (Result<void> gathered = books.gather(); !gathered) return gathered.error();
  const std::span<std::byte> before = state.memoryOf(books.output_);
  state.output = state.memoryOf(books.outputStore_.buffer.now.number);
  if (state.output.data() != before.data())
    std::memcpy(state.output.data(), before.data(), before.size());
  for (const CopyCommand& move : books.moves_) {
    std::memcpy(state.output.data() + move.toOffset, state.output.data() + move.fromOffset,
                static_cast<std::size_t>(move.size));
  }
  state.placeFigures();
  state.placeRigs();
  state.placeInstances(books.work_);
  state.tasks.clear();
  state.extents.clear();
  for (const std::uint32_t group : books.work_.order)
    state.addGroup(books.work_.groups[group], std::max(verticesPerJob, 1u));
  state.finishTasks();
  if (Result<void> committed = books.commit(); !committed) return committed.error();
  state.isPlanned = true;
  return std::span<const PlannedJob>(state.jobs);
}

std::span<const std::byte> SceneRunner::output() const {
  return state_->memoryOf(state_->books().output_);
}

void SceneRunner::State::placeFigures() {
  const std::vector<std::uint32_t>& sampling = books().sampling_;
  while (figures.size() < sampling.size()) figures.emplace_back();
  for (std::size_t place = 0; place < sampling.size(); ++place) {
    const SceneFigure& figure = books().figures_.at(sampling[place]);
    FigureTask& task = figures[place];
    task.plan = &plans.at(&books().clips_.at(figure.clips.index).content->bank);
    task.layers = figure.layers;
    task.matrices = books().matricesOf(figure);
    task.work.restart();
  }
}

/// What a rig drives is in memory behind a copy of the written joints.
void SceneRunner::State::placeRigs() {
  rigOf.resize(books().poses_.capacity());
  openRigs.assign(books().rigs_.capacity(), nullptr);
  std::size_t used = 0;
  for (const std::uint32_t index : books().driving_) {
    const ScenePose& pose = books().poses_.at(index);
    const PackedRig& rig = *books().rigs_.at(pose.rig).rig;
    RigTask*& task = openRigs[pose.rig];
    if (task == nullptr || task->count == RigTask::most) {
      if (used == rigs.size()) rigs.emplace_back();
      task = &rigs[used++];
      task->rig = &rig;
      task->count = 0;
      task->work.restart();
    }
    const std::size_t written = pose.writtenJoints, given = rig.givenWeights();
    const std::span<JointMatrix> source = books().matricesOf(pose), all = books().drivenOf(pose);
    const auto weights = weightsBehind(all, pose.jointCount).first(given + rig.drivenWeights());
    RigPose& own = task->poses[task->count];
    own.written = source.first(written);
    own.driven = all.subspan(written, rig.drivenJoints());
    own.weights = weights;
    if (pose.figure != notUsed) {
      task->figures[task->count] = &figures[books().figures_.at(pose.figure).place];
      own.givenWeights = weights.first(given);
    } else {
      task->figures[task->count] = nullptr;
      own.givenWeights = weightsBehind(source, written).first(given);
    }
    ++task->count;
    rigOf[index] = task;
  }
}

TaskInstance SceneRunner::State::taskInstance(const Work::Instance& instance, const Group& group) {
  TaskInstance skinned;
  const ScenePose& pose = books().poses_.at(instance.pose);
  skinned.pose = books().matricesOf(pose);
  if (pose.rig != notUsed) {
    const std::span<JointMatrix> all = books().drivenOf(pose);
    skinned.pose = all.first(pose.jointCount);
    if (pose.drivenPlan == books().planNumber_) skinned.rig = rigOf[instance.pose];
    if (instance.extras != nullptr && instance.extras->drivenMorphs != 0) {
      const std::uint32_t count = instance.extras->drivenMorphs;
      skinned.drivenWeights =
          weightsBehind(all, pose.jointCount).subspan(instance.extras->firstDrivenWeight, count);
      skinned.firstDrivenTarget =
          dataOf(meshes.find(group.key.mesh)->second).info.morphTargetCount - count;
    }
  }
  skinned.mayScale = pose.promise == JointPromise::scaling;
  skinned.restartsMotion = (instance.flags & abi::INSTANCE_RESTARTS) != 0;
  skinned.settles = (instance.flags & abi::INSTANCE_SETTLES) != 0;
  if (pose.figure != notUsed) {
    const SceneFigure& figure = books().figures_.at(pose.figure);
    if (figure.plannedIn == books().planNumber_) skinned.figure = &figures[figure.place];
  }
  if (instance.extras != nullptr) {
    skinned.morphs = instance.extras->morphs;
    if (instance.extras->hasBox) {
      const BoxScale scale = boxScale(instance.extras->box);
      std::ranges::copy(scale.center, skinned.boxCenter);
      std::ranges::copy(scale.inverse, skinned.boxInverse);
    }
  }
  const GroupKey& key = group.key;
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (key.strides[stream] == 0) continue;
    // Runs have the place of their first vertex.
    skinned.outputs[stream] = output.data() + key.windows[stream] * windowStep +
                              instance.run.offsets[stream] -
                              std::size_t{key.firstVertex} * key.strides[stream];
  }
  return skinned;
}

/// The instances of all groups, each group's together.
void SceneRunner::State::placeInstances(const Work& work) {
  instances.resize(work.instances.size());
  resultOf.assign(instances.size(), noResult);
  filled.assign(work.groups.size(), 0);
  for (const Work::Instance& instance : work.instances) {
    const Group& group = work.groups[instance.group];
    const std::size_t place = group.firstInstance + std::size_t{filled[instance.group]++};
    instances[place] = taskInstance(instance, group);
    if (instance.extras != nullptr && !instances[place].settles)
      resultOf[place] = instance.extras->result;
  }
}

void SceneRunner::State::addGroup(const Group& group, std::uint64_t verticesPerJob) {
  const Variant& variant = group.variant;
  Task task;
  task.mesh = &dataOf(meshes.find(group.key.mesh)->second);
  task.method = variant.method;
  const ByStream<std::uint32_t>& strides = group.key.strides;
  task.places[Stream::positions] = {0, strides[0], variant.positions};
  task.places[Stream::normals] = {0, strides[1], variant.normals};
  task.places[Stream::tangents] = {0, strides[2], variant.tangents};
  task.places[Stream::previousPositions] = {
      0, strides[3], variant.motion ? variant.positions : VertexFormat::none};
  task.firstVertex = group.key.firstVertex;
  task.vertexEnd = group.key.vertexEnd;
  addInstances(task, group.firstInstance, group.instances, verticesPerJob);
}

/// Adds `count` instances from `first` on, as tasks for some of them or for some of their vertices.
void SceneRunner::State::addInstances(const Task& task, std::size_t first, std::size_t count,
                                      std::uint64_t verticesPerJob) {
  const std::uint64_t vertices = task.vertexEnd - task.firstVertex;
  std::uint64_t each = std::min<std::uint64_t>(count, instancesTogether);
  std::uint64_t step = vertices;
  if (vertices * each <= verticesPerJob) {
    each = std::max(verticesPerJob / vertices / instancesTogether * instancesTogether, each);
  } else {
    const std::uint64_t ranges = (vertices * each + verticesPerJob - 1) / verticesPerJob;
    const std::uint64_t blocks = (vertices + ranges * blockVertices - 1) / (ranges * blockVertices);
    step = blocks * blockVertices;
  }
  const bool findOut = std::ranges::any_of(std::span(resultOf).subspan(first, count),
                                           [](std::uint32_t result) { return result != noResult; });
  Task part = task;
  for (std::uint64_t begin = task.firstVertex; begin < task.vertexEnd; begin += step) {
    part.firstVertex = static_cast<std::uint32_t>(begin);
    part.vertexEnd =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(begin + step, task.vertexEnd));
    const bool isAgain = begin != task.firstVertex && findOut;
    for (std::size_t instance = 0; isAgain && instance < count; ++instance) {
      // Ranges may run at the same time, so each has its own results.
      instances.push_back(TaskInstance(instances[first + instance]));
      resultOf.push_back(std::uint32_t{resultOf[first + instance]});
    }
    const std::size_t from = isAgain ? instances.size() - count : first;
    const auto together = static_cast<std::size_t>(std::min<std::uint64_t>(each, count));
    for (std::size_t instance = 0; instance < count; instance += together)
      addTask(part, from + instance, std::min(together, count - instance));
  }
}

void SceneRunner::State::addTask(const Task& task, std::size_t first, std::size_t count) {
  tasks.push_back({task});
  extents.push_back({first, count});
}

/// Called after all tasks were added, when the vectors no longer reallocate.
void SceneRunner::State::finishTasks() {
  parts.clear();
  for (const std::uint32_t result : resultOf) {
    if (result != noResult) parts.push_back({result, {}});
  }
  std::size_t part = 0;
  for (std::size_t index = 0; index < instances.size(); ++index) {
    if (resultOf[index] != noResult) instances[index].result = &parts[part++].found;
  }
  jobs.clear();
  for (std::size_t index = 0; index < tasks.size(); ++index) {
    PlannedTask& task = tasks[index];
    task.instances = std::span(instances).subspan(extents[index].first, extents[index].count);
    PlannedJob& job = jobs.emplace_back();
    job.task_ = &task;
    job.vertexCount_ = std::uint64_t{task.vertexEnd - task.firstVertex} * task.instances.size();
  }
}

/// Combines the results of the jobs, and reads them back as those of a GPU.
void SceneRunner::State::readBackResults() {
  const std::uint64_t size =
      dermis::readBackResults + books().resultStore_.ranges.capacity() * sizeof(InstanceResult);
  readBack.resize(static_cast<std::size_t>(size));
  const auto placeOf = [this](const Part& part) {
    return readBack.data() + dermis::readBackResults + part.result * sizeof(InstanceResult);
  };
  const auto set = [](std::byte* place, const InstanceResult& result) {
    std::memcpy(place, &result, sizeof(result));
  };
  for (const Part& part : parts) set(placeOf(part), {});
  for (const Part& part : parts) {
    InstanceResult result;
    std::memcpy(&result, placeOf(part), sizeof(result));
    addResult(result, part.found);
    set(placeOf(part), result);
  }
  static_cast<void>(books().readBack(books().recordedFrame_, readBack).ok());  // it is complete
}

}  // namespace dermis::cpu
