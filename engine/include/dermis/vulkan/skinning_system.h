// Skins a whole scene on the GPU: meshes, poses and instances, each with a handle, which may be
// added, removed and changed while frames are in flight. A SkinningSystem contains a Scene
// (scene.h) and owns the buffers. The engine owns the device and the command buffers. An engine
// that manages its own buffers and instances uses `Context` and plan.h instead.
//
// One frame:
//
//     system.beginFrame(frame, completedFrame);      // frame numbers of the engine
//     std::span<JointMatrix> matrices = *system.writePose(pose);   // for each pose that changes
//     ... add, remove, change ...
//     system.record(commandBuffer);                  // with the engine's barriers before and after
//     draw from system.outputBuffer() at system.output(instance)
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "dermis/export.h"
#include "dermis/handle.h"
#include "dermis/mesh.h"
#include "dermis/pack.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/types.h"
#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/buffer_callbacks.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/handles.h"

namespace dermis::vulkan {

/// A part of a buffer that the CPU writes.
struct MappedRange {
  BufferRange range;
  /// Address of the first byte of the range. The memory is host-coherent and stays mapped.
  void* mapped = nullptr;
};

/// What `SkinningSystem::create` needs to know.
struct SkinningSystemDescription {
  /// Required, not owned. The Context must outlive the system, but may be moved.
  Context* context = nullptr;
  // -- As in `SceneDescription`.
  std::uint32_t framesInFlight = 2;
  Capacity meshCapacity = SceneDescription().meshCapacity;  ///< bytes
  Capacity jointCapacity = SceneDescription().jointCapacity;
  Capacity gpuJointCapacity = SceneDescription().gpuJointCapacity;
  Capacity outputCapacity = SceneDescription().outputCapacity;  ///< bytes
  Capacity instanceCapacity = SceneDescription().instanceCapacity;
  Capacity boundsCapacity = SceneDescription().boundsCapacity;

  // -- Optional: parts of buffers that the engine owns. If one is not set, the system creates the
  // buffer. `SkinningSystem::requirement` returns the usage and alignment that a range needs. A
  // range does not grow: its size is the capacity, and the capacity above is ignored. Dermis reads
  // and writes nothing outside the range. The engine destroys the buffer after the system.
  BufferRange meshes;
  MappedRange poses;     ///< for poses that the CPU writes
  BufferRange gpuPoses;  ///< for poses that a GPU pass of the engine writes
  BufferRange output;
  /// What the engine uses the output buffer for, if the system creates it. For example
  /// `vertexBufferUsage`, or that with `buildInputUsage` (acceleration_structure.h).
  VkBufferUsageFlags outputUsage = vertexBufferUsage;

  /// Create and destroy all other buffers. Set both functions or none. Buffers are created by
  /// `SkinningSystem::create`, by functions that add something, by `change`, and by `record` if a
  /// frame needs larger buffers for tables, read-back or culling. If not set, the system allocates
  /// memory blocks: small ones first, and at most 64 MiB each unless one buffer is larger.
  BufferCallbacks buffers;
  /// Whether the GPU time of each `record` is measured with timestamps. The queue family must
  /// support them.
  bool measuresGpuTime = false;
  std::optional<Tuning> tuning;  ///< if empty: `Context::tuning`
};

/// What `SkinningSystem::record` needs to know.
struct FrameDescription {
  /// Required if instances are `culledOnGpu`: a buffer with VK_BUFFER_USAGE_STORAGE_BUFFER_BIT that
  /// holds `SkinningSystem::visibilityCount` words of 4 bytes. An instance is visible if the word
  /// at its `visibilityIndex` is not 0. The engine's culling writes them on the GPU before
  /// `record`, with the barrier `barrierBetween(Use::computeWrite, Use::dermis)` in between.
  VkBuffer visibility{};
  /// Bytes; a multiple of the device's minStorageBufferOffsetAlignment. This is not checked.
  VkDeviceSize visibilityOffset = 0;
};

/// What the last `record` did.
struct FrameStatistics : FrameWorkStatistics {
  std::uint32_t dispatches = 0;     ///< direct and indirect
  std::uint64_t workgroups = 0;     ///< of direct dispatches
  std::uint32_t copies = 0;         ///< copy commands: tables, meshes, moved outputs, results
  std::uint64_t uploadedBytes = 0;  ///< tables, meshes and `poseBytes`
  double planSeconds = 0;           ///< CPU time to plan the frame and write its tables
  double recordSeconds = 0;         ///< CPU time to record the commands
};

/// What the GPU did in the newest complete frame.
struct GpuStatistics : CullingStatistics {
  std::optional<double> seconds;  ///< GPU time, if `measuresGpuTime`
};

/// What `SkinningSystem::statistics` returns.
struct SystemStatistics {
  FrameStatistics lastFrame;
  GpuStatistics lastCompletedFrame;
  StoreStatistics meshes, palettes, outputs;
  /// Bytes of the memory blocks. With `BufferCallbacks`: bytes of all buffers that they created.
  std::uint64_t deviceMemory = 0;
};

/// A scene and the buffers for it. It does not submit, wait, or use a queue.
///
/// One thread at a time may call a member function, except for `prepare` with `PipelineNeeds`,
/// which any thread may call. Any thread may write the memory that `writePose` returns, until
/// `record`.
///
/// The GPU must execute all frames one after the other, in the order of `record`; usually they are
/// on one queue. The engine's own shaders cannot read the palettes of a system: use `Context` and
/// plan.h for that.
class DERMIS_VULKAN_API SkinningSystem {
 public:
  /// Creates the buffers with their initial capacities. Fails with `invalidArgument` or
  /// `limitExceeded` as `Scene::create` does, with `missingEntryPoint`, with `vulkanError`, or with
  /// the error of `BufferCallbacks::create`.
  static Result<SkinningSystem> create(const SkinningSystemDescription& description);

  /// Call it before `create`, to find out what a range of the engine needs. `role` is `meshes`,
  /// `poses`, `gpuPoses` or `positions` (the output). Returns usage and alignment, and the size for
  /// the initial capacity in `description`. The alignment of the output need not be a power of two.
  /// For other roles it returns the initial requirement; tables and upload have size 0, since their
  /// size depends on the frame. Creates nothing. Fails as `Scene::create` does, and with
  /// `invalidArgument` if `context` is null.
  static Result<BufferRequirement> requirement(const SkinningSystemDescription& description,
                                               BufferRole role);

  /// The GPU must have completed every recorded frame.
  ~SkinningSystem();
  SkinningSystem(SkinningSystem&&) noexcept;
  SkinningSystem& operator=(SkinningSystem&&) noexcept;

  // -- Meshes, poses, instances: as in `Scene` (scene.h), with `record` in the place of `plan` and
  // `commit`.
  //
  // Adding something may make a buffer grow. The larger buffer is created at once, for twice the
  // size, or for the minimum if there is no memory for that. If there is no memory for the minimum
  // either, the function fails with `vulkanError` or with the error of `BufferCallbacks::create`.
  // The next `record` copies the contents of the old buffer. The old buffer is destroyed once the
  // frames that use it are complete.

  /// As `Scene::addMesh`. Copies the bytes; the next `record` uploads them.
  Result<MeshHandle> addMesh(const PackedMesh& mesh);
  /// As `Scene::removeMesh`.
  Result<void> removeMesh(MeshHandle mesh);
  /// As `Scene::addPose`. All joint matrices are identities until `writePose`. For a pose that the
  /// GPU writes, they are undefined until a pass of the engine writes them.
  Result<PoseHandle> addPose(std::uint32_t jointCount, const PoseOptions& options = {});
  /// As `Scene::addPoses`, and as `addPose`.
  Result<void> addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                        const PoseOptions& options = {});
  /// As `Scene::removePose`.
  Result<void> removePose(PoseHandle pose);
  /// As `Scene::addInstance`.
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  /// As `Scene::removeInstance`.
  Result<void> removeInstance(InstanceHandle instance);

  /// As `Context::prepare`, with the tuning of the system. Any thread may call it at any time.
  Result<void> prepare(const PipelineNeeds& needs) const;
  /// Builds only the pipelines that this instance can need with its mesh, pose and method: the
  /// fastest start. Fails as `Scene::pipelineNeeds` does, too. It reads the scene, so no other
  /// thread may change the scene at the same time.
  Result<void> prepare(const InstanceDescription& instance) const;

  // -- What changes: as in `Scene`.

  /// As `Scene::beginFrame`. Also reads back the results of complete frames, for `bounds` and
  /// `statistics`.
  Result<void> beginFrame(std::uint64_t frame, std::uint64_t completedFrame);
  /// As `Scene::writePose`. Returns mapped memory for the joint matrices of this frame. The engine
  /// writes all of it before `record`, and never reads it.
  Result<std::span<JointMatrix>> writePose(PoseHandle pose);
  /// Where a GPU pass of the engine writes the joint matrices of a pose: consecutive `JointMatrix`,
  /// 48 bytes each. The range stays the same until the pose is removed. Poses of one call of
  /// `addPoses` are consecutive in one buffer, and the offset of the first is a multiple of
  /// minStorageBufferOffsetAlignment, so that it can be bound. Poses of different calls may be in
  /// different buffers. A buffer that the system created has VK_BUFFER_USAGE_STORAGE_BUFFER_BIT and
  /// VK_BUFFER_USAGE_TRANSFER_DST_BIT.
  ///
  /// The engine records the barrier `barrierBetween(Use::dermis, Use::computeWrite)`, as frames in
  /// flight may still read the matrices, then its pass, then the barrier
  /// `barrierBetween(Use::computeWrite, Use::dermis)`; and it calls `markWritten`. Fails with
  /// `invalidArgument` for a pose that the CPU writes.
  Result<BufferRange> poseRange(PoseHandle pose) const;
  /// As `Scene::markWritten`.
  Result<void> markWritten(std::span<const PoseHandle> poses);
  /// As `Scene::markAllWritten`.
  Result<void> markAllWritten();
  /// As `Scene::change`.
  Result<void> change(const InstanceChange& change);
  /// As `Scene::change`.
  Result<void> change(std::span<const InstanceChange> changes);
  /// As `Scene::setVisibility`.
  Result<void> setVisibility(std::span<const InstanceVisibility> instances);
  /// As `Scene::isDue`.
  Result<bool> isDue(InstanceHandle instance) const;
  /// As `Scene::compact`.
  std::uint64_t compact(std::uint64_t maxBytes);

  // -- Recording.

  /// Records the uploads and the commands of the frame (`Scene::plan`), with the barriers between
  /// them. Records nothing if nothing changed and no instance is culled on the GPU. Call it once
  /// after each `beginFrame`, outside a render pass, with a primary or secondary command buffer.
  /// Before it the engine records the barrier from the last use of the output to `Use::dermis`, and
  /// after it the barrier from `Use::dermis` to the next use (barrier.h).
  ///
  /// Fails with
  /// - `notPrepared` if `prepare` was not called for such instances;
  /// - `invalidArgument` if `beginFrame` was not called, or if instances are culled on the GPU and
  ///   `FrameDescription::visibility` is null;
  /// - `limitExceeded` if the tables are larger than a storage buffer range;
  /// - `vulkanError`, or the error of `BufferCallbacks::create`.
  ///
  /// If it fails, nothing is recorded, and the next `record` does all of the work.
  Result<void> record(VkCommandBuffer commandBuffer, const FrameDescription& frame = {});

  /// States that the engine did not submit the commands of the last `record`, and never will. The
  /// command buffer may be reset or freed at once, and the frame does not count as in flight.
  /// Undoes what `record` did: the next `record` does the work again, uploads included. Everything
  /// that was added, removed, changed or written remains, whether before that `record` or after it.
  /// The engine writes and marks again the poses that its GPU passes wrote for the frame.
  /// Afterwards the system is in the same frame, as after `beginFrame`: the engine may `record` it
  /// again, or begin another frame. O(instances).
  ///
  /// Call it for every frame that is recorded and not submitted, before the next `beginFrame`.
  /// Otherwise the system assumes that the frame was executed once a later frame is complete. Fails
  /// with `invalidArgument` if `frame` is not the one that was recorded last, or if `beginFrame`
  /// was called since.
  Result<void> abandonFrame(std::uint64_t frame);

  // -- Results, as of the last `record`: as in `Scene`.

  /// The buffer that holds all outputs: one that the system created, or the buffer of
  /// `SkinningSystemDescription::output`. Offsets of outputs count from its beginning.
  VkBuffer outputBuffer() const;
  /// A number that changes whenever `outputBuffer` becomes another buffer: when it grew, or when
  /// the frame in which it grew was abandoned. Offsets stay the same when it grows.
  std::uint64_t outputGeneration() const;
  /// As `Scene::output`.
  Result<InstanceOutput> output(InstanceHandle instance) const;
  /// As `Scene::skinnedInstances`.
  std::span<const InstanceHandle> skinnedInstances() const;
  /// As `Scene::settledInstances`.
  std::span<const InstanceHandle> settledInstances() const;
  /// As `Scene::movedInstances`.
  std::span<const InstanceHandle> movedInstances() const;
  /// As `Scene::bounds`. `beginFrame` reads back the frames that the GPU has completed.
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;
  /// As `Scene::visibilityCount`.
  std::uint32_t visibilityCount() const;
  /// As `Scene::visibilityIndex`.
  Result<std::uint32_t> visibilityIndex(InstanceHandle instance) const;
  /// As `Scene::statistics`, with times and counts of the recorded commands.
  SystemStatistics statistics() const;

 private:
  SkinningSystem();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis::vulkan
