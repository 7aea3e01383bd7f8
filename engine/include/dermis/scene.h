// The books of a scene: which meshes, poses and instances there are, where each stands in its
// buffer, and what a frame has to do. No Vulkan: `plan` makes a list of commands (plan.h).
// `vulkan::SkinningSystem` contains a Scene, and executes its commands on its own buffers. Calls
// that both have are documented here. An engine with its own RHI uses Scene directly:
//
//   scene.beginFrame(frame, completedFrame);
//   for each frame f that has become complete: scene.readBack(f, bytes of its read-back buffer);
//   write joint matrices at scene.writePose(pose)->offset of the poses buffer
//   ... add, remove, change ...
//   scene.plan(plan);
//   writeTables(plan, mapped upload buffer of this frame);
//   for (const Command& command : plan.commands()) ...
//   scene.commit();
//   draw from the output buffer at scene.output(instance)
//
// `buffer`, `poseBuffer` and `Plan::buffer` return size and usage of each buffer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "dermis/export.h"
#include "dermis/handle.h"
#include "dermis/layout.h"
#include "dermis/method.h"
#include "dermis/pack.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/types.h"

namespace dermis {

/// How much a buffer holds. It grows when something is added that does not fit.
struct Capacity {
  std::uint64_t initial = 0;
  std::uint64_t maximum = ~std::uint64_t{0};  ///< beyond it adding fails with `limitExceeded`

  /// It never grows.
  static constexpr Capacity fixed(std::uint64_t count) { return {count, count}; }
};

/// A buffer of a scene that is too small.
struct BufferGrowth {
  /// meshes, palettes, results, positions (the output). Or poses or gpuPoses: the scene gets one
  /// more buffer, since poses never move.
  BufferRole role = BufferRole::positions;
  BufferRequirement requirement;  ///< of the larger buffer, or of the one that is added
  std::uint32_t poseBuffer = 0;   ///< of poses, gpuPoses: its number
};

/// How an engine with its own RHI replaces a buffer by a larger one. Called by `addMesh`,
/// `addPose`, `addPoses`, `addInstance` and `change`. The new buffer gets the contents of the old
/// one (palettes need none) before the commands of the next plan; if that frame is abandoned, the
/// engine copies again with the next one. The old buffer stays until frames in flight are complete.
///
/// A scene asks for more than it needs at once. If that fails, it asks for the least that it needs.
/// If that fails too, the call of the scene fails with this error and adds nothing.
struct GrowthCallback {
  void* user = nullptr;
  /// Null: the initial capacities are the maximum.
  Result<void> (*grow)(void* user, const BufferGrowth& growth) = nullptr;
};

struct SceneDescription {
  /// Maximum frames that are recorded and not yet complete, including the one that is being
  /// recorded. 1 or more.
  std::uint32_t framesInFlight = 2;
  Capacity meshCapacity{64 << 10};  ///< bytes of packed meshes; at most a storage buffer range
  /// Joints that the buffers of poses hold which the CPU writes, and the GPU. The poses of one call
  /// stand in one buffer, so some joints of a buffer may stay unused.
  Capacity jointCapacity{256};
  Capacity gpuJointCapacity{0};
  /// Bytes of skinned vertices: `VertexPlaces::size` of each instance, and what is left between
  /// them. May be more than a storage buffer range. A maximum counts in whole words.
  Capacity outputCapacity{256 << 10};
  /// Where the output begins in its buffer: `InstanceOutput` counts from the beginning of the
  /// buffer, commands count from here. A multiple of the alignment that `buffer` tells, which need
  /// not be a power of two.
  std::uint64_t outputOffset = 0;
  Capacity instanceCapacity{256};  ///< live instances
  Capacity boundsCapacity{64};     ///< live instances with bounds or snorm16 positions
  /// Those of the device: `vulkan::Context::limits`, or an engine's own. With fewer storage buffers
  /// than `storageBuffersWanted`, as in the defaults here, `boundsCapacity` is taken for 0.
  DeviceLimits limits;
  Tuning tuning;
  GrowthCallback growth;
};

/// Who writes the joint matrices of a pose.
enum class PoseWriter : std::uint8_t {
  cpu,  ///< `writePose` gives memory for each frame
  gpu,  ///< a pass of the engine overwrites the last pose; `markWritten` says so
};

struct PoseOptions {
  PoseWriter writer = PoseWriter::cpu;
  bool mayScale = true;  ///< as `PoseDescription::mayScale`
};

/// One of the buffers that poses stand in.
struct PoseBuffer {
  PoseWriter writer = PoseWriter::cpu;
  BufferRequirement requirement;
};

/// One instance of a scene.
struct InstanceDescription {
  MeshHandle mesh = {};
  PoseHandle pose = {};  ///< Instances may share one: body, clothes, hair.
  Method method = Method::dualQuaternion;
  /// Formats and arrangement of the skinned vertices. With `Motion::kept`, previous positions are
  /// right on first frames, when poses rest or are skipped, and when an instance comes back into
  /// view; `InstanceChange::teleports` is for jumps. `Motion::reskinned` is not possible.
  VertexLayout layout = {};
  Box box = {};  ///< of positions in snorm16, as `Job::box`
  /// Whether to compute the exact box of the skinned positions, for `Scene::bounds`.
  bool bounds = false;
  /// The instance is skinned every N-th frame; N is at least 1. After a frame that was abandoned or
  /// left out it is skinned in the next one, if it was due in between. Instances with the same pose
  /// and interval are skinned in the same frames; poses are distributed over the frames. A
  /// teleport, another mesh and coming back into view take effect at once.
  std::uint32_t updateInterval = 1;
  /// The GPU decides whether the instance is skinned: its word in the visibility buffer is not 0.
  /// Its output must lie in one storage buffer range. An output of at most 1/32 of such a range
  /// always does. A longer one may not, where the output buffer is larger than one range: then
  /// `addInstance` and `change` fail with `limitExceeded`.
  bool culledOnGpu = false;
};

/// What changes about an instance: everything that has a value. The next `plan` skins an instance
/// that changes its mesh, pose, method or box, or teleports, whatever its interval.
struct InstanceChange {
  InstanceHandle instance = {};
  /// An invisible instance is neither skinned nor settled. When it becomes visible, its previous
  /// positions are its current ones. Instances begin visible.
  std::optional<bool> visible = {};
  bool teleports = false;  ///< previous positions become the current ones
  /// Motion goes on. `prepare` is needed for the method too, as in `pipelineNeeds`.
  std::optional<Method> method = {};
  std::optional<std::uint32_t> updateInterval = {};  ///< as `InstanceDescription::updateInterval`
  /// Another mesh (a level of detail): the output moves, motion restarts. Morph weights stay if
  /// both meshes have the same number of targets, otherwise they are removed.
  std::optional<MeshHandle> mesh = {};
  std::optional<PoseHandle> pose = {};  ///< motion goes on
  /// Of positions in snorm16. Motion restarts: previous positions would be relative to the old box.
  std::optional<Box> box = {};
  /// The active targets, as `Job::morphs`. They are copied.
  std::optional<std::span<const MorphWeight>> morphs = {};
};

/// Whether an instance is in view, and how often it is skinned: `InstanceChange::visible` and
/// `updateInterval`, both of them.
struct InstanceVisibility {
  InstanceHandle instance = {};
  bool isVisible = true;
  std::uint32_t updateInterval = 1;
};

/// What `prepare` must be given before such an instance is recorded, whatever its mesh and pose.
/// `Scene::pipelineNeeds` is for those that it has.
inline PipelineNeeds pipelineNeeds(const InstanceDescription& description) {
  return {.method = description.method,
          .layout = description.layout,
          .bounds = description.bounds,
          .culledOnGpu = description.culledOnGpu};
}

/// Where the vertices of an instance stand in the output buffer.
struct InstanceOutput {
  /// The mesh that the instance was last skinned with. After a change of mesh it is the old one
  /// until the instance is skinned again; of an instance that is culled on the GPU, until the next
  /// `commit`.
  MeshHandle mesh;
  /// Bytes from the beginning of the buffer. Interleaved: a multiple of the stride, so that a draw
  /// may use `firstVertex` instead of the offset of a vertex buffer.
  std::uint64_t offset = 0;
  std::uint64_t size = 0;  ///< bytes; 0: the instance has not been skinned yet
  /// Their offsets count from the beginning of the buffer.
  OutputAttribute positions, normals, tangents, previousPositions;
};

/// Bytes of one buffer of a scene.
struct StoreStatistics {
  std::uint64_t capacity = 0;
  std::uint64_t used = 0;         ///< including what frames in flight may still read
  std::uint64_t largestFree = 0;  ///< the longest free range
};

/// What a frame does, as of the last `commit`. Instances culled on the GPU count as candidates
/// only.
struct FrameWorkStatistics {
  std::uint64_t frame = 0;
  std::uint32_t instances = 0;  ///< in the scene
  std::uint32_t skinnedInstances = 0;
  std::uint32_t settledInstances = 0;  ///< only their previous positions were written
  std::uint32_t convertedPoses = 0;
  std::uint32_t culledCandidates = 0;  ///< instances given to the visibility kernel
  std::uint64_t skinnedVertices = 0;
  std::uint64_t writtenBytes = 0;  ///< of skinned vertices
  std::uint64_t movedBytes = 0;    ///< by `compact`
  std::uint64_t poseBytes = 0;     ///< joint matrices of the CPU's, read by the palette kernel
};

/// What the visibility kernel counted in a complete frame.
struct CullingStatistics {
  std::uint64_t frame = 0;
  std::uint32_t visibleInstances = 0;
  std::uint32_t skinnedInstances = 0;
  std::uint32_t settledInstances = 0;
  std::uint32_t workgroups = 0;  ///< of the indirect dispatches
};

struct SceneStatistics {
  FrameWorkStatistics lastFrame;
  CullingStatistics lastCompletedFrame;
  StoreStatistics meshes, palettes, outputs;
};

/// Where to write the joint matrices of a pose.
struct PosePlace {
  std::uint32_t poseBuffer = 0;
  std::uint64_t offset = 0;  ///< bytes into the pose buffer
  std::uint32_t jointCount = 0;
};

class SceneBooks;

/// Not thread-safe.
class DERMIS_CORE_API Scene {
 public:
  /// Fails with `invalidArgument` if a field makes no sense, and with `limitExceeded` if an initial
  /// capacity needs a buffer larger than a storage buffer range.
  static Result<Scene> create(const SceneDescription& description);
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  /// Size and usage of a buffer as it is now; for poses see `poseBuffer`. `GrowthCallback` is told
  /// when meshes, palettes, results or the output grow. `tables` and `upload` have the size that
  /// `Plan::buffer` returns, which differs from frame to frame. So have `readBack` and `history`,
  /// which only grow; `history` keeps its contents. `upload` and `readBack` exist once for each
  /// frame in flight. `history`, `counters` and `visibility` are needed only if instances are
  /// culled on the GPU. An engine that replaces a buffer by a larger one keeps the old one until
  /// frames in flight are complete.
  BufferRequirement buffer(BufferRole role) const;
  /// The same before there is a scene: with the initial capacities. `poses` and `gpuPoses`: of the
  /// first pose buffer of that kind. Fails as `create`.
  static Result<BufferRequirement> buffer(const SceneDescription& description, BufferRole role);
  /// The buffers of poses. At first one for each writer whose initial capacity is not 0, that of
  /// the CPU before that of the GPU. Others are added when these are full.
  std::uint32_t poseBufferCount() const;
  PoseBuffer poseBuffer(std::uint32_t number) const;
  const SceneDescription& description() const;

  // -- Meshes, poses, instances. They may come and go at any time. Memory of what is removed is
  // free again when the frame that was last begun is complete. Calls with a stale handle fail with
  // `invalidArgument`.

  /// Finds room for a packed mesh. The engine copies its bytes to `meshOffset` of the mesh buffer
  /// before the commands of the next plan, on the same queue; their first barrier covers the copy.
  /// Fails with `limitExceeded` if there is no room, with `invalidArgument` if a promise is broken
  /// or the mesh is not a packed one, and as `GrowthCallback::grow`.
  Result<MeshHandle> addMesh(const MeshInfo& info);
  Result<std::uint64_t> meshOffset(MeshHandle mesh) const;  ///< bytes
  /// Fails with `invalidArgument` while an instance uses it.
  Result<void> removeMesh(MeshHandle mesh);

  /// The engine writes identity matrices to `posePlace`, unless it writes the pose before the next
  /// `plan`. Fails as `addMesh`.
  Result<PoseHandle> addPose(std::uint32_t jointCount, const PoseOptions& options = {});
  /// Adds as many poses as there are handles to fill in. They stand one behind the other: those
  /// that the GPU writes, `jointCount` matrices from one to the next. Adds all, or fails and adds
  /// none.
  Result<void> addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                        const PoseOptions& options = {});
  /// Where the current pose stands. It never moves if the GPU writes it. The first pose of a call
  /// of `addPose` or `addPoses` that the GPU writes begins at a multiple of
  /// `DeviceLimits::minStorageBufferOffsetAlignment` of its pose buffer, the others at multiples of
  /// 16 bytes.
  Result<PosePlace> posePlace(PoseHandle pose) const;
  /// Fails with `invalidArgument` while an instance uses it.
  Result<void> removePose(PoseHandle pose);

  /// The next `plan` skins it. Fails with `invalidArgument` if the description breaks a rule of
  /// `Job`, with `missingFeature` or `limitExceeded` as `makePlan` does, and with `limitExceeded`
  /// if there is no room for it; nothing changes then. `compact` may make room in the output.
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  /// What such an instance needs as long as its mesh, pose and method stay: with the same layout,
  /// `everyVariant` lists two kernels for most instances, instead of ten. Another mesh with as many
  /// influences, or another pose with the same `mayScale`, needs nothing more. Fails with
  /// `invalidArgument` for a stale handle.
  Result<PipelineNeeds> pipelineNeeds(const InstanceDescription& description) const;
  Result<void> removeInstance(InstanceHandle instance);

  // -- What changes.

  /// Begins a frame. `frame` is larger than the last one; `completedFrame` is the newest frame that
  /// the GPU has completed, 0 if none. Frames count from 1; numbers may be left out. Fails with
  /// `invalidArgument` if more frames would be in flight than described, or if numbers run
  /// backwards.
  Result<void> beginFrame(std::uint64_t frame, std::uint64_t completedFrame);

  /// Where to write all joint matrices of this frame: the memory holds an older pose, which the GPU
  /// no longer reads. All instances of the pose are skinned again. Fails with `invalidArgument` if
  /// it is not called between `beginFrame` and `plan`, and for a pose that the GPU writes.
  Result<PosePlace> writePose(PoseHandle pose);
  /// A pass of the engine writes these poses on the GPU before the commands of the next `plan`. All
  /// their instances are skinned again, with what stands there when they are: there is one copy of
  /// such a pose. If the frame is abandoned, its pass is, too: the engine writes and marks them
  /// again. Fails as `writePose`, and for a pose that the CPU writes; the poses before it are
  /// marked then.
  Result<void> markWritten(std::span<const PoseHandle> poses);
  /// The same for all poses that the GPU writes.
  Result<void> markAllWritten();

  /// Changes what has a value. Fails with `invalidArgument` for a stale handle, an interval of 0, a
  /// target that the mesh does not have, one that is given twice, and a weight that is not finite,
  /// and as `addInstance` if mesh, pose, method or box do not fit the instance. Nothing changes
  /// then. While an instance with another mesh is not skinned yet, its old output stays, so there
  /// must be room for both.
  Result<void> change(const InstanceChange& change);
  /// Many changes, one after the other. If one fails, those before it stay, those after it are not
  /// made, and the message begins with its number.
  Result<void> change(std::span<const InstanceChange> changes);
  /// What engines decide about many instances in every frame, in less time than `change` takes.
  /// Fails as `change`.
  Result<void> setVisibility(std::span<const InstanceVisibility> instances);

  /// Whether the next `plan` skins the instance if its pose is written: it is visible, and its
  /// interval lets it. An engine need not animate others. false without `beginFrame`. The GPU may
  /// still find that an instance is out of view.
  Result<bool> isDue(InstanceHandle instance) const;

  /// Moves outputs from the end of the output buffer into free ranges before them, at most
  /// `maxBytes` bytes, with the next `plan`. Returns how many bytes it will move. The old output
  /// stays until frames in flight are complete.
  std::uint64_t compact(std::uint64_t maxBytes);

  // -- Frames.

  /// Lists the commands for everything that changed since the last `commit`; none if nothing
  /// changed. Instances that are culled on the GPU are listed in every frame. After `beginFrame`,
  /// any number of times. Fails with `invalidArgument` without `beginFrame`, and with
  /// `limitExceeded` if the tables are larger than a storage buffer range.
  Result<void> plan(Plan& out);
  /// The commands of the last `plan` have been recorded, and will be executed in the order of
  /// frames. Without it, the next `plan` lists the same work again. Fails with `invalidArgument` if
  /// there is no plan, or the scene was changed since.
  Result<void> commit();

  /// The commands of the last `commit` will never be executed, because the engine did not submit
  /// the frame. What that `commit` did is undone: `output`, motion and update intervals are as they
  /// were before it, and the next `plan` lists its work again. What was added, removed, changed or
  /// written, before the `commit` or after it, stays; poses that the GPU writes are written again.
  /// It is then as after `beginFrame`: the engine may change more, write poses, and plan the same
  /// frame again, or begin another one. Copies that went with the frame are the engine's to repeat:
  /// of packed meshes, and of what larger buffers, `history` among them, got from smaller ones.
  /// O(instances). Fails with `invalidArgument` if the frame is not the one that was committed
  /// last, or if `beginFrame` was called since: older frames cannot be abandoned.
  Result<void> abandonFrame(std::uint64_t frame);

  /// Reads the read-back buffer of a complete frame. Call it after `beginFrame`, for each complete
  /// frame in rising order, before its buffer is used again. Fails with `invalidArgument` if
  /// the frame is not one of the last `framesInFlight` that were committed, and if `bytes` is
  /// smaller than what `Plan::buffer(BufferRole::readBack)` said of the frame. Frames that had
  /// nothing to read back may be given an empty span.
  Result<void> readBack(std::uint64_t frame, std::span<const std::byte> bytes);

  // -- Results, as of the last `commit`.

  /// Before the first `commit` that skins the instance, its size is 0. The output of an instance
  /// that is culled on the GPU stands there from the first `commit` on, even if the GPU has not
  /// skinned it.
  Result<InstanceOutput> output(InstanceHandle instance) const;
  /// Instances that were skinned, in no order, without those culled on the GPU. After
  /// `abandonFrame`, none.
  std::span<const InstanceHandle> skinnedInstances() const;
  /// Instances of which only previous positions changed: they came to rest, or came back into view
  /// in the pose in which they left it.
  std::span<const InstanceHandle> settledInstances() const;
  /// Instances whose output stands elsewhere than before.
  std::span<const InstanceHandle> movedInstances() const;

  /// The exact box of the positions in the newest frame that skinned the instance and was read
  /// back. Nothing before the first one, without `InstanceDescription::bounds`, and if there is
  /// none
  /// (`InstanceResult::box`).
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;

  /// The instance's word in the visibility buffer.
  Result<std::uint32_t> visibilityIndex(InstanceHandle instance) const;
  /// Larger than every `visibilityIndex`. It grows when instances are added.
  std::uint32_t instanceCapacity() const;

  SceneStatistics statistics() const;

 private:
  explicit Scene(const SceneDescription& description);
  SceneBooks& change();
  std::unique_ptr<SceneBooks> books_;
};

}  // namespace dermis
