// Structures of the C interface as those of C++, and back.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dermis/dermis.h"
#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/rig.h"
#include "dermis/scene.h"
#include "object.h"

namespace dermis::c {

Method methodOf(const dermis_method& method);
VertexLayout layoutOf(const dermis_layout& layout);
JointPromise promiseOf(const dermis_promise& promise);
Box boxOf(const dermis_box& box);
dermis_box boxOf(const Box& box);
VertexPlaces placesOf(const dermis_places& places);
dermis_places placesOf(const VertexPlaces& places);

/// Both have the same bytes.
std::span<const MorphWeight> morphsOf(const dermis_morph_weight* morphs, std::uint32_t count);
std::span<const JointMatrix> jointsOf(const dermis_joint* joints, std::uint32_t count,
                                      const char* name);

/// The kinds of handles.
enum class Kind : std::uint32_t {
  mesh = 1,
  pose = 2,
  instance = 3,
  clips = 4,
  figure = 5,
  rig = 6
};
constexpr Kind kindOf(const dermis_mesh&) {
  return Kind::mesh;
}
constexpr Kind kindOf(const dermis_pose&) {
  return Kind::pose;
}
constexpr Kind kindOf(const dermis_instance&) {
  return Kind::instance;
}
constexpr Kind kindOf(const dermis_clips&) {
  return Kind::clips;
}
constexpr Kind kindOf(const dermis_figure&) {
  return Kind::figure;
}
constexpr Kind kindOf(const dermis_rig&) {
  return Kind::rig;
}
void checkKind(std::uint32_t kind, Kind wanted, const char* name);

/// Fails if it is of another kind. Whether it is valid is for the scene to say.
template <typename CppHandle, typename CHandle>
CppHandle handleOf(const CHandle& handle, const char* name) {
  if (handle.kind == 0 && handle.generation == 0) return {};
  checkKind(handle.kind, kindOf(handle), name);
  return {handle.index, handle.generation};
}
inline MeshHandle handleOf(const dermis_mesh& mesh) {
  return handleOf<MeshHandle>(mesh, "mesh");
}
inline PoseHandle handleOf(const dermis_pose& pose) {
  return handleOf<PoseHandle>(pose, "pose");
}
inline InstanceHandle handleOf(const dermis_instance& instance) {
  return handleOf<InstanceHandle>(instance, "instance");
}
inline ClipsHandle handleOf(const dermis_clips& clips) {
  return handleOf<ClipsHandle>(clips, "clips");
}
inline FigureHandle handleOf(const dermis_figure& figure) {
  return handleOf<FigureHandle>(figure, "figure");
}
inline RigHandle handleOf(const dermis_rig& rig) {
  return handleOf<RigHandle>(rig, "rig");
}
template <typename CHandle, typename CppHandle>
CHandle handleTo(const CppHandle& handle) {
  if (!handle) return {};
  return {static_cast<std::uint32_t>(kindOf(CHandle{})), handle.index, handle.generation};
}

/// A view of a mesh, with the lists that it points to.
struct View {
  explicit View(const dermis_mesh_view* mesh);
  View(const View&) = delete;
  View& operator=(const View&) = delete;

  MeshView mesh;

 private:
  std::vector<InfluenceSet> influenceSets_;
  std::vector<MorphTargetView> morphTargets_;
};

/// A view of a mesh of Dermis for the caller.
struct ViewForCaller {
  explicit ViewForCaller(const MeshView& mesh);
  ViewForCaller(const ViewForCaller&) = delete;
  ViewForCaller& operator=(const ViewForCaller&) = delete;

  dermis_mesh_view mesh{};

 private:
  std::string name_;
  std::vector<dermis_influence_set> influenceSets_;
  std::vector<dermis_morph_target> morphTargets_;
};

MeshInfo infoOf(const dermis_packed_info& info);
SceneDescription sceneOf(const dermis_scene_desc* desc);
InstanceDescription instanceOf(const dermis_instance_desc& desc);
DeviceLimits limitsOf(const dermis_limits* limits);
Tuning tuningOf(const dermis_tuning* tuning);
dermis_requirement requirementOf(const BufferRequirement& requirement);
dermis_part partOf(const BufferPart& part);

/// Commands for the caller, with the lists that they point to. Uploads point to the bytes of the
/// plan that they were made from.
struct CommandList {
  void fill(std::span<const Command> commands);

  std::vector<dermis_command> commands;

 private:
  std::vector<dermis_binding> bindings_;
};

}  // namespace dermis::c

// ---- Objects that several files use.

struct dermis_recorder;

/// A scene of a recorder, a runner or commands.
struct dermis_scene : dermis::c::Object {
  dermis_scene() { isLent = true; }

  dermis::Scene* scene = nullptr;
  const dermis_recorder* recorder = nullptr;      ///< whose scene it is, or null
  std::uint64_t changes = 0;                      ///< calls of functions that may change it
  std::vector<dermis_instance> skinned, settled;  ///< of `dermis_scene_contents`
};

struct dermis_packed : dermis::c::Object {
  explicit dermis_packed(dermis::PackedMesh made) : mesh(std::move(made)) {}

  dermis::PackedMesh mesh;
};

struct dermis_joint_bounds : dermis::c::Object {
  explicit dermis_joint_bounds(dermis::JointBounds made) : bounds(std::move(made)) {}

  dermis::JointBounds bounds;
};

struct dermis_packed_rig : dermis::c::Object {
  explicit dermis_packed_rig(dermis::PackedRig made) : rig(std::move(made)) {}

  dermis::PackedRig rig;
};

struct dermis_repaired : dermis::c::Object {
  explicit dermis_repaired(dermis::RepairedMesh made) : mesh(std::move(made)), view(mesh.view()) {}

  dermis::RepairedMesh mesh;
  dermis::c::ViewForCaller view;
};

struct dermis_plan : dermis::c::Object {
  dermis::Plan plan;
  dermis::c::CommandList list;
  std::vector<std::uint64_t> pipelines;
  std::uint64_t firstResult = 0;
};

namespace dermis::c {

inline const Scene& sceneOf(const dermis_scene* scene) {
  return *required(scene, "scene").scene;
}
/// For a function that may change the scene.
inline Scene& changedScene(dermis_scene* scene) {
  ++required(scene, "scene").changes;
  return *scene->scene;
}
/// What instances like this one need. Without a scene, or with null handles: any mesh and pose.
PipelineNeeds needsOf(const dermis_scene* scene, const dermis_instance_desc* desc);

}  // namespace dermis::c
