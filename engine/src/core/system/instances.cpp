// Instances: how they are added, changed and removed.

#include <algorithm>

#include "system/errors.h"
#include "system/scene.h"

namespace dermis {
Result<InstanceHandle> Scene::addInstance(const InstanceDescription& description) {
  return insert(description, false);
}

Result<void> Scene::removeInstance(InstanceHandle handle) {
  SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr || instance->isInternal) return unknownHandle("instance", handle);
  unlink(handle.index);
  --meshes_.at(instance->mesh.index).users;
  retireTarget(*instance);
  releaseLastRuns(*instance);
  if (instance->shown) retire(Retired::Store::output, instance->shown->bytes);
  if (instance->extras.result != notUsed) freeResults_.push_back(instance->extras.result);
  if (instance->isCulled) {
    culled_[instance->culledIndex] = culled_.back();
    instances_.at(culled_.back()).culledIndex = instance->culledIndex;
    culled_.pop_back();
  }
  std::erase(waiting_, handle);
  const InstanceHandle bindPose = instance->bindPose;
  instances_.remove(handle);
  releaseBindPose(bindPose);
  return {};
}

/// Room for an instance that gets another mesh: where it is still shown with that mesh, that is it.
Result<bool> Scene::takeBackOrFindRoom(SceneInstance& changed) {
  if (!changed.shown || changed.shown->mesh != changed.mesh) return findRoom(changed);
  changed.target = changed.shown;
  changed.vertexCount = changed.shown->vertexCount;
  if (Result<void> made = makeRuns(changed); !made) return made.error();
  return true;
}

Result<void> Scene::setMesh(InstanceHandle handle, MeshHandle mesh) {
  SceneInstance* found = instances_.find(handle);
  if (found == nullptr || found->isInternal) return unknownHandle("instance", handle);
  if (found->mesh == mesh && meshes_.contains(mesh)) return {};
  SceneInstance changed = *found;
  changed.mesh = mesh;
  changed.furtherRuns.clear();
  changed.lastRuns.clear();
  changed.target.reset();
  if (const SceneMesh* to = meshes_.find(mesh);
      to != nullptr &&
      to->info.morphTargetCount != meshes_.at(found->mesh.index).info.morphTargetCount)
    changed.extras.morphs.clear();
  if (Result<void> good = check(changed); !good) return good;
  if (description_.overflow == OverflowPolicy::bindPose) {
    Result<InstanceHandle> bindPose = acquireBindPose(changed);
    if (!bindPose) return bindPose.error();
    changed.bindPose = *bindPose;
  }
  Result<bool> room = takeBackOrFindRoom(changed);
  if (room && !*room && description_.overflow == OverflowPolicy::refuse) room = noRoomFor(changed);
  if (!room) {
    if (description_.overflow == OverflowPolicy::bindPose) releaseBindPose(changed.bindPose);
    return room.error();
  }

  SceneInstance& instance = instances_.at(handle.index);  // a bind pose may have moved it
  --meshes_.at(instance.mesh.index).users;
  ++meshes_.at(mesh.index).users;
  releaseLastRuns(instance);
  if (!changed.target && instance.target && instance.shown == instance.target) {
    // It stays where it is, and may still have to settle.
    changed.lastRuns = instance.furtherRuns;
    changed.lastRuns.push_back(instance.run);
    instance.target.reset();
  } else {
    retireTarget(instance);
  }
  const InstanceHandle oldBindPose = instance.bindPose;
  // What came to stand beside it meanwhile stays.
  changed.nextOfPalette = instance.nextOfPalette;
  changed.previousOfPalette = instance.previousOfPalette;
  changed.restartsMotion = true;
  changed.isUrgent = true;
  instance = std::move(changed);
  std::erase(waiting_, handle);
  if (instance.target) {
    shifting_.push_back(handle);
  } else {
    waiting_.push_back(handle);
    instance.showsBindPose = static_cast<bool>(instance.bindPose);
    if (description_.overflow == OverflowPolicy::bindPose && instance.shown) {
      retire(Retired::Store::output, instance.shown->bytes);
      instance.shown.reset();
      releaseLastRuns(instance);
    }
  }
  if (description_.overflow == OverflowPolicy::bindPose) releaseBindPose(oldBindPose);
  makeStale(handle.index);
  return {};
}

std::uint64_t Scene::compact(std::uint64_t maxBytes) {
  std::vector<InstanceHandle> fromEnd;
  for (std::uint32_t index = 0; index < instances_.capacity(); ++index) {
    if (!instances_.isUsed(index)) continue;
    const SceneInstance& instance = instances_.at(index);
    if (instance.target && instance.shown == instance.target)
      fromEnd.push_back(instances_.handleOf(index));
  }
  const auto offsetOf = [this](InstanceHandle handle) {
    return instances_.at(handle.index).target->bytes.offset;
  };
  std::sort(fromEnd.begin(), fromEnd.end(),
            [&](InstanceHandle a, InstanceHandle b) { return offsetOf(a) > offsetOf(b); });
  std::uint64_t moved = 0;
  for (const InstanceHandle handle : fromEnd) {
    SceneInstance& instance = instances_.at(handle.index);
    const Range from = instance.target->bytes;
    if (moved + from.size > maxBytes) continue;
    const Result<LaidOutVertices> laidOut = layOut(instance.layout, instance.vertexCount);
    const std::optional<Range> to =
        outputStore_.allocateBelow(from.size, laidOut->alignment, from.offset);
    if (!to) continue;
    releaseRuns(instance);
    instance.target->bytes = *to;
    if (Result<void> made = makeRuns(instance); !made) {
      // A device with few storage buffers cannot have it there.
      outputStore_.free(*to);
      instance.target->bytes = from;
      made = makeRuns(instance);
      continue;
    }
    shifting_.push_back(handle);
    moved += from.size;
  }
  return moved;
}

Result<InstanceOutput> Scene::output(InstanceHandle handle) const {
  const SceneInstance* instance = instances_.find(handle);
  if (instance == nullptr || instance->isInternal) return unknownHandle("instance", handle);
  InstanceOutput output;
  const std::optional<Place>* place = &instance->shown;
  if (instance->shown) {
    output.state = instance->target ? OutputState::own : OutputState::last;
  } else if (const SceneInstance* bindPose = instances_.find(instance->bindPose);
             bindPose != nullptr && !instance->target && bindPose->shown) {
    output.state = OutputState::bindPose;
    place = &bindPose->shown;
  } else {
    return output;
  }
  const Result<LaidOutVertices> laidOut = layOut(instance->layout, (*place)->vertexCount);
  if (!laidOut) return laidOut.error();
  output.mesh = (*place)->mesh;
  output.offset = (*place)->bytes.offset;
  output.size = (*place)->bytes.size;
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
