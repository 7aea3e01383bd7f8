// What a frame has to do, and what is done when it has been recorded.

#include <algorithm>

#include "system/scene.h"

namespace dermis {
namespace {

std::uint32_t culledFlags(const SceneInstance& instance) {
  std::uint32_t flags = instance.extras.result != notUsed ? abi::INSTANCE_HAS_RESULT : 0u;
  if (instance.hasMotion) {
    flags |= abi::INSTANCE_HAS_MOTION;
    if (instance.restartVersion == instance.version) flags |= abi::INSTANCE_RESTARTS;
  }
  return flags;
}

}  // namespace

/// In frames that are the same for all instances of a palette with one interval, also where the
/// engine leaves frames out: a multiple of the interval lies between the last record and this one.
bool Scene::isDue(const SceneInstance& instance) const {
  const bool cameBack = instance.visibleFrom == record_ + 1;
  if (instance.isUrgent || cameBack || instance.updateInterval == 1) return true;
  const std::uint64_t beat = instance.palette;
  return (frame_ + beat) / instance.updateInterval !=
         (recordedFrame_ + beat) / instance.updateInterval;
}

std::uint32_t Scene::paletteUnit(const SceneInstance& instance) const {
  const ScenePalette& palette = palettes_.at(instance.palette);
  const std::optional<PaletteForm> form = paletteForm(instance.method);
  const std::uint64_t unit = form ? palette.forms[static_cast<std::size_t>(*form)].units->offset
                                  : poseOffset(palette) / unitBytes;
  return static_cast<std::uint32_t>(unit);
}

/// Once for all instances that read it, and only where one does.
void Scene::convertPalette(const SceneInstance& instance) {
  const std::optional<PaletteForm> form = paletteForm(instance.method);
  if (!form) return;
  ScenePalette& palette = palettes_.at(instance.palette);
  ScenePalette::Form& converted = palette.forms[static_cast<std::size_t>(*form)];
  if (converted.version == palette.version || converted.plannedIn == planNumber_) return;
  converted.plannedIn = planNumber_;
  conversions_.push_back({instance.palette, static_cast<std::size_t>(*form)});
  builder_.addPalette(static_cast<std::uint32_t>(poseOffset(palette) / unitBytes),
                      static_cast<std::uint32_t>(converted.units->offset), palette.jointCount,
                      *form, palette.mayScale);
}

void Scene::addRuns(const SceneInstance& instance, std::uint32_t flags,
                    const Candidate* candidate) {
  const InstanceExtras* extras = instance.extras.isNeeded() ? &instance.extras : nullptr;
  const std::uint32_t palette = paletteUnit(instance);
  const auto add = [&](const PlacedRun& run) {
    if (candidate != nullptr) {
      builder_.addCulled(run, palette, flags, extras, *candidate);
    } else {
      builder_.add(run, palette, flags, extras);
    }
  };
  add(instance.run);
  for (const PlacedRun& run : instance.furtherRuns) add(run);
}

void Scene::gatherPoses() {
  for (const PaletteHandle handle : posed_) {
    const ScenePalette* palette = palettes_.find(handle);
    if (palette == nullptr) continue;
    for (std::uint32_t index = palette->firstInstance; index != notUsed;
         index = instances_.at(index).nextOfPalette)
      makeStale(index);
  }
  posed_.clear();
}

void Scene::addDue(std::uint32_t index) {
  SceneInstance& instance = instances_.at(index);
  instance.plannedIn = planNumber_;
  due_.push_back(index);
  convertPalette(instance);
  const bool restarts = instance.restartsMotion || instance.visibleFrom == record_ + 1;
  instance.willMove = instance.hasMotion && !restarts;
  addRuns(instance, instance.hasMotion && restarts ? abi::INSTANCE_RESTARTS : 0u, nullptr);
  if (instance.extras.result != notUsed) {
    builder_.clearResult(instance.extras.result);
    plannedResults_.push_back(instance.extras.result);
  }
  plannedVertices_ += instance.vertexCount;
  plannedBytes_ += std::uint64_t{instance.vertexCount} * attributeBytes(instance.layout);
}

/// Those that have to wait stay in the list; so do those that are due, until `commit`.
void Scene::gatherPending() {
  std::size_t kept = 0;
  for (std::size_t entry = 0; entry < pending_.size(); ++entry) {
    const InstanceHandle handle = pending_[entry];
    SceneInstance* instance = instances_.find(handle);
    if (instance == nullptr) continue;
    if (!instance->isStale || !instance->isVisible) {
      instance->isListed = false;
      continue;
    }
    if (isDue(*instance)) addDue(handle.index);
    pending_[kept++] = handle;
  }
  pending_.resize(kept);
}

/// What moved when it was last displayed and is displayed without being skinned rests: its previous
/// positions become the current ones. What leaves the view is left alone; mostly it is skinned when
/// it returns.
void Scene::gatherSettling() {
  for (const InstanceHandle handle : moving_) {
    const SceneInstance* instance = instances_.find(handle);
    if (instance == nullptr || instance->plannedIn == planNumber_ || !instance->isVisible) continue;
    settling_.push_back(handle.index);
    addRuns(*instance, abi::INSTANCE_SETTLES, nullptr);
  }
}

/// All of them, in every frame: the CPU does not know which the GPU skinned.
void Scene::gatherCulled() {
  for (const std::uint32_t index : culled_) {
    SceneInstance& instance = instances_.at(index);
    if (!instance.isVisible) continue;
    if (instance.version == 0 || (instance.isStale && isDue(instance))) {
      instance.version = ++nextVersion_;
      if (instance.restartsMotion) instance.restartVersion = instance.version;
      versioned_.push_back(index);
    }
    // Nobody knows when the GPU will skin it for the first time; until then there is no box.
    if (instance.extras.result != notUsed) {
      if (instance.firstFrame == 0) builder_.clearResult(instance.extras.result);
      plannedResults_.push_back(instance.extras.result);
    }
    convertPalette(instance);
    const Candidate candidate{index, instance.version};
    addRuns(instance, culledFlags(instance), &candidate);
  }
}

void Scene::gatherMoves() {
  for (const InstanceHandle handle : shifting_) {
    const SceneInstance* instance = instances_.find(handle);
    if (instance == nullptr || !instance->shown || instance->shown->mesh != instance->target.mesh ||
        instance->shown == instance->target)
      continue;
    moves_.push_back({instance->shown->bytes.offset, instance->target.bytes.offset,
                      instance->target.bytes.size});
  }
}

Result<void> Scene::plan() {
  if (!hasBegun_) {
    return Error{ErrorCode::invalidArgument, "record comes once after each beginFrame"};
  }
  ++planNumber_;
  due_.clear();
  settling_.clear();
  versioned_.clear();
  conversions_.clear();
  moves_.clear();
  plannedResults_.clear();
  plannedVertices_ = plannedBytes_ = plannedPoseBytes_ = 0;
  const OutputSizes outputs = OutputSizes::oneBuffer(description_.outputBudget);
  builder_.begin(PlanData::of(plan_), groups_, description_.limits, description_.tuning,
                 {description_.meshBudget, description_.matricesSize(), description_.palettesSize(),
                  description_.boundsBudget, outputs});
  gatherPoses();
  gatherMoves();
  gatherPending();
  gatherSettling();
  gatherCulled();
  for (const Conversion& conversion : conversions_)
    plannedPoseBytes_ += palettes_.at(conversion.palette).jointCount * sizeof(JointMatrix);
  return builder_.finish();
}

/// Whether `target` has now been recorded, and so is shown.
bool Scene::commitShift(SceneInstance& instance, InstanceHandle handle) {
  const bool isMove = instance.shown && instance.shown->mesh == instance.target.mesh;
  if (!isMove && !instance.isCulled && instance.plannedIn != planNumber_) return false;
  if (instance.shown && instance.shown != instance.target) {
    retire(Retired::Store::output, instance.shown->bytes);
    moved_.push_back(handle);
  }
  instance.shown = instance.target;
  instance.isShifting = false;
  return true;
}

void Scene::commit() {
  ++record_;
  recordedFrame_ = frame_;
  hasBegun_ = false;
  skinned_.clear();
  settled_.clear();
  moved_.clear();
  moving_.clear();
  for (const Conversion& conversion : conversions_) {
    ScenePalette& palette = palettes_.at(conversion.palette);
    palette.forms[conversion.form].version = palette.version;
  }
  for (const std::uint32_t index : due_) {
    SceneInstance& instance = instances_.at(index);
    const InstanceHandle handle = instances_.handleOf(index);
    instance.isStale = instance.isListed = instance.isUrgent = instance.restartsMotion = false;
    if (instance.firstFrame == 0) instance.firstFrame = frame_;
    instance.isMoving = instance.willMove;
    if (instance.isMoving) moving_.push_back(handle);
    skinned_.push_back(handle);
  }
  std::erase_if(pending_,
                [this](InstanceHandle handle) { return !instances_.at(handle.index).isStale; });
  for (const std::uint32_t index : settling_) {
    instances_.at(index).isMoving = false;
    settled_.push_back(instances_.handleOf(index));
  }
  for (const std::uint32_t index : versioned_) {
    SceneInstance& instance = instances_.at(index);
    instance.isStale = instance.isUrgent = instance.restartsMotion = false;
    if (instance.firstFrame == 0) instance.firstFrame = frame_;
  }
  std::erase_if(shifting_, [this](InstanceHandle handle) {
    SceneInstance* instance = instances_.find(handle);
    return instance == nullptr || commitShift(*instance, handle);
  });
}

}  // namespace dermis
