// Skinning for a whole scene: meshes, poses and instances by handle. They may come, go and change
// while frames are in flight. A SkinningSystem has a Scene (scene.h) and its buffers; the engine
// has the device and the command buffer. It is built on plan.h and `Context`, which an engine with
// its own buffers and instances uses directly.
//
// One frame:
//
//   system.beginFrame(frame, completedFrame);      // the engine's own count of frames
//   std::span<JointMatrix> matrices = *system.writePose(pose);   // for poses that change
//   ... add, remove, change ...
//   system.record(commandBuffer);                  // with the engine's barriers around it
//   draw from system.outputBuffer() at system.output(instance)
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
  void* mapped = nullptr;  ///< the address of its first byte; host-coherent, and stays mapped
};

struct SkinningSystemDescription {
  /// Borrowed: it, or the Context that it is moved to, must outlive the system.
  Context* context = nullptr;
  /// This and the capacities: as those of `SceneDescription`.
  std::uint32_t framesInFlight = 2;
  Capacity meshCapacity = SceneDescription().meshCapacity;  ///< bytes
  Capacity jointCapacity = SceneDescription().jointCapacity;
  Capacity gpuJointCapacity = SceneDescription().gpuJointCapacity;
  Capacity outputCapacity = SceneDescription().outputCapacity;  ///< bytes
  Capacity instanceCapacity = SceneDescription().instanceCapacity;
  Capacity boundsCapacity = SceneDescription().boundsCapacity;

  // -- Ranges of the engine's buffers. `SkinningSystem::requirement` tells their usage and
  // alignment, which for the output need not be a power of two. A range does not grow: its size is
  // the capacity, and the one above is not used. Dermis uses nothing outside of it. The engine
  // destroys the buffer after the system. Without a range the system creates a buffer, and without
  // joints at first the one for poses with the first pose.
  BufferRange meshes;
  MappedRange poses;     ///< that the CPU writes
  BufferRange gpuPoses;  ///< that a pass of the engine writes
  BufferRange output;
  /// How the engine uses the output buffer if the system creates it:
  /// VK_BUFFER_USAGE_VERTEX_BUFFER_BIT, or that and `buildInputUsage`.
  VkBufferUsageFlags outputUsage = vertexBufferUsage;

  /// How all other buffers are created: by `create`, by what is added, and by `record` (tables, and
  /// what is copied to and from them, until a frame needs no more than those before it). Both
  /// functions, or none: then the system allocates blocks of memory, small ones first, of at most
  /// 64 MiB where no buffer is larger.
  BufferCallbacks buffers;
  /// Measure the GPU time of each `record` with timestamps. The queue's family must support them.
  bool measuresGpuTime = false;
  std::optional<Tuning> tuning;  ///< nothing: `Context::tuning`
};

struct FrameDescription {
  /// For instances that are `culledOnGpu`: `SkinningSystem::instanceCapacity` words, in a buffer
  /// with VK_BUFFER_USAGE_STORAGE_BUFFER_BIT. The word at `visibilityIndex` of an instance is not 0
  /// if it is visible. The engine's culling writes it on the GPU, before `record`, with a barrier
  /// `inputScope(PreviousUse::computeWrite)`. `visibilityOffset` is a multiple of the device's
  /// minStorageBufferOffsetAlignment, which is not checked.
  VkBuffer visibility{};
  VkDeviceSize visibilityOffset = 0;
};

/// What the last `record` did.
struct FrameStatistics : FrameWorkStatistics {
  std::uint32_t dispatches = 0;     ///< all of them, indirect ones too
  std::uint64_t workgroups = 0;     ///< of direct dispatches
  std::uint32_t copies = 0;         ///< commands that copy: tables, meshes, moves, results
  std::uint64_t uploadedBytes = 0;  ///< tables, meshes, `poseBytes`
  double planSeconds = 0;           ///< CPU time: choosing, and writing the tables
  double recordSeconds = 0;         ///< CPU time: the commands
};

/// What the GPU did in the newest complete frame.
struct GpuStatistics : CullingStatistics {
  std::optional<double> seconds;  ///< if `measuresGpuTime`
};

struct SystemStatistics {
  FrameStatistics lastFrame;
  GpuStatistics lastCompletedFrame;
  StoreStatistics meshes, palettes, outputs;
  /// Bytes of the memory blocks; with `BufferCallbacks`, of all buffers that these created.
  std::uint64_t deviceMemory = 0;
};

/// One thread at a time may call a member function, except
/// `prepare` with `PipelineNeeds`. Any thread may write the
/// memory that `writePose` returns, until `record`. Nothing here submits, waits or touches a queue.
///
/// All frames are recorded for queues that execute them one after the other, in the order of
/// `record`: usually one queue. Palettes of a system cannot be read by the engine's own shaders:
/// use tier 1 for that.
class DERMIS_VULKAN_API SkinningSystem {
 public:
  /// Creates the buffers with their initial capacities. Fails with `invalidArgument` or
  /// `limitExceeded` as `Scene::create`, with `missingEntryPoint`, `vulkanError`, or what
  /// `BufferCallbacks::create` fails with.
  static Result<SkinningSystem> create(const SkinningSystemDescription& description);

  /// What a range of the engine's needs, for `meshes`, `poses`, `gpuPoses` and `positions` (the
  /// output): usage, alignment, and the size of the capacity in `description`, in which the range
  /// is then set. Of other roles: what the system will create at first; tables and uploads as large
  /// as needed later. Creates nothing. Fails as `Scene::create`.
  static Result<BufferRequirement> requirement(const SkinningSystemDescription& description,
                                               BufferRole role);

  /// Every recorded frame must be complete.
  ~SkinningSystem();
  SkinningSystem(SkinningSystem&&) noexcept;
  SkinningSystem& operator=(SkinningSystem&&) noexcept;

  // -- Meshes, poses, instances: as those of `Scene` (scene.h). What is said there of `plan` and
  // `commit` is true of `record`.

  // What is added may make a buffer grow: a larger one is created at once, and the next `record`
  // copies what the old one holds. The old one is destroyed when the frames that use it are
  // complete. If there is no memory for twice the size, the least that is needed is tried; if there
  // is none for that, the call fails with `vulkanError`, or what `BufferCallbacks::create` fails
  // with.

  /// Copies the bytes; the next `record` uploads them.
  Result<MeshHandle> addMesh(const PackedMesh& mesh);
  Result<void> removeMesh(MeshHandle mesh);
  /// All joint matrices are the identity until `writePose`. Those of a pose that the GPU writes are
  /// undefined until a pass of the engine writes them.
  Result<PoseHandle> addPose(std::uint32_t jointCount, const PoseOptions& options = {});
  Result<void> addPoses(std::span<PoseHandle> poses, std::uint32_t jointCount,
                        const PoseOptions& options = {});
  Result<void> removePose(PoseHandle pose);
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  Result<void> removeInstance(InstanceHandle instance);

  /// As `Context::prepare`, with the system's tuning. May be called by any thread at any time.
  Result<void> prepare(const PipelineNeeds& needs) const;
  /// Only what `Scene::pipelineNeeds` tells for this instance: the fastest start. Fails as that,
  /// too. Reads the scene: not while another thread changes it.
  Result<void> prepare(const InstanceDescription& instance) const;

  // -- What changes: as `Scene`.

  /// Also reads back what complete frames found out: `bounds`, `statistics`.
  Result<void> beginFrame(std::uint64_t frame, std::uint64_t completedFrame);
  /// Where to write the joint matrices of this frame: mapped memory, to be written as a whole and
  /// never read, until `record`.
  Result<std::span<JointMatrix>> writePose(PoseHandle pose);
  /// Where a pass of the engine writes the joint matrices of a pose that the GPU writes:
  /// `JointMatrix` by `JointMatrix`, 48 bytes each. The same as long as the pose lives. Poses of
  /// one call of `addPoses` are in one buffer, one behind the other, and the first of them can be
  /// bound: its offset is a multiple of minStorageBufferOffsetAlignment. Other calls may use other
  /// buffers. A buffer of the system's own has VK_BUFFER_USAGE_STORAGE_BUFFER_BIT and
  /// VK_BUFFER_USAGE_TRANSFER_DST_BIT.
  ///
  /// Before its writes the engine records a barrier `overwriteScope(Writer::compute)`, since frames
  /// in flight may still read them, after them `inputScope(PreviousUse::computeWrite)`, and calls
  /// `markWritten`. Fails with `invalidArgument` for a pose that the CPU writes.
  Result<BufferRange> poseRange(PoseHandle pose) const;
  Result<void> markWritten(std::span<const PoseHandle> poses);
  Result<void> markAllWritten();
  Result<void> change(const InstanceChange& change);
  Result<void> change(std::span<const InstanceChange> changes);
  Result<void> setVisibility(std::span<const InstanceVisibility> instances);
  Result<bool> isDue(InstanceHandle instance) const;
  std::uint64_t compact(std::uint64_t maxBytes);

  // -- Recording.

  /// Records uploads and the commands of the frame (`Scene::plan`), with the barriers between them;
  /// nothing if nothing changed and no instance is culled on the GPU. Once after each `beginFrame`,
  /// outside a render pass, with a primary or secondary command buffer. The engine records a
  /// barrier `inputScope(PreviousUse)` of what last used the output before it, and
  /// `outputScope(Consumer)` after it.
  ///
  /// Fails with `notPrepared` (`prepare` was not called for such instances), `invalidArgument` (no
  /// `beginFrame`; instances culled on the GPU without `FrameDescription::visibility`),
  /// `limitExceeded` (tables larger than a storage buffer range), `vulkanError`, or what
  /// `BufferCallbacks::create` fails with. Nothing is recorded then, and the next `record` does all
  /// of it.
  Result<void> record(VkCommandBuffer commandBuffer, const FrameDescription& frame = {});

  /// The engine did not submit what the last `record` recorded, and never will: that command buffer
  /// may be reset or freed at once. What `record` did is undone, and the next one does all of it
  /// again, uploads included. What was added, removed, changed or written, before that `record` or
  /// after it, stays; poses that the GPU writes are written and marked again. It is then as after
  /// `beginFrame`: the engine may `record` the same frame again, or begin another one. The frame
  /// does not count as in flight. O(instances).
  ///
  /// To be called for every frame that is recorded and not submitted, before the next `beginFrame`:
  /// if not, the system takes it for executed as soon as a later frame is complete. Fails with
  /// `invalidArgument` if `frame` is not the one that was recorded last, or if another has begun.
  Result<void> abandonFrame(std::uint64_t frame);

  // -- Results, as of the last `record`: as `Scene`.

  /// All outputs are in this buffer: the system's own, or that of
  /// `SkinningSystemDescription::output`. Offsets count from its beginning.
  VkBuffer outputBuffer() const;
  /// Differs from what it was if `outputBuffer` is another buffer: it grew, or the frame in which
  /// it grew was abandoned. All offsets stay when it grows.
  std::uint64_t outputGeneration() const;
  Result<InstanceOutput> output(InstanceHandle instance) const;
  std::span<const InstanceHandle> skinnedInstances() const;
  std::span<const InstanceHandle> settledInstances() const;
  std::span<const InstanceHandle> movedInstances() const;
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;
  /// Larger than every `visibilityIndex`. It grows when instances are added.
  std::uint32_t instanceCapacity() const;
  Result<std::uint32_t> visibilityIndex(InstanceHandle instance) const;
  SystemStatistics statistics() const;

 private:
  SkinningSystem();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis::vulkan
