// The functions of a scene: the same for recorders, runners and commands.
#include "convert.h"

using namespace dermis;
using namespace dermis::c;

namespace {

void convertList(std::span<const InstanceHandle> from, std::vector<dermis_instance>& to) {
  to.clear();
  for (const InstanceHandle instance : from) to.push_back(handleTo<dermis_instance>(instance));
}

/// Appends handles up to the first that is wrong, and returns what is wrong with it.
template <typename CHandle, typename CppHandle>
std::optional<Failure> appendHandles(std::span<const CHandle> from, std::vector<CppHandle>& to) {
  try {
    for (const CHandle& handle : from) to.push_back(handleOf(handle));
  } catch (Failure& failure) {
    return std::move(failure);
  }
  return std::nullopt;
}

InstanceChange changeOf(const dermis_change& change) {
  InstanceChange result;
  const auto has = [&](std::uint32_t bit) { return (change.what & bit) != 0; };
  if (change.what >= DERMIS_CHANGE_TELEPORT * 2u) fail("`what` has a bit that has no meaning");
  result.instance = handleOf(change.instance);
  if (has(DERMIS_CHANGE_VISIBLE)) result.visible = change.visible != 0;
  if (has(DERMIS_CHANGE_UPDATE_INTERVAL))
    result.updateInterval = change.update_interval == 0 ? 1 : change.update_interval;
  if (has(DERMIS_CHANGE_MESH)) result.mesh = handleOf(change.mesh);
  if (has(DERMIS_CHANGE_POSE)) result.pose = handleOf(change.pose);
  if (has(DERMIS_CHANGE_METHOD)) result.method = methodOf(change.method);
  if (has(DERMIS_CHANGE_BOX)) result.box = boxOf(change.box);
  if (has(DERMIS_CHANGE_MORPHS)) result.morphs = morphsOf(change.morphs, change.morph_count);
  result.teleports = has(DERMIS_CHANGE_TELEPORT);
  return result;
}

dermis_store storeOf(const SceneStatistics::Store& store) {
  return {store.capacity, store.used, store.largestFree};
}

/// Gets memory of poses in this frame. From the one that fails on, pointers and counts are 0.
template <typename Memory, typename Element>
void getMemory(Scene& scene, Result<std::span<Memory>> (Scene::*write)(PoseHandle),
               std::span<const dermis_pose> poses, std::span<Element*> results,
               std::uint32_t* counts) {
  std::ranges::fill(results, nullptr);
  if (counts != nullptr) std::fill_n(counts, poses.size(), 0);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::span<Memory> memory = must((scene.*write)(handleOf(poses[i])));
    results[i] = reinterpret_cast<Element*>(memory.data());
    if (counts != nullptr) counts[i] = static_cast<std::uint32_t>(memory.size());
  }
}

}  // namespace

extern "C" {

dermis_code dermis_add_mesh(dermis_scene* scene, const dermis_packed* packed, dermis_mesh* mesh,
                            dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    const PackedMesh& added = required(packed, "packed").mesh;
    dermis_mesh& result = required(mesh, "mesh");
    result = handleTo<dermis_mesh>(must(target.addMesh(added)));
  });
}

dermis_code dermis_remove_mesh(dermis_scene* scene, dermis_mesh mesh, dermis_error* error) {
  return guarded(error, [&] { must(changedScene(scene).removeMesh(handleOf(mesh))); });
}

dermis_code dermis_add_poses(dermis_scene* scene, const dermis_pose_desc* callers, uint32_t count,
                             dermis_pose* poses, dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    const dermis_pose_desc desc = in(callers, "desc");
    const std::span<dermis_pose> results = array(poses, count, "poses");
    std::vector<PoseHandle> added(count);
    must(target.addPoses(added, desc.joint_count,
                         {desc.written_by_gpu != 0, promiseOf(desc.promise), handleOf(desc.rig)}));
    for (std::size_t i = 0; i < added.size(); ++i) results[i] = handleTo<dermis_pose>(added[i]);
  });
}

dermis_code dermis_remove_pose(dermis_scene* scene, dermis_pose pose, dermis_error* error) {
  return guarded(error, [&] { must(changedScene(scene).removePose(handleOf(pose))); });
}

dermis_code dermis_add_instance(dermis_scene* scene, const dermis_instance_desc* desc,
                                dermis_instance* instance, dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    const InstanceDescription description = instanceOf(in(desc, "desc"));
    dermis_instance& result = required(instance, "instance");
    result = handleTo<dermis_instance>(must(target.addInstance(description)));
  });
}

dermis_code dermis_remove_instance(dermis_scene* scene, dermis_instance instance,
                                   dermis_error* error) {
  return guarded(error, [&] { must(changedScene(scene).removeInstance(handleOf(instance))); });
}

dermis_code dermis_begin_frame(dermis_scene* scene, uint64_t frame, uint64_t completed_frame,
                               dermis_error* error) {
  return guarded(error, [&] { must(changedScene(scene).beginFrame(frame, completed_frame)); });
}

dermis_code dermis_write_poses(dermis_scene* scene, const dermis_pose* poses, uint32_t count,
                               dermis_joint** joints, uint32_t* joint_counts, dermis_error* error) {
  return guarded(error, [&] {
    getMemory(changedScene(scene), &Scene::writePose, array(poses, count, "poses"),
              array(joints, count, "joints"), joint_counts);
  });
}

dermis_code dermis_write_pose_weights(dermis_scene* scene, const dermis_pose* poses, uint32_t count,
                                      float** weights, uint32_t* weight_counts,
                                      dermis_error* error) {
  return guarded(error, [&] {
    getMemory(changedScene(scene), &Scene::writePoseWeights, array(poses, count, "poses"),
              array(weights, count, "weights"), weight_counts);
  });
}

dermis_code dermis_mark_written(dermis_scene* scene, const dermis_pose* poses, uint32_t count,
                                dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    std::vector<PoseHandle> handles;
    const auto failure = appendHandles(array(poses, count, "poses"), handles);
    must(target.markWritten(handles));
    if (failure) throw *failure;
  });
}

dermis_code dermis_mark_morphs_written(dermis_scene* scene, const dermis_instance* instances,
                                       uint32_t count, dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    std::vector<InstanceHandle> handles;
    const auto failure = appendHandles(array(instances, count, "instances"), handles);
    must(target.markMorphsWritten(handles));
    if (failure) throw *failure;
  });
}

dermis_code dermis_change_instances(dermis_scene* scene, const dermis_change* changes,
                                    uint32_t count, dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    std::vector<InstanceChange> converted;
    std::optional<Failure> failure;
    for (const dermis_change& change : inArray(changes, count, "changes")) {
      try {
        converted.push_back(changeOf(change));
      } catch (Failure& first) {  // the changes before it are applied
        first.message.insert(0, "change " + std::to_string(converted.size()) + ": ");
        failure = std::move(first);
        break;
      }
    }
    must(target.change(converted));
    if (failure) throw *failure;
  });
}

dermis_code dermis_compact(dermis_scene* scene, uint64_t max_bytes, uint64_t* moved,
                           dermis_error* error) {
  return guarded(error, [&] {
    const std::uint64_t bytes = changedScene(scene).compact(max_bytes);
    if (moved != nullptr) *moved = bytes;
  });
}

dermis_code dermis_abandon_frame(dermis_scene* scene, uint64_t frame, dermis_error* error) {
  return guarded(error, [&] { must(changedScene(scene).abandonFrame(frame)); });
}

dermis_code dermis_instance_contents(const dermis_scene* scene, dermis_instance instance,
                                     dermis_instance_info* info, dermis_error* error) {
  return guarded(error, [&] {
    const Scene& source = sceneOf(scene);
    checkOut(info, "info");
    const InstanceHandle handle = handleOf(instance);
    const InstanceOutput output = must(source.output(handle));
    dermis_instance_info result{};
    result.is_written = output.isWritten ? 1 : 0;
    result.is_due = must(source.isDue(handle)) ? 1 : 0;
    result.visibility_index = must(source.visibilityIndex(handle));
    result.mesh = handleTo<dermis_mesh>(output.mesh);
    result.offset = output.offset;
    result.places = placesOf(output.places);
    result.interpolation = output.interpolation;
    result.motion_scale = output.motionScale;
    if (const std::optional<Box> bounds = must(source.bounds(handle))) {
      result.has_bounds = 1;
      result.bounds = boxOf(*bounds);
    }
    give(info, result);
  });
}

dermis_code dermis_indexed_draws(const dermis_scene* scene, const dermis_instance* instances,
                                 uint32_t count, const dermis_index_range* ranges,
                                 uint32_t range_count, dermis_indexed_draw* draws,
                                 dermis_error* error) {
  static_assert(sizeof(dermis_index_range) == sizeof(IndexRange));
  static_assert(sizeof(dermis_indexed_draw) == sizeof(IndexedDraw));
  return guarded(error, [&] {
    const Scene& source = sceneOf(scene);
    std::vector<InstanceHandle> handles;
    for (const dermis_instance& instance : array(instances, count, "instances"))
      handles.push_back(handleOf(instance));
    array(ranges, range_count, "ranges");
    array(draws, count, "draws");
    // The outputs stay as they are if one of the instances is refused.
    std::vector<IndexedDraw> filled(count);
    must(source.indexedDraws(handles, {reinterpret_cast<const IndexRange*>(ranges), range_count},
                             filled));
    if (count != 0) std::memcpy(draws, filled.data(), count * sizeof(IndexedDraw));
  });
}

dermis_code dermis_scene_contents(dermis_scene* scene, dermis_scene_info* info,
                                  dermis_error* error) {
  return guarded(error, [&] {
    const Scene& source = sceneOf(scene);
    checkOut(info, "info");
    convertList(source.skinnedInstances(), scene->skinned);
    convertList(source.settledInstances(), scene->settled);
    const SceneStatistics statistics = source.statistics();
    const SceneStatistics::Frame& frame = statistics.lastFrame;
    const SceneStatistics::Culling& culling = statistics.lastCompletedFrame;
    dermis_scene_info result{};
    result.instances = frame.instances;
    result.frame = source.frame();
    result.skinned = scene->skinned.data();
    result.settled = scene->settled.data();
    result.skinned_count = static_cast<std::uint32_t>(scene->skinned.size());
    result.settled_count = static_cast<std::uint32_t>(scene->settled.size());
    result.converted_poses = frame.convertedPoses;
    result.sampled_figures = frame.sampledFigures;
    result.visibility_count = source.visibilityCount();
    result.skinned_vertices = frame.skinnedVertices;
    result.written_bytes = frame.writtenBytes;
    result.moved_bytes = frame.movedBytes;
    result.pose_bytes = frame.poseBytes;
    result.culled_candidates = frame.culledCandidates;
    result.completed_frame = culling.frame;
    result.gpu_visible = culling.visibleInstances;
    result.gpu_skinned = culling.skinnedInstances;
    result.gpu_settled = culling.settledInstances;
    result.meshes = storeOf(statistics.meshes);
    result.palettes = storeOf(statistics.palettes);
    result.outputs = storeOf(statistics.outputs);
    give(info, result);
  });
}

}  // extern "C"
