// The bookkeeping of a scene, without Vulkan: its meshes, poses and instances, their places in the
// buffers, and the work of each frame. `plan` makes a list of commands (plan.h).
//
// `vulkan::SkinningSystem` contains a Scene, and executes its commands on its own buffers.
// Functions that both have are documented here. An engine with its own RHI uses Scene directly:
//
//     scene.beginFrame(frame, completedFrame);
//     for each frame f that has become complete: scene.readBack(f, bytes of its read-back buffer);
//     write joint matrices at scene.writePose(pose)->offset of the poses buffer
//     ... add, remove, change ...
//     scene.plan(plan);
//     writeTables(plan, mapped upload buffer of this frame);
//     for (const Command& command : plan.commands()) ...
//     scene.commit();
//     draw from the output buffer at scene.output(instance)
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

/// How much a buffer holds. It grows if something is added that does not fit.
struct Capacity {
  std::uint64_t initial = 0;                  ///< at creation
  std::uint64_t maximum = ~std::uint64_t{0};  ///< beyond it, adding fails with `limitExceeded`

  /// A capacity that never grows.
  static constexpr Capacity fixed(std::uint64_t count) { return {count, count}; }
};

/// A request for a larger buffer.
struct BufferGrowth {
  /// `meshes`, `palettes`, `results` or `positions` (the output): a larger buffer replaces the old
  /// one. `poses` or `gpuPoses`: one more buffer, since poses never move.
  BufferRole role = BufferRole::positions;
  BufferRequirement requirement;  ///< of the new buffer
  std::uint32_t poseBuffer = 0;   ///< for `poses` and `gpuPoses`: the number of the new buffer
};

/// Creates larger buffers, in an engine with its own RHI. `addMesh`, `addPose`, `addPoses`,
/// `addInstance` and `change` call it. It must not throw, and must not call the Scene.
///
/// Before the commands of the next plan, the engine copies the contents of the old buffer to the
/// new one; palettes need no copy. If that frame is abandoned, the engine copies again in the next
/// one. It keeps the old buffer until all frames in flight are complete.
///
/// The scene first asks for more than it needs now. If that fails, it asks for the minimum. If that
/// fails, too, the function of the scene fails with the same error and adds nothing.
struct GrowthCallback {
  void* user = nullptr;  ///< passed to `grow`
  /// If null, buffers do not grow: the initial capacities are the maximum.
  Result<void> (*grow)(void* user, const BufferGrowth& growth) = nullptr;
};

/// What `Scene::create` needs to know.
struct SceneDescription {
  /// Maximum number of frames that are recorded but not complete, including the one that is being
  /// recorded. At least 1.
  std::uint32_t framesInFlight = 2;
  Capacity meshCapacity{64 << 10};  ///< bytes of packed meshes; at most a storage buffer range
  /// Joints of all poses that the CPU writes. All poses that one call adds are in one buffer, so
  /// some joints of a buffer may stay unused.
  Capacity jointCapacity{256};
  Capacity gpuJointCapacity{0};  ///< the same for poses that the GPU writes
  /// Bytes of skinned vertices: the sum of `VertexPlaces::size` and of the gaps for alignment. May
  /// be more than a storage buffer range. Initial and maximum are rounded to multiples of 4.
  Capacity outputCapacity{256 << 10};
  /// Byte offset of the output in its buffer. Offsets in `InstanceOutput` count from the beginning
  /// of the buffer, offsets in commands from `outputOffset`. Must be a multiple of the alignment
  /// that `Scene::buffer` returns, which need not be a power of two.
  std::uint64_t outputOffset = 0;
  Capacity instanceCapacity{256};  ///< live instances
  Capacity boundsCapacity{64};     ///< live instances with bounds or snorm16 positions
  /// The limits of the device: `vulkan::Context::limits`, or filled in by the engine. If they have
  /// fewer storage buffers than `storageBuffersWanted`, as the defaults do, no instance may have
  /// bounds or snorm16 positions, and `boundsCapacity` is ignored.
  DeviceLimits limits;
  Tuning tuning;          ///< `vulkan::Context::tuning`, or the engine's own
  GrowthCallback growth;  ///< optional
};

/// Who writes the joint matrices of a pose.
enum class PoseWriter : std::uint8_t {
  cpu,  ///< the CPU, to memory that `writePose` returns in each frame
  gpu,  ///< a GPU pass of the engine, always to the same memory; the engine calls `markWritten`
};

/// What is fixed when a pose is added.
struct PoseOptions {
  PoseWriter writer = PoseWriter::cpu;
  bool mayScale = true;  ///< as `PoseDescription::mayScale`
};

/// One of the buffers that hold poses.
struct PoseBuffer {
  PoseWriter writer = PoseWriter::cpu;
  BufferRequirement requirement;
};

/// One instance of a scene.
struct InstanceDescription {
  MeshHandle mesh = {};
  PoseHandle pose = {};  ///< instances may share one, for example body, clothes and hair
  Method method = Method::dualQuaternion;
  /// Formats and arrangement of the skinned vertices. With `Motion::kept`, the scene keeps previous
  /// positions right on the first frame, while the pose rests, between updates, and when the
  /// instance becomes visible. The engine reports jumps with `InstanceChange::teleports`.
  VertexLayout layout = {};
  Box box = {};  ///< for positions in snorm16: as `Job::box`
  /// Whether to compute the exact box of the skinned positions, for `Scene::bounds`.
  bool bounds = false;
  /// The instance is skinned every N-th frame; N is at least 1. If it was due in a frame that was
  /// abandoned, or whose number was skipped, it is skinned in the next one. Instances with the same
  /// pose and interval are skinned in the same frames. Different poses are spread over the frames.
  /// A teleport, another mesh and becoming visible take effect at once.
  std::uint32_t updateInterval = 1;
  /// Whether a word of the visibility buffer, too, decides in each frame if the instance is
  /// visible: 0 means invisible. `InstanceChange::visible` must be true as well. An invisible
  /// instance is neither skinned nor settled (`Job::settles`).
  ///
  /// The output of such an instance must lie in one storage buffer range. An output of at most 1/32
  /// of a range always does. If a larger one does not, because the output buffer is larger than one
  /// range, `addInstance` and `change` fail with `limitExceeded`.
  bool culledOnGpu = false;
};

/// What changes about an instance: every member that has a value. If the mesh, pose, method or box
/// changes, or the instance teleports, the next `plan` skins it whatever its update interval is.
struct InstanceChange {
  InstanceHandle instance = {};
  /// An invisible instance is neither skinned nor settled. When it becomes visible, its previous
  /// positions are set to its current ones. Instances begin visible.
  std::optional<bool> visible = {};
  bool teleports = false;  ///< previous positions are set to the current ones
  /// Previous positions are kept. `prepare` must have been called for the new method, too: see
  /// `pipelineNeeds`.
  std::optional<Method> method = {};
  std::optional<std::uint32_t> updateInterval = {};  ///< as `InstanceDescription::updateInterval`
  /// Another mesh, for example a level of detail. The output moves, and previous positions are set
  /// to the current ones. Morph weights are kept if both meshes have the same number of targets;
  /// otherwise they are removed.
  std::optional<MeshHandle> mesh = {};
  std::optional<PoseHandle> pose = {};  ///< previous positions are kept
  /// For positions in snorm16. Previous positions are set to the current ones, since the old ones
  /// are relative to the old box.
  std::optional<Box> box = {};
  /// The active targets, as `Job::morphs`. The weights are copied.
  std::optional<std::span<const MorphWeight>> morphs = {};
};

/// Sets both `InstanceChange::visible` and `InstanceChange::updateInterval` of an instance.
struct InstanceVisibility {
  InstanceHandle instance = {};
  bool visible = true;
  std::uint32_t updateInterval = 1;
};

/// What `prepare` needs before such an instance is recorded, for any mesh and pose.
/// `Scene::pipelineNeeds` returns less: the needs of the mesh and pose that it has now.
inline PipelineNeeds pipelineNeeds(const InstanceDescription& description) {
  return {.method = description.method,
          .layout = description.layout,
          .bounds = description.bounds,
          .culledOnGpu = description.culledOnGpu};
}

/// Where the vertices of an instance are in the output buffer.
struct InstanceOutput {
  /// The mesh that the instance was last skinned with. After a change of mesh it is the old mesh
  /// until the instance is skinned again. For an instance that is culled on the GPU it is the old
  /// mesh until the next `commit`.
  MeshHandle mesh;
  /// Bytes from the beginning of the buffer. For interleaved layouts it is a multiple of the
  /// stride, so that a draw can use `firstVertex` instead of a vertex-buffer offset.
  std::uint64_t offset = 0;
  std::uint64_t size = 0;  ///< bytes; 0 if the instance has not been skinned yet
  /// The attributes. Their offsets count from the beginning of the buffer.
  OutputAttribute positions, normals, tangents, previousPositions;
};

/// Bytes of one buffer of a scene.
struct StoreStatistics {
  std::uint64_t capacity = 0;
  std::uint64_t used = 0;         ///< including what frames in flight may still read
  std::uint64_t largestFree = 0;  ///< size of the largest free range
};

/// What the frame of the last `commit` does; zeros after `abandonFrame`. Skinned and settled
/// instances, vertices and bytes written do not include instances culled on the GPU.
struct FrameWorkStatistics {
  std::uint64_t frame = 0;
  std::uint32_t instances = 0;  ///< in the scene
  std::uint32_t skinnedInstances = 0;
  std::uint32_t settledInstances = 0;  ///< instances of which only previous positions are written
  std::uint32_t convertedPoses = 0;    ///< a pose counts once for each form that methods need
  std::uint32_t culledCandidates = 0;  ///< instances that the visibility kernel looks at
  std::uint64_t skinnedVertices = 0;
  std::uint64_t writtenBytes = 0;  ///< of skinned vertices
  std::uint64_t movedBytes = 0;    ///< by `compact`
  std::uint64_t poseBytes = 0;  ///< joint matrices that the CPU wrote and the palette kernel reads
};

/// What the visibility kernel counted in a complete frame. The counts are 0 if no instance was
/// culled on the GPU.
struct CullingStatistics {
  std::uint64_t frame = 0;
  std::uint32_t visibleInstances = 0;
  std::uint32_t skinnedInstances = 0;
  std::uint32_t settledInstances = 0;
  std::uint32_t workgroups = 0;  ///< of the indirect dispatches
};

/// What `Scene::statistics` returns.
struct SceneStatistics {
  FrameWorkStatistics lastFrame;              ///< the last `commit`
  CullingStatistics lastCompletedFrame;       ///< the last `readBack`
  StoreStatistics meshes, palettes, outputs;  ///< memory now
};

/// Where the joint matrices of a pose are written.
struct PosePlace {
  std::uint32_t poseBuffer = 0;  ///< number of the `Scene::poseBuffer`
  std::uint64_t offset = 0;      ///< bytes into the pose buffer
  std::uint32_t jointCount = 0;
};

class SceneBooks;

/// Meshes, poses and instances, and the commands that skin them frame by frame. Owns CPU memory
/// only. Not thread-safe: one thread at a time may call a member function.
class DERMIS_CORE_API Scene {
 public:
  /// Fails with `invalidArgument` if a member of the description is not valid, and with
  /// `limitExceeded` if an initial capacity needs a buffer larger than a storage buffer range.
  static Result<Scene> create(const SceneDescription& description);
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  /// Size and usage that a buffer must have now. For poses see `poseBuffer`.
  ///
  /// - `meshes`, `palettes`, `results`, `positions`: `GrowthCallback` reports when they grow.
  /// - `tables`, `upload`: `Plan::buffer` returns their size, which differs from frame to frame.
  /// - `readBack`, `history`: `Plan::buffer` returns their size, too. They only grow: keep a buffer
  /// that
  ///   is larger than a plan needs (`history` has size 0 if a plan culls nothing). A larger
  ///   `history` gets the contents of the old one.
  /// - `upload`, `readBack`: one for each frame in flight.
  /// - `history`, `counters`, `visibility`: needed only if instances are culled on the GPU.
  ///
  /// An engine that replaces a buffer by a larger one keeps the old one until all frames in flight
  /// are complete.
  BufferRequirement buffer(BufferRole role) const;
  /// The same before the scene is created, for the initial capacities. For `poses` and `gpuPoses`:
  /// the first buffer of that kind. Fails as `create` does.
  static Result<BufferRequirement> buffer(const SceneDescription& description, BufferRole role);
  /// Number of buffers for poses. At first there is one for each writer whose initial capacity is
  /// not 0: first the one of the CPU, then the one of the GPU. More are added when these are full.
  std::uint32_t poseBufferCount() const;
  /// `number` is less than `poseBufferCount`; this is not checked.
  PoseBuffer poseBuffer(std::uint32_t number) const;
  /// The description that the scene was created with. Capacities are rounded, and their maxima are
  /// limited to what the device can hold.
  const SceneDescription& description() const;

  // -- Meshes, poses, instances. They may be added and removed at any time. Memory of removed
  // objects is reused once the frame that was begun last is complete. Functions fail with
  // `invalidArgument` if a handle is null or its object was removed.

  /// Reserves memory for a packed mesh. The engine copies the bytes to `meshOffset` of the mesh
  /// buffer before the commands of the next plan, on the same queue. The first barrier of the plan
  /// covers the copy. Fails with `limitExceeded` if there is no room, with `invalidArgument` if
  /// no packed mesh has the sizes of `info`, and with the errors of `GrowthCallback::grow`.
  Result<MeshHandle> addMesh(const MeshInfo& info);
  Result<std::uint64_t> meshOffset(MeshHandle mesh) const;  ///< bytes into the mesh buffer
  /// Fails with `invalidArgument` if an instance uses the mesh.
  Result<void> removeMesh(MeshHandle mesh);

  /// Reserves memory for a pose. Its contents are undefined: the engine must write identity
  /// matrices to `posePlace`, or write the pose before the next `plan`. Fails with
  /// `invalidArgument` if `jointCount` is not from 1 to `maxPoseJoints` or the writer is not valid,
  /// and as `addMesh` does.
  Result<PoseHandle> addPose(std::uint32_t jointCount, const PoseOptions& options = {});
  /// Adds one pose for each element of `poses`, and writes the handles there. Poses that the GPU
  /// writes are consecutive: each begins `jointCount` matrices after the one before it. If it
  /// fails, it adds none.
  Result<void> addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                        const PoseOptions& options = {});
  /// Where the current pose is. A pose that the GPU writes never moves. Its offset in its pose
  /// buffer is a multiple of 16 bytes. The first of the poses that one call of `addPose` or
  /// `addPoses` adds for the GPU to write is at a multiple of
  /// `DeviceLimits::minStorageBufferOffsetAlignment`.
  Result<PosePlace> posePlace(PoseHandle pose) const;
  /// Fails with `invalidArgument` if an instance uses the pose.
  Result<void> removePose(PoseHandle pose);

  /// Adds an instance. The next `plan` skins it. Fails with `invalidArgument` if the description
  /// breaks a rule of `Job`, with `missingFeature` or `limitExceeded` as `makePlan` does, and with
  /// `limitExceeded` if there is no room for it. `compact` may make room in the output.
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  /// What `prepare` needs for such an instance with this mesh, pose and method. `everyVariant` then
  /// lists two kernels for most instances, instead of up to nine. Another mesh with the same
  /// minimum and maximum of influences, or another pose with the same `mayScale`, needs nothing
  /// more. Fails with `invalidArgument` if the method is not valid, or if the layout breaks a rule
  /// of `OutputAttribute`, and as `placeVertices` does.
  Result<PipelineNeeds> pipelineNeeds(const InstanceDescription& description) const;
  /// Removes an instance and its output.
  Result<void> removeInstance(InstanceHandle instance);

  // -- What changes.

  /// Begins a frame. `completedFrame` is the newest frame that the GPU has completed, or 0. Frames
  /// are numbered from 1; numbers may be skipped. Fails with `invalidArgument` if `frame` is not
  /// larger than the last one, if `completedFrame` is lower than before or not lower than `frame`,
  /// or if more than `framesInFlight` frames would be in flight.
  Result<void> beginFrame(std::uint64_t frame, std::uint64_t completedFrame);

  /// Returns where the engine writes all joint matrices of the pose for this frame. The memory
  /// holds an older pose that the GPU no longer reads. All instances of the pose are skinned again.
  /// Fails with `invalidArgument` unless it is called between `beginFrame` and `commit`, and for a
  /// pose that the GPU writes.
  Result<PosePlace> writePose(PoseHandle pose);
  /// States that a GPU pass of the engine writes these poses before the commands of the next
  /// `plan`. All their instances are skinned again. There is one copy of such a pose: an instance
  /// that is skinned later uses what the memory holds then. If the frame is abandoned, the engine
  /// writes and marks the poses again. Fails as `writePose` does, and for a pose that the CPU
  /// writes; the poses before it in `poses` are then marked.
  Result<void> markWritten(std::span<const PoseHandle> poses);
  /// `markWritten` for all poses that the GPU writes.
  Result<void> markAllWritten();

  /// Applies a change. Fails with `invalidArgument` for an update interval of 0, a morph target
  /// that the mesh does not have or that is given twice, and a weight that is not finite; and as
  /// `addInstance` does if mesh, pose, method or box do not fit the instance. If it fails, nothing
  /// changes. After a change of mesh, the old output is kept until the instance has been skinned,
  /// so there must be room for both.
  Result<void> change(const InstanceChange& change);
  /// Applies many changes, one after the other. If one fails, the changes before it remain, those
  /// after it are not applied, and the message begins with its index.
  Result<void> change(std::span<const InstanceChange> changes);
  /// Sets visibility and update interval of many instances, for example after culling in each
  /// frame. Faster than `change`. Fails as `change` with many changes does.
  Result<void> setVisibility(std::span<const InstanceVisibility> instances);

  /// Whether the next `plan` skins the instance if its pose is written: it is visible, and its
  /// update interval permits it. An engine need not animate instances that are not due. Returns
  /// false unless it is called between `beginFrame` and `commit`. An instance that is culled on the
  /// GPU may be due and yet not be skinned.
  Result<bool> isDue(InstanceHandle instance) const;

  /// Moves outputs from the end of the output buffer into free ranges before them. The next `plan`
  /// copies them. Moves at most `maxBytes` bytes and returns how many. The old output is kept until
  /// all frames in flight are complete.
  std::uint64_t compact(std::uint64_t maxBytes);

  // -- Frames.

  /// Lists the commands for everything that changed since the last `commit`. If nothing changed,
  /// there are none; but if instances are culled on the GPU, there are commands in every frame. May
  /// be called any number of times between `beginFrame` and `commit`. Fails with `invalidArgument`
  /// if `beginFrame` was not called, and with `limitExceeded` if the tables are larger than a
  /// storage buffer range.
  Result<void> plan(Plan& out);
  /// States that the commands of the last `plan` have been recorded, and will be executed in the
  /// order of frames. Without it, the next `plan` lists the same work again. Fails with
  /// `invalidArgument` if there is no plan, or if the scene was changed after it.
  Result<void> commit();

  /// States that the commands of the last `commit` will never be executed, because the engine did
  /// not submit the frame. Undoes what `commit` did: `output`, previous positions and update
  /// intervals are as before it, and the next `plan` lists its work again. Everything that was
  /// added, removed, changed or written remains, whether before the `commit` or after it.
  /// Afterwards the scene is in the same frame, as after `beginFrame`: the engine may change more,
  /// write poses, and plan the frame again, or begin another frame.
  ///
  /// The engine repeats what it recorded in the frame: copies of packed meshes, copies from smaller
  /// buffers to larger ones (`history` included), and its passes that write poses, with
  /// `markWritten`.
  ///
  /// O(instances). Fails with `invalidArgument` if `frame` is not the one that was committed last,
  /// or if `beginFrame` was called since: older frames cannot be abandoned.
  Result<void> abandonFrame(std::uint64_t frame);

  /// Reads the read-back buffer of a complete frame. Call it after `beginFrame`, for each complete
  /// frame in ascending order, before the buffer is used again. Boxes of a frame that is left out
  /// are missing until the instance is skinned again. Fails with `invalidArgument` if the frame is
  /// not complete, not newer than the last one that was read back, or not one of the last
  /// `framesInFlight` that were committed, and if `bytes` is smaller than what the frame copied
  /// there; `Plan::buffer(BufferRole::readBack)` returned that size. For frames that copied
  /// nothing, `bytes` may be empty.
  Result<void> readBack(std::uint64_t frame, std::span<const std::byte> bytes);

  // -- Results, as of the last `commit`. `vulkan::SkinningSystem::record` commits. Spans are valid
  // until the next `commit` or `abandonFrame`. After `abandonFrame` all three lists are empty.

  /// Where the skinned vertices of an instance are. Before the first `commit` that skins it, the
  /// size is 0. An instance that is culled on the GPU has an output from its first `commit` on,
  /// even if the GPU has not skinned it.
  Result<InstanceOutput> output(InstanceHandle instance) const;
  /// Instances that were skinned, in no particular order, without those culled on the GPU.
  std::span<const InstanceHandle> skinnedInstances() const;
  /// Instances of which only previous positions were written: they came to rest, or became
  /// visible in the same pose.
  std::span<const InstanceHandle> settledInstances() const;
  /// Instances whose output has another offset than before.
  std::span<const InstanceHandle> movedInstances() const;

  /// The exact box of the positions, from the newest frame that skinned the instance and was read
  /// back. Empty if there is no such frame, if `InstanceDescription::bounds` is false, or if
  /// `InstanceResult::box` is empty.
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;

  /// The index of the instance's word in the visibility buffer.
  Result<std::uint32_t> visibilityIndex(InstanceHandle instance) const;
  /// Number of words in the visibility buffer: larger than every `visibilityIndex`. Grows when
  /// instances are added.
  std::uint32_t visibilityCount() const;

  /// Counts of the last frame, of the newest frame that was read back, and of memory.
  SceneStatistics statistics() const;

 private:
  explicit Scene(const SceneDescription& description);
  friend struct SceneAccess;  // for executors
  SceneBooks& change();
  std::unique_ptr<SceneBooks> books_;
};

}  // namespace dermis
