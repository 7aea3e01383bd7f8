// Instances: how they are added, changed and removed.

#include <algorithm>

#include "system/errors.h"
#include "system/scene.h"

namespace dermis {

Result<InstanceHandle> Scene::addInstance(const InstanceDescription& description) {
  SceneInstance instance;
  instance.palette = description.palette.index;
  instance.updateInterval = description.updateInterval;
  instance.method = description.method;
  instance.isCulled = description.culledOnGpu;
  instance.hasMotion = description.layout.previousPositions;
  instance.mesh = description.mesh;
  instance.paletteHandle = description.palette;
  instance.layout = description.layout;
  instance.box = description.box;
  instance.bounds = description.bounds;
  if (Result<void> good = check(instance); !good) return good.error();
  if (instances_.capacity() >= description_.instanceBudget && !instances_.hasHole()) {
    return Error{ErrorCode::limitExceeded, "there are as many instances as the budget has, " +
                                               std::to_string(description_.instanceBudget)};
  }
  if (Result<void> good = reserveUnits(instance); !good) return good.error();
  instance.extras.box = instance.box;
  instance.extras.hasBox = isSnormPosition(instance.layout.positions);
  if (Result<void> taken = takeResult(instance); !taken) return taken.error();
  if (Result<void> found = findRoom(instance); !found) {
    if (instance.extras.result != notUsed) freeResults_.push_back(instance.extras.result);
    return found.error();
  }

  ++meshes_.at(instance.mesh.index).users;
  const InstanceHandle handle = instances_.add(std::move(instance));
  SceneInstance& added = instances_.at(handle.index);
  link(handle.index);
  if (added.isCulled) {
    added.culledIndex = static_cast<std::uint32_t>(culled_.size());
    culled_.push_back(handle.index);
  }
  shift(handle);
  makeStale(handle.index);
  return handle;
}

Result<void> Scene::removeInstance(InstanceHandle handle) {
  SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  unlink(handle.index);
  --meshes_.at(instance->mesh.index).users;
  releaseTarget(*instance);
  if (instance->shown) retire(Retired::Store::output, instance->shown->bytes);
  if (instance->extras.result != notUsed) freeResults_.push_back(instance->extras.result);
  if (instance->isCulled) {
    culled_[instance->culledIndex] = culled_.back();
    instances_.at(culled_.back()).culledIndex = instance->culledIndex;
    culled_.pop_back();
  }
  instances_.remove(handle);
  return {};
}

/// `target` has become another than `shown`; the next plan that skins or moves it makes up for it.
void Scene::shift(InstanceHandle handle) {
  SceneInstance& instance = instances_.at(handle.index);
  if (instance.isShifting) return;
  instance.isShifting = true;
  shifting_.push_back(handle);
}

/// Room for an instance that gets another mesh: if it is still shown with that mesh, it stays.
Result<void> Scene::takeBackOrFindRoom(SceneInstance& changed) {
  if (!changed.shown || changed.shown->mesh != changed.mesh) return findRoom(changed);
  changed.target = *changed.shown;
  changed.vertexCount = changed.shown->vertexCount;
  return makeRuns(changed);
}

Result<void> Scene::setMesh(InstanceHandle handle, MeshHandle mesh) {
  SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  if (instance->mesh == mesh && meshes_.contains(mesh)) return {};
  SceneInstance changed = *instance;
  changed.mesh = mesh;
  changed.furtherRuns.clear();
  if (const SceneMesh* to = meshes_.find(mesh);
      to != nullptr &&
      to->info.morphTargetCount != meshes_.at(instance->mesh.index).info.morphTargetCount)
    changed.extras.morphs.clear();
  if (Result<void> good = check(changed); !good) return good;
  if (Result<void> room = takeBackOrFindRoom(changed); !room) return room;

  --meshes_.at(instance->mesh.index).users;
  ++meshes_.at(mesh.index).users;
  releaseTarget(*instance);
  changed.restartsMotion = true;
  changed.isUrgent = true;
  *instance = std::move(changed);
  shift(handle);
  makeStale(handle.index);
  return {};
}

std::uint64_t Scene::compact(std::uint64_t maxBytes) {
  std::vector<InstanceHandle> fromEnd;
  for (std::uint32_t index = 0; index < instances_.capacity(); ++index) {
    if (!instances_.isUsed(index)) continue;
    const SceneInstance& instance = instances_.at(index);
    if (instance.shown == instance.target) fromEnd.push_back(instances_.handleOf(index));
  }
  const auto offsetOf = [this](InstanceHandle handle) {
    return instances_.at(handle.index).target.bytes.offset;
  };
  std::sort(fromEnd.begin(), fromEnd.end(),
            [&](InstanceHandle a, InstanceHandle b) { return offsetOf(a) > offsetOf(b); });
  std::uint64_t moved = 0;
  for (const InstanceHandle handle : fromEnd) {
    SceneInstance& instance = instances_.at(handle.index);
    const Range from = instance.target.bytes;
    if (moved + from.size > maxBytes) continue;
    const Result<LaidOutVertices> laidOut = layOut(instance.layout, instance.vertexCount);
    const std::optional<Range> to =
        outputStore_.allocateBelow(from.size, laidOut->alignment, from.offset);
    if (!to) continue;
    releaseRuns(instance);
    instance.target.bytes = *to;
    if (Result<void> made = makeRuns(instance); !made) {
      // A device with few storage buffers cannot have it there.
      outputStore_.free(*to);
      instance.target.bytes = from;
      made = makeRuns(instance);
      continue;
    }
    shift(handle);
    moved += from.size;
  }
  return moved;
}

Result<InstanceOutput> Scene::output(InstanceHandle handle) const {
  const SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr) return unknownHandle("instance", handle);
  InstanceOutput output;
  if (!instance->shown) return output;
  const Place& place = *instance->shown;
  const Result<LaidOutVertices> laidOut = layOut(instance->layout, place.vertexCount);
  if (!laidOut) return laidOut.error();
  output.mesh = place.mesh;
  output.offset = place.bytes.offset;
  output.size = place.bytes.size;
  std::array<OutputAttribute, streamCount> attributes = laidOut->attributes;
  for (OutputAttribute& attribute : attributes) {
    if (attribute.format != VertexFormat::none) attribute.offset += output.offset;
  }
  output.positions = attributes[0];
  output.normals = attributes[1];
  output.tangents = attributes[2];
  output.previousPositions = attributes[3];
  return output;
}

}  // namespace dermis
