// A scene: meshes, poses and instances by handle, which may be added, removed and changed while
// frames are in flight, and where the skinned vertices are. Who executes its frames owns it:
//
// - `vulkan::SceneRecorder` (vulkan/scene_recorder.h) records them into a command buffer;
// - `cpu::SceneRunner` (cpu.h) makes jobs for the engine's threads;
// - `SceneCommands` (below) lists commands for an engine with its own RHI.
//
// Code that uses a scene does not depend on its owner:
//
//     Scene& scene = recorder.scene();
//     scene.beginFrame(frame, completedFrame);                     // frame numbers of the engine
//     std::span<JointMatrix> matrices = *scene.writePose(pose);    // for each pose that changes
//     scene.play(plays);                       // or clips, from which the scene samples the poses
//     ... add, remove, change ...
//     recorder.record(commandBuffer);          // or runner.jobs(), or commands.plan() and commit()
//     draw from the output buffer at scene.output(instance)
//
// Below, to execute a frame means `record`, `jobs`, or `plan` and `commit`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "dermis/clips.h"
#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/rig.h"

namespace dermis {

/// Identifies an object of one kind. Functions reject the handle of a removed object, even if
/// another object has the same index: its `generation` differs. Plain data.
template <typename Thing>
struct Handle {
  std::uint32_t index = 0;
  std::uint32_t generation = 0;  ///< 0: no object

  friend bool operator==(const Handle&, const Handle&) = default;
  /// Whether it is a handle of an object, which may have been removed.
  explicit operator bool() const { return generation != 0; }
};

using MeshHandle = Handle<struct MeshOfScene>;          ///< a mesh
using PoseHandle = Handle<struct PoseOfScene>;          ///< a pose
using InstanceHandle = Handle<struct InstanceOfScene>;  ///< an instance
using ClipsHandle = Handle<struct ClipsOfScene>;        ///< a bank of clips
using FigureHandle = Handle<struct FigureOfScene>;      ///< what plays clips
using RigHandle = Handle<struct RigOfScene>;            ///< a rig

/// How much a buffer holds. It grows if something is added that does not fit.
struct Capacity {
  std::uint64_t initial = 0;                  ///< at creation
  std::uint64_t maximum = ~std::uint64_t{0};  ///< beyond it, adding fails with `limitExceeded`

  /// A capacity that never grows.
  static constexpr Capacity fixed(std::uint64_t count) { return {count, count}; }
};

/// How many frames may be in flight, and how much a scene holds.
struct SceneDescription {
  /// Frames whose fence the engine has not yet waited for when it calls `beginFrame`, the new one
  /// included. At least 1. Ignored by `cpu::SceneRunner`.
  std::uint32_t framesInFlight = 2;
  /// Bytes of packed meshes and, unless the CPU executes the frames, of clips and rigs; at most a
  /// storage buffer range.
  Capacity meshCapacity{64 << 10};
  /// Joints of all poses that the CPU writes. All poses that one call adds are in one buffer, so
  /// some joints of a buffer may stay unused.
  Capacity jointCapacity{256};
  /// The same for poses that the GPU writes. Poses of figures and joints that rigs drive are among
  /// them, unless the CPU executes the frames, and weights that the GPU writes: 12 take the room of
  /// a joint.
  Capacity gpuJointCapacity{0};
  /// Bytes of skinned vertices: the sum of `VertexPlaces::size` and of the gaps for alignment. May
  /// be more than a storage buffer range. Initial and maximum are rounded to multiples of 4.
  Capacity outputCapacity{256 << 10};
  Capacity instanceCapacity{256};  ///< live instances
  /// Live instances with bounds or snorm16 positions. If the device has fewer storage buffers than
  /// `storageBuffersWanted`, no instance may have these, and this is ignored.
  Capacity boundsCapacity{64};
};

/// What is fixed when a pose is added.
struct PoseOptions {
  /// Whether a GPU pass of the engine writes the joint matrices, always to the same memory, after
  /// which the engine calls `markWritten`. Otherwise the CPU writes them, to memory that
  /// `writePose` returns in each frame.
  bool writtenByGpu = false;
  /// As `PoseDescription::promise`. That of a pose with a rig includes driven joints: they keep
  /// that of the others if `PackedRig::isRigid`.
  JointPromise promise = JointPromise::scaling;
  /// Computes the joints after the written ones. None if it is null.
  RigHandle rig = {};
};

/// What a figure plays from now on.
struct FigurePlay {
  FigureHandle figure = {};
  /// As `samplePose` takes them, at most `maxClipLayers`; copied. If there are none, it rests.
  std::span<const ClipLayer> layers = {};
};

/// Who writes the morph weights of an instance.
enum class MorphWriter : std::uint8_t {
  cpu = 0,  ///< `InstanceChange::morphs`
  /// A GPU pass of the engine: a float for each morph target, always to the same memory. The engine
  /// then calls `markMorphsWritten`. The GPU lists the targets whose weight is not 0.
  gpu = 1,
  /// The clips that the figure of its pose plays (`InstanceDescription::weightsOf`). While its pose
  /// belongs to no figure, no target is active.
  clips = 2,
};

/// One instance of a scene.
struct InstanceDescription {
  MeshHandle mesh = {};
  PoseHandle pose = {};  ///< instances may share one, for example body, clothes and hair
  Method method = Method::dualQuaternion;
  /// Formats and arrangement of the skinned vertices. With `motion`, the scene keeps previous
  /// positions right on the first frame, while the pose rests, between updates, and when the
  /// instance becomes visible. The engine reports jumps with `InstanceChange::teleports`.
  VertexLayout layout = {};
  Box box = {};  ///< for positions in snorm16: as `Job::box`
  /// Whether to compute the exact box of the skinned positions, for `Scene::bounds`.
  bool bounds = false;
  /// The instance is skinned every N-th frame; N is at least 1. If it was due in a frame that was
  /// abandoned, or whose number was skipped, it is skinned in the next one. Instances with the same
  /// pose and interval are skinned in the same frames. Different poses are spread over the frames.
  /// A teleport, another mesh and becoming visible take effect at once. But an instance that the
  /// GPU finds visible between its turns (`culledOnGpu`) shows the pose of its last turn if it was
  /// visible then, otherwise that of this frame.
  std::uint32_t updateInterval = 1;
  /// Whether the engine draws the instance between its last two updates, so that it moves smoothly
  /// at a larger update interval N. Previous positions are then those of the update before, and
  /// stay until the next one, or until N frames have passed without one. `InstanceOutput` has what
  /// the vertex shader needs. The instance shows each pose N - 1 frames late. Where frame numbers
  /// are skipped, or it is skinned before N frames have passed, it jumps. Requires `motion` in the
  /// layout.
  bool interpolates = false;
  /// Whether a word of the visibility buffer, too, decides in each frame if the instance is
  /// visible: 0 means invisible. `InstanceChange::visible` must be true as well. An invisible
  /// instance is neither skinned nor settled (`Job::settles`).
  ///
  /// The output of such an instance must lie in one storage buffer range. An output of at most 1/32
  /// of a range always does. If a larger one does not, because the output buffer is larger than one
  /// range, `addInstance` and `change` fail with `limitExceeded`.
  bool culledOnGpu = false;
  /// Other than the CPU needs a mesh with morph targets.
  MorphWriter morphWriter = MorphWriter::cpu;
  /// With `MorphWriter::clips`: the node of the skeleton whose weights drive the instance. The bank
  /// must have as many for it as the mesh has targets that no rig drives
  /// (`PackedClips::weightCount`).
  std::uint32_t weightsOf = noIndex;
  /// The number of the mesh's last morph targets whose weights are those of the rig of the pose,
  /// consecutive from `firstDrivenWeight` on. They are not active while the pose has no rig.
  /// `morphWriter` writes the targets before them.
  std::uint32_t drivenTargets = 0;
  std::uint32_t firstDrivenWeight = 0;
};

/// What changes about an instance: every member that has a value. If the mesh, pose, method or box
/// changes, or the instance teleports, the next frame skins it whatever its update interval is.
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
  /// otherwise they are removed, or the change fails if not the CPU writes them.
  std::optional<MeshHandle> mesh = {};
  std::optional<PoseHandle> pose = {};  ///< previous positions are kept
  /// For positions in snorm16. Previous positions are set to the current ones, since the old ones
  /// are relative to the old box.
  std::optional<Box> box = {};
  /// The active targets, as `Job::morphs`. The weights are copied. Fails if not the CPU writes
  /// them.
  std::optional<std::span<const MorphWeight>> morphs = {};
};

/// Sets both `InstanceChange::visible` and `InstanceChange::updateInterval` of an instance: state
/// the interval anew.
struct InstanceVisibility {
  InstanceHandle instance = {};
  bool visible = true;
  std::uint32_t updateInterval = 1;
};

/// Where the vertices of an instance are in the output buffer.
struct InstanceOutput {
  /// Whether vertices are there, as of the last frame that was executed. False for an instance that
  /// no frame has skinned since it was added, or since `abandonFrame`. The CPU learns that an
  /// instance that is culled on the GPU was skinned when it reads the frame back, in a later
  /// `beginFrame`; after a change of mesh it is false until then.
  bool isWritten = false;
  /// The mesh that the instance was last skinned with. After a change of mesh it is the old mesh
  /// until the instance is skinned again. For an instance that is culled on the GPU it is the old
  /// mesh until the next frame is executed.
  MeshHandle mesh;
  /// Bytes from the beginning of the buffer. For interleaved layouts it is a multiple of the
  /// stride, so that a draw can use `firstVertex` instead of a vertex-buffer offset.
  std::uint64_t offset = 0;
  VertexPlaces places;  ///< the offsets count from the beginning of the buffer
  /// Draw mix(previous, current, interpolation) if the instance interpolates. It changes in every
  /// frame that is executed. 1 if the instance does not interpolate, or rests.
  float interpolation = 1;
  /// What is drawn has then moved by (current - previous) * motionScale since the last frame.
  float motionScale = 1;
};

/// Indices of a mesh in the index buffer of the engine.
struct IndexRange {
  std::uint32_t first = 0, count = 0;
};

/// VkDrawIndexedIndirectCommand, which is D3D12_DRAW_INDEXED_ARGUMENTS, too.
struct IndexedDraw {
  std::uint32_t indexCount = 0;
  std::uint32_t instanceCount = 0;  ///< 1, or 0 before it was skinned (`isWritten`)
  std::uint32_t firstIndex = 0;
  std::int32_t vertexOffset = 0;    ///< the first vertex of the instance in the output buffer
  std::uint32_t firstInstance = 0;  ///< position in the list
};

/// What `Scene::statistics` returns.
struct SceneStatistics {
  /// Bytes of one buffer of a scene.
  struct Store {
    std::uint64_t capacity = 0;
    std::uint64_t used = 0;         ///< including what frames in flight may still read
    std::uint64_t largestFree = 0;  ///< size of the largest free range
  };

  /// What the last frame that was executed does; zeros after `abandonFrame`. Skinned and settled
  /// instances, vertices and bytes written do not include instances culled on the GPU.
  struct Frame {
    std::uint64_t frame = 0;
    std::uint32_t instances = 0;  ///< in the scene
    std::uint32_t skinnedInstances = 0;
    std::uint32_t settledInstances = 0;  ///< instances of which only previous positions are written
    /// Figures whose poses were sampled from clips. Those that only instances culled on the GPU
    /// need are counted in every frame in which they may be.
    std::uint32_t sampledFigures = 0;
    /// A pose counts once for each palette that methods need of it. Poses of figures count, too.
    std::uint32_t convertedPoses = 0;
    std::uint32_t culledCandidates = 0;  ///< instances that the visibility kernel looks at
    std::uint64_t skinnedVertices = 0;
    std::uint64_t writtenBytes = 0;  ///< of skinned vertices
    std::uint64_t movedBytes = 0;    ///< by `compact`
    /// Joint matrices that the CPU wrote and the palette kernel reads.
    std::uint64_t poseBytes = 0;
  };

  /// What the visibility kernel counted in a complete frame. The counts are 0 if no instance was
  /// culled on the GPU.
  struct Culling {
    std::uint64_t frame = 0;
    std::uint32_t visibleInstances = 0;
    std::uint32_t skinnedInstances = 0;
    std::uint32_t settledInstances = 0;
    std::uint32_t workgroups = 0;  ///< of the indirect dispatches
  };

  Frame lastFrame;                  ///< the last that was executed
  Culling lastCompletedFrame;       ///< the last that was read back
  Store meshes, palettes, outputs;  ///< memory now
};

struct SceneBooks;

/// Meshes, poses and instances, and where their vertices are. Not thread-safe: one thread at a time
/// may call a member function, or a function of the owner that executes a frame. A scene stays at
/// one address until its owner is destroyed, even if the owner is moved.
class DERMIS_CORE_API Scene {
 public:
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// The description that the scene was created with. Capacities are rounded, and their maxima are
  /// limited to what the device can hold.
  const SceneDescription& description() const;

  // -- Meshes, poses, instances. They may be added and removed at any time. Memory of removed
  // objects is reused once the frame that was begun last is complete. Functions fail with
  // `invalidArgument` if a handle is null or its object was removed.
  //
  // Adding something may make a buffer grow. The larger buffer is created at once, for twice the
  // size, or for the minimum if there is no memory for that. If there is no memory for the minimum
  // either, the function fails with the error of the creation, and adds nothing. The
  // next frame copies the contents of the old buffer, which is released once the frames that use it
  // are complete.

  /// Adds a mesh. The scene keeps the bytes until the GPU has them; on the CPU it keeps the mesh.
  /// Fails with `limitExceeded` if there is no room.
  Result<MeshHandle> addMesh(PackedMesh mesh);
  /// Fails with `invalidArgument` if an instance uses the mesh.
  Result<void> removeMesh(MeshHandle mesh);

  /// Adds a rig, for any number of poses. The scene keeps its bytes. Fails with `limitExceeded` if
  /// there is no room on the GPU.
  Result<RigHandle> addRig(PackedRig rig);
  /// Fails with `invalidArgument` if a pose has the rig.
  Result<void> removeRig(RigHandle rig);

  /// Adds a pose. All its joint matrices are identities until `writePose`; those of a pose that the
  /// GPU writes are undefined until a pass of the engine writes them. Fails with `invalidArgument`
  /// if `jointCount` is not from 1 to `maxPoseJoints`, or not that of the written joints of the
  /// rig, or if the GPU writes the pose of a scene on the CPU, and with `limitExceeded` if there is
  /// no room. Behind the joints of a pose that the GPU writes are the given weights of its rig.
  Result<PoseHandle> addPose(std::uint32_t jointCount, const PoseOptions& options = {});
  /// Adds one pose for each element of `poses`, and writes the handles there. Poses that the GPU
  /// writes are consecutive in one buffer: each begins `jointCount` matrices after the one before
  /// it, plus one for every twelve given weights of its rig, rounded up. The first begins at a
  /// multiple of `DeviceLimits::minStorageBufferOffsetAlignment`. If it fails, it adds none.
  Result<void> addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                        const PoseOptions& options = {});
  /// Fails with `invalidArgument` if an instance uses the pose, or if it belongs to a figure.
  Result<void> removePose(PoseHandle pose);

  /// Adds a bank of clips, for any number of figures. The scene keeps its bytes. Fails with
  /// `limitExceeded` if there is no room on the GPU.
  Result<ClipsHandle> addClips(PackedClips clips);
  /// Fails with `invalidArgument` if a figure uses the bank.
  Result<void> removeClips(ClipsHandle clips);
  /// Adds a figure, which plays clips of one bank. It has a pose for each skin of the bank, which
  /// the scene samples. It rests until `play`. `rigs` is empty, or has a rig or a null handle for
  /// each skin. Fails with `limitExceeded` if there is no room, and with `invalidArgument` if a rig
  /// does not have the joints of its skin, or takes other weights than the clips have for
  /// `RigView::weightsOf`.
  Result<FigureHandle> addFigure(ClipsHandle clips, std::span<const RigHandle> rigs = {});
  /// Removes a figure and its poses. Fails with `invalidArgument` if an instance uses one of them.
  Result<void> removeFigure(FigureHandle figure);
  /// The pose of a figure for a skin of its bank. It has the promise `JointPromise::rigid` if the
  /// clips cannot scale the joints of the skin and its rig, if any, `isRigid`; otherwise `scaling`.
  /// Fails with `invalidArgument` if there is no such skin.
  Result<PoseHandle> pose(FigureHandle figure, std::uint32_t skin = 0) const;

  /// Adds an instance. The next frame skins it. Fails with `invalidArgument` if the description
  /// breaks a rule of `Job` or interpolates without motion, with `missingFeature` or
  /// `limitExceeded` as `makePlan` does, and with `limitExceeded` if there is no room for it.
  /// `compact` may make room in the output. On the CPU it also fails with `invalidArgument` for an
  /// instance that is `culledOnGpu`, and for methods that are `isForComparison`.
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  /// Removes an instance and its output.
  Result<void> removeInstance(InstanceHandle instance);

  /// What `vulkan::Context::prepare`, or `pipelines` (plan.h), needs for such an instance. If both
  /// handles are valid, only for instances with the same method whose mesh has the same minimum and
  /// maximum of influences and whose pose is like this one in its promise, as that of a figure, and
  /// by having a rig: two kernels for most instances. If a handle is null, for any mesh or pose:
  /// about ten. With a null pose, figures and rigs count only if the scene has some: set
  /// `PipelineNeeds::figures` and `rigs` before that. Fails with `invalidArgument` if the method is
  /// not valid, or if the layout breaks a rule of `OutputAttribute`, and as `placeVertices` does.
  Result<PipelineNeeds> pipelineNeeds(const InstanceDescription& description) const;

  // -- What changes.

  /// Begins a frame. `completedFrame` is the newest frame that the GPU has completed, or 0. Frames
  /// are numbered from 1; numbers may be skipped. Reads the results of complete frames, for
  /// `bounds` and `statistics`. On the CPU, each frame is complete when the next one begins: its
  /// jobs must be done, and `completedFrame` is ignored. Fails with `invalidArgument` if `frame` is
  /// not larger than the last one, if `completedFrame` is lower than before or not lower than
  /// `frame`, or if more than `framesInFlight` frames would be in flight.
  Result<void> beginFrame(std::uint64_t frame, std::uint64_t completedFrame);
  /// The number of the frame that was begun last; 0 before the first.
  std::uint64_t frame() const;

  /// Returns memory for the joint matrices of this frame. The engine writes all of it before the
  /// frame is executed, and never reads it; any thread may write. Frames read it until the next
  /// `writePose`. All instances of the pose are skinned again. Before the first `beginFrame` it
  /// returns memory, too: for the first frame. Fails with `invalidArgument` between the execution
  /// of a frame and the next `beginFrame`, and for a pose that the GPU writes.
  Result<std::span<JointMatrix>> writePose(PoseHandle pose);
  /// The same for the given weights of the pose's rig: `writePose` and this one return memory of
  /// the same pose, and the engine writes both.
  Result<std::span<float>> writePoseWeights(PoseHandle pose);
  /// States that a GPU pass of the engine writes these poses before the commands of this frame. All
  /// their instances are skinned again. The scene keeps no copy: an instance that is skinned in a
  /// later frame uses what the memory holds then. If the frame is abandoned, the engine writes
  /// and marks the poses again. Fails as `writePose` does, and for a pose that the CPU writes; the
  /// poses before it in `poses` are then marked.
  Result<void> markWritten(std::span<const PoseHandle> poses);
  /// `markWritten` for all poses that the engine's GPU passes write.
  Result<void> markAllWritten();
  /// The same for morph weights (`MorphWriter::gpu`): these instances are skinned again.
  Result<void> markMorphsWritten(std::span<const InstanceHandle> instances);
  /// Sets what figures play, at any time. All instances of their poses are skinned again. The next
  /// frames sample a pose once, when an instance is skinned with it: one that is invisible or not
  /// due costs nothing, and gets what its figure plays then. Times are wrapped or clamped here
  /// (`clipTime`).
  ///
  /// O(figures × layers). Fails with `invalidArgument` as `samplePose` does. The message names the
  /// first wrong entry by its index, and nothing changes.
  Result<void> play(std::span<const FigurePlay> figures);

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

  /// Whether this frame skins the instance if its pose is written: it is visible, and its update
  /// interval permits it. An engine need not animate instances that are not due. Returns false
  /// between the execution of a frame and the next `beginFrame`. An instance that is culled on the
  /// GPU may be due and yet not be skinned.
  Result<bool> isDue(InstanceHandle instance) const;

  /// Moves outputs from the end of the output buffer into free ranges before them. The next frame
  /// copies them. Moves at most `maxBytes` bytes and returns how many. The old output is kept until
  /// all frames in flight are complete.
  std::uint64_t compact(std::uint64_t maxBytes);

  /// States that the last frame that was executed will never reach the GPU, because the engine did
  /// not submit it, or that none of its jobs was or will be run. Call it before the next
  /// `beginFrame`; otherwise the frame counts as executed once a later one is complete. The
  /// command buffer may be reset or freed at once.
  ///
  /// Afterwards the scene is in the same frame, as after `beginFrame`: the engine may change more,
  /// write poses, and execute the frame again, or begin another one. All instances are skinned
  /// again, their motion restarts, and bounds are empty until then, so one frame has no motion
  /// vectors. What was uploaded is uploaded again, except that the engine writes and marks again
  /// the poses and morph weights that its GPU passes wrote. Everything that was added, removed or
  /// changed remains.
  ///
  /// O(instances). Fails with `invalidArgument` if `frame` is not the one that was executed last,
  /// or if `beginFrame` was called since.
  Result<void> abandonFrame(std::uint64_t frame);

  // -- Results, as of the last frame that was executed. Spans are valid until the next one, or
  // `abandonFrame`. After `abandonFrame` both lists are empty.

  /// Where the skinned vertices of an instance are. The place is known from `addInstance` on.
  Result<InstanceOutput> output(InstanceHandle instance) const;
  /// Fills `draws`, one for each of `instances`, for one indirect draw from the beginning of the
  /// output buffer. It needs the features drawIndirectFirstInstance and multiDrawIndirect. For
  /// instances with `culledOnGpu`, let what writes the visibility buffer set `instanceCount`, too:
  /// they are skinned in the same frame, while the count here lags behind, and stays 1. `indices`
  /// are the ranges of all meshes, by `MeshHandle::index`. Fails with `invalidArgument` if the
  /// sizes of both lists differ, for a mesh without a range, for a layout that is not interleaved
  /// and for one with another stride than the first; with `limitExceeded` for a first vertex beyond
  /// 2³¹ − 1. The message names the instance by its position in the list.
  Result<void> indexedDraws(std::span<const InstanceHandle> instances,
                            std::span<const IndexRange> indices,
                            std::span<IndexedDraw> draws) const;
  /// Instances that were skinned, in no particular order, without those culled on the GPU.
  std::span<const InstanceHandle> skinnedInstances() const;
  /// Instances of which only previous positions were written: they came to rest, or became
  /// visible in the same pose.
  std::span<const InstanceHandle> settledInstances() const;

  /// The exact box of the positions, from the newest complete frame that skinned the instance.
  /// Empty if there is no such frame, if `InstanceDescription::bounds` is false, or if
  /// `InstanceResult::box` is empty. For an instance that interpolates, it contains the previous
  /// positions, too, until a complete frame has settled or restarted them. If the GPU culls it, it
  /// may contain those before a restart that only the GPU knows of, for N frames.
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;

  /// The index of the instance's word in the visibility buffer (`culledOnGpu`), as long as it
  /// lives. Words of no such instance are not read.
  Result<std::uint32_t> visibilityIndex(InstanceHandle instance) const;
  /// Number of words in the visibility buffer: larger than every `visibilityIndex`. Grows when
  /// instances are added.
  std::uint32_t visibilityCount() const;

  /// Counts of the last frame, of the newest complete frame that was read back, and of memory.
  SceneStatistics statistics() const;

 private:
  friend struct SceneAccess;  // of the owners
  explicit Scene(std::unique_ptr<SceneBooks> books);
  SceneBooks& changed();
  std::unique_ptr<SceneBooks> books_;
};

// ---- A scene for an engine with its own RHI: the commands of each frame, and the buffers that
// they use.
//
//     SceneCommands commands = *SceneCommands::create(
//         {.limits = limits, .user = &rhi, .createBuffer = create, .releaseBuffer = release});
//     Scene& scene = commands.scene();
//
// and in each frame:
//
//     scene.beginFrame(frame, completedFrame);
//     ... add, remove, change, write poses ...
//     for (const Command& command : *commands.plan()) ...       // execute it
//     commands.commit();
//     draw from the buffer `commands.outputBuffer()` at scene.output(instance)
//
// The pipelines to build while loading are `pipelines(scene.pipelineNeeds(instance), limits,
// tuning)`; `vulkan::pipelineDescription` has each. Commands have the barriers between them; the
// engine adds those between `Use::dermis` and its own uses of the output. Buffers have numbers,
// which the scene chooses. The sample own_rhi of Dermis is such an engine.

/// A buffer that a scene asks for.
struct SceneBuffer {
  std::uint32_t number = 0;  ///< by which commands name it; no other buffer of the scene gets it
  BufferRole role = BufferRole::output;
  /// Its usage includes what the commands copy and upload; the engine adds its own, for example
  /// VERTEX_BUFFER for `output`.
  BufferRequirement requirement;
  /// Whether the scene writes it (`poses`) or reads it (`readBack`) through a mapping, if it gets
  /// one. The memory is then host-coherent, and for `readBack` host-cached if possible.
  bool isMapped = false;
};

/// What `SceneCommands::create` needs to know.
struct SceneCommandsDescription {
  SceneDescription scene;
  DeviceLimits limits;  ///< of the device
  Tuning tuning;

  // -- Required: two functions that create and release the buffers. Functions of the scene and of
  // its owner call them. They must not throw, and must not call the scene.
  void* user = nullptr;  ///< passed to both
  /// Creates a buffer, or reserves a part of one that the engine has. Returns the address of its
  /// first byte if it is mapped, otherwise null. If poses are not mapped, the plan uploads them; if
  /// a read-back buffer is not, the engine calls `SceneCommands::readBack`. If it fails, the scene
  /// asks for a smaller buffer, or the function of the scene fails with the same error. Memory for
  /// `readBack` is host-visible even so.
  Result<void*> (*createBuffer)(void* user, const SceneBuffer& buffer) = nullptr;
  /// Releases a buffer that no frame in flight uses. Buffers that remain when the owner is
  /// destroyed are not released.
  void (*releaseBuffer)(void* user, std::uint32_t number) = nullptr;

  /// Byte offset of the output in its buffer, if that is part of a larger one. Offsets in
  /// `InstanceOutput` count from the beginning of that buffer, those in commands from here. Must be
  /// a multiple of the alignment of the output, which need not be a power of two.
  std::uint64_t outputOffset = 0;
};

/// Owns a scene, and lists the commands of its frames. May be moved.
class DERMIS_CORE_API SceneCommands {
 public:
  /// Creates the first buffers. Fails with `invalidArgument` if a member of the description is not
  /// valid, with `limitExceeded` if an initial capacity needs a buffer larger than a storage buffer
  /// range, and with the error of `createBuffer`.
  static Result<SceneCommands> create(const SceneCommandsDescription& description);
  ~SceneCommands();
  SceneCommands(SceneCommands&&) noexcept;
  SceneCommands& operator=(SceneCommands&&) noexcept;

  /// As long as this object exists.
  Scene& scene() const;

  /// Lists the commands for everything that changed since the last `commit`. If nothing changed,
  /// there are none; but if instances are culled on the GPU, there are commands in every frame. May
  /// be called any number of times between `beginFrame` and `commit`. The list is valid until the
  /// next call of a function of the scene or of this object. Fails with `invalidArgument` if
  /// `beginFrame` was not called, with `limitExceeded` if the tables are larger than a storage
  /// buffer range, and with the error of `createBuffer`.
  ///
  /// `tables`: optional memory for the bytes of the first `UploadCommand`, for example a mapped
  /// staging buffer that no frame in flight uses. This saves copying them. They start where this
  /// memory starts, unless there are too many: then `UploadCommand::bytes` is elsewhere. This
  /// memory is read only if it turns out to be too small.
  Result<std::span<const Command>> plan(std::span<std::byte> tables = {});
  /// States that the commands of the last `plan` have been recorded, and will be executed in the
  /// order of frames. Without it, the next `plan` lists the same work again. Fails with
  /// `invalidArgument` if there is no plan, or if the scene was changed after it.
  Result<void> commit();
  /// For read-back buffers that are not mapped: reads the results of a complete frame. Call it
  /// after `beginFrame`, for each complete frame in ascending order. Boxes of a frame that is left
  /// out are missing until the instance is skinned again; twice if it interpolates. `bytes` are
  /// those of the buffer that the commands of the frame copied to; empty if they copied nothing.
  /// Fails with `invalidArgument` if the frame is not complete, not newer than the last one that
  /// was read back, or not one of the last `framesInFlight` that were committed, and if `bytes` is
  /// smaller than what was copied.
  Result<void> readBack(std::uint64_t frame, std::span<const std::byte> bytes);

  /// The number of the output buffer as of the last `commit`. It changes when the output grows;
  /// offsets stay the same.
  std::uint32_t outputBuffer() const;
  /// Where the joint matrices of a pose are that a GPU pass of the engine writes, or that belongs
  /// to a figure. The place stays the same until the pose is removed. Fails with `invalidArgument`
  /// for a pose that the CPU writes.
  Result<BufferPart> posePart(PoseHandle pose) const;
  /// Where the morph weights of an instance are that a GPU pass of the engine writes: a float for
  /// each target of its mesh that no rig drives. The place stays the same until the instance is
  /// removed. Fails with `invalidArgument` for an instance whose weights the CPU writes.
  Result<BufferPart> weightsPart(InstanceHandle instance) const;
  /// Where the joints are that the rig of a pose drives, and behind them all its weights, a float
  /// each; of a pose that was needed. The place stays the same until the pose is removed. Fails
  /// with `invalidArgument` for a pose without a rig.
  Result<BufferPart> drivenPart(PoseHandle pose) const;

 private:
  SceneCommands();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis
