// Runs a Scene on the CPU: divides the work of each frame into jobs.

#include "dermis/cpu/skinning_system.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <limits>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "abi.h"
#include "cpu/task.h"
#include "dermis/cpu/skin.h"
#include "plan/check.h"
#include "plan/work.h"
#include "strict_floating_point.h"
#include "system/books.h"

namespace dermis::cpu {

struct PlannedTask : Task {};

void skin(const PlannedJob& job) {
  skinTask(*job.task_);
}

namespace {

constexpr std::uint32_t noResult = 0xffffffff;
/// Instances that the widest vectors skin at a time.
constexpr std::uint64_t instancesTogether = 4;

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

Error wrong(const std::string& what) {
  return {ErrorCode::invalidArgument, what};
}

}  // namespace

struct SkinningSystem::State {
  explicit State(Scene&& own) : scene(std::move(own)) {}

  Result<void> grow(const BufferGrowth& growth);
  void addPoseBuffer(std::uint64_t bytes);
  std::span<JointMatrix> poseAt(const PosePlace& place) {
    return std::span(poseBuffers[place.poseBuffer])
        .subspan(static_cast<std::size_t>(place.offset) / sizeof(JointMatrix), place.jointCount);
  }

  void readBackResults();
  TaskInstance taskInstance(const Work::Instance& instance, const Group& group);
  void placeInstances(const Work& work);
  void addGroup(const Group& group, std::uint64_t verticesPerJob);
  void addInstances(const Task& task, std::size_t first, std::size_t count,
                    std::uint64_t verticesPerJob);
  void addTask(const Task& task, std::size_t first, std::size_t count);
  void finishTasks();

  Scene scene;
  SceneBooks& books{SceneAccess::books(scene)};
  std::unique_ptr<State*> self;  ///< context of the scene's growth callback
  const std::uint64_t windowStep = outputWindowStep(limitsOfMemory());
  std::uint64_t frame = 0;
  bool isPlanned = false;  ///< the jobs of the frame were made

  struct OwnMesh {
    MeshHandle handle;
    Mesh mesh;
  };
  std::unordered_map<std::uint64_t, OwnMesh> meshes;  ///< by their offset in a mesh buffer
  std::vector<std::vector<JointMatrix>> poseBuffers;
  std::vector<CacheLine> ownOutput;
  std::span<std::byte> output;
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

// -- Memory.

void SkinningSystem::State::addPoseBuffer(std::uint64_t bytes) {
  poseBuffers.emplace_back(static_cast<std::size_t>(bytes / sizeof(JointMatrix)));
}

Result<void> SkinningSystem::State::grow(const BufferGrowth& growth) {
  if (growth.role == BufferRole::poses) addPoseBuffer(growth.requirement.size);
  if (growth.role != BufferRole::positions) return {};
  const auto size = static_cast<std::size_t>(growth.requirement.size);
  std::vector<CacheLine> larger(size / sizeof(CacheLine) + 1);
  std::memcpy(larger.data(), output.data(), output.size());
  ownOutput = std::move(larger);
  output = std::as_writable_bytes(std::span(ownOutput)).first(size);
  return {};
}

SkinningSystem::SkinningSystem() = default;
SkinningSystem::~SkinningSystem() = default;
SkinningSystem::SkinningSystem(SkinningSystem&&) noexcept = default;
SkinningSystem& SkinningSystem::operator=(SkinningSystem&&) noexcept = default;

Result<SkinningSystem> SkinningSystem::create(const SkinningSystemDescription& description) {
  const bool ownsOutput = description.output.empty();
  if (!ownsOutput && description.output.size() < 4)
    return wrong("SkinningSystemDescription::output has fewer than 4 bytes");
  auto self = std::make_unique<State*>(nullptr);
  SceneDescription ofScene;
  ofScene.framesInFlight = 1;
  ofScene.jointCapacity = description.jointCapacity;
  ofScene.outputCapacity =
      ownsOutput ? description.outputCapacity : Capacity::fixed(description.output.size() / 4 * 4);
  ofScene.outputCapacity.maximum = std::min(ofScene.outputCapacity.maximum, largestSize);
  ofScene.instanceCapacity = description.instanceCapacity;
  ofScene.boundsCapacity = description.boundsCapacity;
  ofScene.limits = limitsOfMemory();
  ofScene.tuning = {128, 32};
  ofScene.growth = {self.get(), [](void* user, const BufferGrowth& growth) {
                      return (*static_cast<State**>(user))->grow(growth);
                    }};
  Result<Scene> scene = Scene::create(ofScene);
  if (!scene) return scene.error();
  SkinningSystem system;
  system.state_ = std::make_unique<State>(std::move(*scene));
  State& state = *system.state_;
  *self = &state;
  state.self = std::move(self);
  for (std::uint32_t number = 0; number < state.scene.poseBufferCount(); ++number)
    state.addPoseBuffer(state.scene.poseBuffer(number).requirement.size);
  if (ownsOutput) {
    const auto size = static_cast<std::size_t>(state.scene.buffer(BufferRole::positions).size);
    state.ownOutput.resize(size / sizeof(CacheLine) + 1);
    state.output = std::as_writable_bytes(std::span(state.ownOutput)).first(size);
  } else {
    state.output = description.output;
  }
  return system;
}

// -- Meshes, poses, instances.

Result<MeshHandle> SkinningSystem::addMesh(Mesh mesh) {
  Result<MeshHandle> handle = state_->scene.addMesh(mesh.info());
  if (!handle) return handle;
  state_->meshes.emplace(*state_->scene.meshOffset(*handle),
                         State::OwnMesh{*handle, std::move(mesh)});
  return handle;
}
Result<MeshHandle> SkinningSystem::addMesh(const PackedMesh& mesh) {
  Result<Mesh> made = Mesh::create(mesh);
  if (!made) return made.error();
  return addMesh(std::move(*made));
}
Result<void> SkinningSystem::removeMesh(MeshHandle mesh) {
  if (Result<void> removed = state_->scene.removeMesh(mesh); !removed) return removed;
  std::erase_if(state_->meshes, [&](const auto& entry) { return entry.second.handle == mesh; });
  return {};
}

Result<PoseHandle> SkinningSystem::addPose(std::uint32_t jointCount, const PoseOptions& options) {
  PoseHandle pose;
  if (Result<void> added = addPoses({&pose, 1}, jointCount, options); !added) return added.error();
  return pose;
}
Result<void> SkinningSystem::addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                                      const PoseOptions& options) {
  if (options.writer == PoseWriter::gpu)
    return wrong("a pose that the GPU writes cannot be skinned on the CPU");
  if (Result<void> added = state_->scene.addPoses(poses, jointCount, options); !added) return added;
  for (const PoseHandle pose : poses)
    std::ranges::fill(state_->poseAt(*state_->scene.posePlace(pose)), JointMatrix{});
  return {};
}
Result<void> SkinningSystem::removePose(PoseHandle pose) {
  return state_->scene.removePose(pose);
}
Result<InstanceHandle> SkinningSystem::addInstance(const InstanceDescription& description) {
  if (Result<void> good = checkMethod(description.method, "the instance: "); !good)
    return good.error();
  if (description.culledOnGpu)
    return wrong("an instance that is culled on the GPU cannot be skinned on the CPU");
  return state_->scene.addInstance(description);
}
Result<void> SkinningSystem::removeInstance(InstanceHandle instance) {
  return state_->scene.removeInstance(instance);
}

// -- What changes.

void SkinningSystem::beginFrame() {
  State& state = *state_;
  const bool hasResults = std::exchange(state.isPlanned, false);
  ++state.frame;
  // Consecutive frame numbers are always valid.
  static_cast<void>(state.scene.beginFrame(state.frame, state.frame - 1).ok());
  if (hasResults) state.readBackResults();
  state.jobs.clear();
}
std::uint64_t SkinningSystem::frame() const {
  return state_->frame;
}

Result<std::span<JointMatrix>> SkinningSystem::writePose(PoseHandle pose) {
  const Result<PosePlace> place = state_->scene.writePose(pose);
  if (!place) return place.error();
  return state_->poseAt(*place);
}
Result<void> SkinningSystem::change(const InstanceChange& change) {
  if (change.method) {
    if (Result<void> good = checkMethod(*change.method, "the change: "); !good) return good;
  }
  return state_->scene.change(change);
}
Result<void> SkinningSystem::change(std::span<const InstanceChange> changes) {
  const auto isWrong = [](const InstanceChange& change) {
    return change.method && isForComparison(*change.method);
  };
  const auto bad = std::ranges::find_if(changes, isWrong);
  const auto number = static_cast<std::size_t>(bad - changes.begin());
  if (Result<void> done = state_->scene.change(changes.first(number)); !done) return done;
  if (bad == changes.end()) return {};
  return wrong("change " + std::to_string(number) + ": " +
               checkMethod(*bad->method, "").error().message);
}
Result<void> SkinningSystem::setVisibility(std::span<const InstanceVisibility> instances) {
  return state_->scene.setVisibility(instances);
}
Result<bool> SkinningSystem::isDue(InstanceHandle instance) const {
  return state_->scene.isDue(instance);
}
std::uint64_t SkinningSystem::compact(std::uint64_t maxBytes) {
  return state_->scene.compact(maxBytes);
}

// -- Frames.

Result<std::span<const PlannedJob>> SkinningSystem::jobs(std::uint32_t verticesPerJob) {
  State& state = *state_;
  if (Result<void> gathered = state.books.gather(); !gathered) return gathered.error();
  for (const CopyCommand& move : state.books.moves()) {
    std::memcpy(state.output.data() + move.toOffset, state.output.data() + move.fromOffset,
                static_cast<std::size_t>(move.size));
  }
  const Work& work = state.books.work();
  state.placeInstances(work);
  state.tasks.clear();
  state.extents.clear();
  for (const std::uint32_t group : work.order)
    state.addGroup(work.groups[group], std::max(verticesPerJob, 1u));
  state.finishTasks();
  if (Result<void> committed = state.scene.commit(); !committed) return committed.error();
  state.isPlanned = true;
  return std::span<const PlannedJob>(state.jobs);
}

Result<void> SkinningSystem::abandonFrame() {
  if (Result<void> abandoned = state_->scene.abandonFrame(state_->frame); !abandoned)
    return abandoned;
  state_->isPlanned = false;
  state_->jobs.clear();
  return {};
}

TaskInstance SkinningSystem::State::taskInstance(const Work::Instance& instance,
                                                 const Group& group) {
  TaskInstance skinned;
  const ScenePose& pose = books.poses().at(instance.pose);
  skinned.pose = poseAt(SceneBooks::placeOf(pose));
  skinned.mayScale = pose.mayScale;
  skinned.restartsMotion = (instance.flags & abi::INSTANCE_RESTARTS) != 0;
  skinned.settles = (instance.flags & abi::INSTANCE_SETTLES) != 0;
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
                              instance.run->offsets[stream] -
                              std::size_t{key.firstVertex} * key.strides[stream];
  }
  return skinned;
}

/// The instances of all groups, each group's together.
void SkinningSystem::State::placeInstances(const Work& work) {
  instances.resize(work.instances.size());
  resultOf.assign(instances.size(), noResult);
  filled.assign(work.groups.size(), 0);
  for (const Work::Instance& instance : work.instances) {
    const std::uint32_t number = work.groupOf(instance);
    const Group& group = work.groups[number];
    const std::size_t place = group.firstInstance + std::size_t{filled[number]++};
    instances[place] = taskInstance(instance, group);
    if (instance.extras != nullptr && !instances[place].settles)
      resultOf[place] = instance.extras->result;
  }
}

void SkinningSystem::State::addGroup(const Group& group, std::uint64_t verticesPerJob) {
  const Variant& variant = group.variant;
  Task task;
  task.mesh = &dataOf(meshes.find(group.key.mesh)->second.mesh);
  task.method = variant.method;
  const std::array<std::uint32_t, streamCount>& strides = group.key.strides;
  task.places.motion = variant.motion;
  task.places.positions = {0, strides[0], variant.positions};
  task.places.normals = {0, strides[1], variant.normals};
  task.places.tangents = {0, strides[2], variant.tangents};
  task.places.previousPositions = {
      0, strides[3], variant.motion == Motion::none ? VertexFormat::none : variant.positions};
  task.firstVertex = group.key.firstVertex;
  task.vertexEnd = group.key.vertexEnd;
  addInstances(task, group.firstInstance, group.instances, verticesPerJob);
}

/// Adds `count` instances from `first` on, as tasks for some of them or for some of their vertices.
void SkinningSystem::State::addInstances(const Task& task, std::size_t first, std::size_t count,
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

void SkinningSystem::State::addTask(const Task& task, std::size_t first, std::size_t count) {
  tasks.push_back({task});
  extents.push_back({first, count});
}

/// Called after all tasks were added, when the vectors no longer reallocate.
void SkinningSystem::State::finishTasks() {
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
void SkinningSystem::State::readBackResults() {
  const std::uint64_t size = dermis::readBackResults + scene.buffer(BufferRole::results).size;
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
  static_cast<void>(scene.readBack(frame - 1, readBack).ok());  // the frame that was committed last
}

// -- Results.

std::span<const std::byte> SkinningSystem::outputBytes() const {
  return state_->output;
}
Result<InstanceOutput> SkinningSystem::output(InstanceHandle instance) const {
  return state_->scene.output(instance);
}
std::span<const InstanceHandle> SkinningSystem::skinnedInstances() const {
  return state_->scene.skinnedInstances();
}
std::span<const InstanceHandle> SkinningSystem::settledInstances() const {
  return state_->scene.settledInstances();
}
std::span<const InstanceHandle> SkinningSystem::movedInstances() const {
  return state_->scene.movedInstances();
}
Result<std::optional<Box>> SkinningSystem::bounds(InstanceHandle instance) const {
  return state_->scene.bounds(instance);
}
SceneStatistics SkinningSystem::statistics() const {
  return state_->scene.statistics();
}

}  // namespace dermis::cpu
