// How a scene is made, and what its functions have in common.

#include "dermis/scene.h"

#include <algorithm>
#include <string>
#include <utility>

#include "plan/check.h"
#include "scene/books.h"

namespace dermis {
namespace {

/// Rounds down if the next multiple does not fit 64 bits.
std::uint64_t roundUp(std::uint64_t value, std::uint64_t multiple) {
  const std::uint64_t up = value % multiple == 0 ? 0 : multiple - value % multiple;
  return up <= ~value ? value + up : value / multiple * multiple;
}

/// Initial palette units: dual quaternions and scale of every joint, and a status for every two
/// joints, limited to a storage buffer range.
std::uint64_t firstUnits(const SceneSetup& setup) {
  const SceneDescription& scene = setup.scene;
  return std::min((scene.jointCapacity.initial + scene.gpuJointCapacity.initial) * 5,
                  setup.limits.maxStorageBufferRange / unitBytes);
}

/// Whose history is in one storage buffer range.
std::uint64_t mostInstances(std::uint64_t range) {
  return (range - historyRecords) / sizeof(abi::HistoryRecord);
}

/// With maxima that buffers can have.
SceneDescription limited(SceneDescription scene, std::uint64_t range) {
  constexpr std::uint64_t mostIndices = 0xffffffff;
  const auto limit = [](Capacity& capacity, std::uint64_t most) {
    capacity.maximum = std::min(capacity.maximum, most);
  };
  limit(scene.meshCapacity, range / packedMeshAlignment * packedMeshAlignment);
  limit(scene.jointCapacity, mostIndices);
  limit(scene.gpuJointCapacity, mostIndices);
  // Small enough that sums do not overflow.
  limit(scene.outputCapacity, std::uint64_t{1} << 60);
  limit(scene.instanceCapacity, mostInstances(range));
  limit(scene.boundsCapacity, range / sizeof(InstanceResult));
  return scene;
}

}  // namespace

Result<void> checkSetup(const SceneSetup& setup) {
  const SceneDescription& description = setup.scene;
  if (description.framesInFlight == 0)
    return invalid("the scene's framesInFlight is 0; the minimum is 1");
  if (Result<void> good = checkLimits(setup.limits); !good) return good;
  const std::uint64_t range = setup.limits.maxStorageBufferRange;
  constexpr std::uint64_t anySize = ~std::uint64_t{0};
  struct Field {
    const char* name;
    const Capacity& capacity;
    std::uint64_t most;  ///< at first
    bool mayBeNone = false;
  };
  for (const Field& field :
       {Field{"meshCapacity", description.meshCapacity, range},
        {"jointCapacity (for each of framesInFlight)", description.jointCapacity,
         range / sizeof(JointMatrix) / description.framesInFlight, true},
        {"gpuJointCapacity", description.gpuJointCapacity, range / sizeof(JointMatrix), true},
        {"outputCapacity", description.outputCapacity, anySize},
        {"instanceCapacity", description.instanceCapacity, mostInstances(range)},
        {"boundsCapacity", description.boundsCapacity, range / sizeof(InstanceResult), true}}) {
    const Capacity& capacity = field.capacity;
    if (capacity.maximum == 0 && !field.mayBeNone)
      return invalid(std::string("the scene's ") + field.name + " has a maximum of 0");
    if (capacity.maximum < capacity.initial) {
      return invalid(std::string("the scene's ") + field.name + " is " +
                     std::to_string(capacity.initial) + " initially, more than its maximum of " +
                     std::to_string(capacity.maximum));
    }
    if (capacity.initial <= field.most) continue;
    return Error{
        ErrorCode::limitExceeded,
        std::string("the scene's ") + field.name + " of " + std::to_string(capacity.initial) +
            " needs a buffer larger than this device's storage buffer range of " +
            std::to_string(range) + " bytes; the maximum is " + std::to_string(field.most)};
  }
  const std::uint32_t alignment = outputRangeAlignment(setup.limits);
  if (setup.outputOffset % alignment != 0)
    return notAMultiple("the scene's outputOffset", setup.outputOffset, alignment);
  if (setup.outputOffset > anySize / 2) {
    return invalid("the scene's outputOffset of " + std::to_string(setup.outputOffset) +
                   " is larger than the maximum, " + std::to_string(anySize / 2));
  }
  return checkTuning(setup.tuning);
}

SceneSetup rounded(SceneSetup setup) {
  const auto round = [](Capacity& capacity, std::uint64_t multiple) {
    if (capacity.maximum < capacity.initial) return;  // to be refused
    capacity.initial = roundUp(capacity.initial, multiple);
    capacity.maximum = std::max(capacity.maximum / multiple * multiple, capacity.initial);
  };
  round(setup.scene.meshCapacity, packedMeshAlignment);
  round(setup.scene.outputCapacity, 4);
  // There are no results.
  if (setup.limits.maxStorageBuffersPerStage < storageBuffersWanted)
    setup.scene.boundsCapacity = Capacity::fixed(0);
  return setup;
}

PlanSizes sceneSizes(const SceneSetup& setup) {
  const SceneDescription& scene = setup.scene;
  PlanSizes sizes;
  sizes.meshes = scene.meshCapacity.initial;
  sizes.poses = scene.jointCapacity.initial * scene.framesInFlight * sizeof(JointMatrix);
  sizes.gpuPoses = scene.gpuJointCapacity.initial * sizeof(JointMatrix);
  sizes.palettes = firstUnits(setup) * unitBytes;
  sizes.results = static_cast<std::uint32_t>(scene.boundsCapacity.initial);
  sizes.outputs.fill(scene.outputCapacity.initial);
  sizes.isScene = true;
  sizes.slots = static_cast<std::uint32_t>(scene.instanceCapacity.initial);
  return sizes;
}

SceneBooks::SceneBooks(const SceneSetup& setup, const SceneOwner& owner)
    : owner_(owner),
      description_(limited(setup.scene, setup.limits.maxStorageBufferRange)),
      limits_(setup.limits),
      tuning_(setup.tuning),
      meshStore_{BufferRole::meshes, description_.meshCapacity},
      unitStore_{BufferRole::palettes,
                 {firstUnits(setup), setup.limits.maxStorageBufferRange / unitBytes},
                 unitBytes},
      outputStore_{BufferRole::positions, description_.outputCapacity, 1, setup.outputOffset},
      resultStore_{BufferRole::results, description_.boundsCapacity, sizeof(InstanceResult)},
      slotCapacity_(description_.instanceCapacity.initial),
      readBacks_(description_.framesInFlight) {}

Result<std::unique_ptr<Scene>> SceneAccess::create(const SceneSetup& setup,
                                                   const SceneOwner& owner) {
  const SceneSetup usual = rounded(setup);
  if (Result<void> good = checkSetup(usual); !good) return good.error();
  auto books = std::make_unique<SceneBooks>(usual, owner);
  if (Result<void> made = books->createFirstBuffers(); !made) return made.error();
  return std::unique_ptr<Scene>(new Scene(std::move(books)));
}

Scene::Scene(std::unique_ptr<SceneBooks> books) : books_(std::move(books)) {}
Scene::~Scene() = default;

const SceneDescription& Scene::description() const {
  return books_->description_;
}
std::uint64_t Scene::frame() const {
  return books_->frame_;
}

/// The current plan can no longer be committed.
SceneBooks& Scene::changed() {
  books_->isPlanned_ = false;
  return *books_;
}

Result<PipelineNeeds> Scene::pipelineNeeds(const InstanceDescription& description) const {
  PipelineNeeds needs{
      .method = description.method,
      .layout = description.layout,
      .bounds = description.bounds,
      .culledOnGpu = description.culledOnGpu,
      .figures = !description.pose && books_->figures_.size() != 0,
      .morphsOnGpu = description.morphWriter != MorphWriter::cpu || description.drivenTargets != 0,
      .rigs = !description.pose && books_->rigs_.size() != 0};
  if (description.morphWriter > MorphWriter::clips)
    return notAValue("the instance: its morphWriter", description.morphWriter, "MorphWriter");
  if (description.mesh) {
    const SceneMesh* mesh = books_->meshes_.find(description.mesh);
    if (mesh == nullptr) return unknownHandle("mesh", description.mesh);
    needs.mesh = mesh->info;
  }
  if (description.pose) {
    const ScenePose* pose = books_->poses_.find(description.pose);
    if (pose == nullptr) return unknownHandle("pose", description.pose);
    needs.promise = pose->promise;
    needs.figures = pose->figure != notUsed;
    // A figure is sampled as a whole, and its rigs are evaluated with it.
    needs.rigs =
        pose->figure == notUsed
            ? pose->rig != notUsed
            : std::ranges::any_of(books_->figures_.at(pose->figure).poses, [this](PoseHandle own) {
                return books_->poses_.at(own.index).rig != notUsed;
              });
  }
  if (const Result<VertexPlaces> good = checkNeeds(needs); !good) return good.error();
  return needs;
}

std::span<const InstanceHandle> Scene::skinnedInstances() const {
  return books_->skinned_;
}
std::span<const InstanceHandle> Scene::settledInstances() const {
  return books_->settled_;
}
Result<std::uint32_t> Scene::visibilityIndex(InstanceHandle instance) const {
  if (books_->instances_.find(instance) == nullptr) return unknownHandle("instance", instance);
  return instance.index;
}
std::uint32_t Scene::visibilityCount() const {
  return static_cast<std::uint32_t>(books_->slotCapacity_);
}

}  // namespace dermis
