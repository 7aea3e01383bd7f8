// Skinning for a whole scene: meshes, poses and instances by handle, that come, go and move as
// they like while frames are in flight. It owns the memory and keeps the books; the engine owns the
// device, the command buffer and the clock. Built on plan.h and `Context`, which an engine that has
// memory and instances of its own uses directly.
//
// One frame:
//
//   system.beginFrame(frame, completedFrame);      // counted by the engine; no fence of ours
//   std::span<JointMatrix> matrices = *system.writePose(pose);   // for those that moved
//   ... add, remove, setVisible, setMorphWeights ...
//   system.record(commandBuffer);                  // with the engine's barriers around it
//   draw from system.outputBuffer() at system.output(instance)
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <vulkan/vulkan_core.h>

#include "dermis/handle.h"
#include "dermis/instance.h"
#include "dermis/mesh.h"
#include "dermis/pack.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/types.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/memory.h"

namespace dermis::vulkan {

/// How much a system may hold, and of what. Budgets are taken from memory when the system is made.
struct SkinningSystemDescription {
  /// Borrowed: it, or the Context that it is moved to, must outlive the system.
  Context* context = nullptr;
  /// Frames that the engine records ahead of the GPU: `beginFrame(f)` comes after frame
  /// f - framesInFlight is complete. 1 or more.
  std::uint32_t framesInFlight = 2;

  std::uint64_t meshBudget = std::uint64_t{32} << 20;    ///< bytes of packed meshes; at most a
                                                         ///< storage buffer range
  std::uint32_t jointBudget = 65536;                     ///< joints of all poses together
  std::uint64_t outputBudget = std::uint64_t{64} << 20;  ///< bytes of skinned vertices; may be more
                                                         ///< than a storage buffer range
  std::uint32_t instanceBudget = 65536;  ///< instances that there may be at one time
  std::uint32_t boundsBudget = 16384;    ///< those of them with bounds, or positions in snorm16; 32
                                         ///< bytes each
  /// How the output is used besides, by the engine: VK_BUFFER_USAGE_VERTEX_BUFFER_BIT, or that and
  /// `buildInputUsage`.
  VkBufferUsageFlags outputUsage = VK_BUFFER_USAGE_VERTEX_BUFFER_BIT;

  /// Both functions, or none: then memory is taken from the device in blocks of 64 MiB or more.
  MemoryCallbacks memory;
  /// Measure the GPU's time of each `record` by timestamps; the queue's family must have them.
  bool measuresGpuTime = false;
  std::optional<Tuning> tuning;  ///< nothing: `Context::tuning`
};

struct FrameDescription {
  /// For instances that are `culledOnGpu`: `SkinningSystem::instanceCapacity` words, the one at
  /// `visibilityIndex` of an instance not 0 where it is visible. The engine's culling writes it on
  /// the GPU, before `record`, with a barrier `inputScope(PreviousUse::computeWrite)`. A multiple
  /// of the device's minStorageBufferOffsetAlignment.
  VkBuffer visibility = VK_NULL_HANDLE;
  VkDeviceSize visibilityOffset = 0;
};

/// What the last `record` did.
struct FrameStatistics : FrameWorkStatistics {
  std::uint32_t dispatches = 0;     ///< all of them, indirect ones too
  std::uint64_t workgroups = 0;     ///< of direct dispatches
  std::uint32_t copies = 0;         ///< commands that copy: tables, meshes, moves, results
  std::uint64_t uploadedBytes = 0;  ///< tables, meshes and joint matrices
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
  std::uint64_t deviceMemory = 0;  ///< bytes asked of the memory callbacks, of every use
};

/// One thread at a time may call a member function; the memory that `writePose` returns may be
/// written by any thread until `record`. Nothing here submits, waits or touches a queue.
///
/// All frames are recorded for queues of which each begins when the last is done, in the order of
/// `record`: mostly, one queue.
class SkinningSystem {
 public:
  /// Takes the budgets from memory. Fails with `invalidArgument` (a description that makes no
  /// sense, by its field), `limitExceeded` (a budget larger than the device can bind),
  /// `missingEntryPoint`, `vulkanError`, or what `MemoryCallbacks::allocate` fails with.
  static Result<SkinningSystem> create(const SkinningSystemDescription& description);

  /// Every frame recorded must be complete.
  ~SkinningSystem();
  SkinningSystem(SkinningSystem&&) noexcept;
  SkinningSystem& operator=(SkinningSystem&&) noexcept;

  // -- Meshes, poses, instances: add and remove at any time. What goes is given free when the
  // frame that was last begun is complete. Calls with a stale handle fail with `invalidArgument`.

  /// The bytes are copied; `record` brings them to the GPU. Fails with `limitExceeded` where the
  /// budget has no room.
  Result<MeshHandle> addMesh(const PackedMesh& mesh);
  /// Fails with `invalidArgument` while an instance uses it.
  Result<void> removeMesh(MeshHandle mesh);

  /// A pose of so many joints, which rests in the identity until it is written.
  /// `mayScale` as in `PoseDescription`.
  Result<PoseHandle> addPose(std::uint32_t jointCount, bool mayScale = true);
  /// Fails with `invalidArgument` while an instance uses it.
  Result<void> removePose(PoseHandle pose);

  /// Skinned for the first time by the next `record`. Fails with `invalidArgument` where the
  /// description breaks a rule of `Job`, with `missingFeature` or `limitExceeded` as `makePlan`
  /// does, and with `limitExceeded` if a budget has no room for it; nothing changes then. `compact`
  /// may make room in the output.
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  Result<void> removeInstance(InstanceHandle instance);

  /// As `Context::prepare`, with the system's tuning. May be called by any thread at any time.
  Result<void> prepare(const PipelineNeeds& needs) const;

  // -- What changes.

  /// Begins a frame: `frame` is larger than that of the last time, `completedFrame` the newest one
  /// that the GPU is done with, 0 where there is none; frames count from 1. Takes back what
  /// complete frames used. Fails with `invalidArgument` where more frames are in flight than were
  /// described, or numbers run backwards.
  Result<void> beginFrame(std::uint64_t frame, std::uint64_t completedFrame);

  /// Where to write the joint matrices of this frame: mapped memory, to be written as a whole and
  /// never read; until `record`. Only after `beginFrame`. Instances of the pose are skinned
  /// again; calling it is what makes them.
  Result<std::span<JointMatrix>> writePose(PoseHandle pose);

  /// What is invisible is neither skinned nor settled; when it comes back, its previous positions
  /// are its current ones. Instances begin visible.
  Result<void> setVisible(InstanceHandle instance, bool isVisible);
  Result<void> setUpdateInterval(InstanceHandle instance, std::uint32_t interval);
  /// Previous positions do not reach back beyond the next time that it is skinned, which is now,
  /// whatever its interval.
  Result<void> teleport(InstanceHandle instance);
  /// The active targets, as `Job::morphs`. They are copied.
  Result<void> setMorphWeights(InstanceHandle instance, std::span<const MorphWeight> morphs);
  /// The same instance with another mesh (a level of detail): its output moves, its motion
  /// restarts. Its morph weights stay where both meshes have as many targets; otherwise they are
  /// gone. The old output stays until frames in flight are complete, so there must be room for
  /// both: if not, it fails with `limitExceeded`, and the instance keeps its mesh.
  Result<void> setMesh(InstanceHandle instance, MeshHandle mesh);

  /// Moves outputs from the end of the output buffer into gaps before them, at most so many bytes,
  /// with the next `record`; returns how many it will move. What is drawn from meanwhile stays
  /// where it is until complete.
  std::uint64_t compact(std::uint64_t maxBytes);

  // -- Recording.

  /// Records uploads and dispatches for all that changed since the last time, and the barriers
  /// between them; nothing where nothing did. Once a frame, after `beginFrame`, outside a render
  /// pass. The engine puts `inputScope(PreviousUse)` of what last read the output before it, and
  /// `outputScope(Consumer)` behind.
  ///
  /// Fails with `notPrepared` (`prepare` was not called for such instances), `invalidArgument` (no
  /// `beginFrame`; instances culled on the GPU but no visibility), `limitExceeded` (tables larger
  /// than a storage buffer range), `vulkanError`, or what `MemoryCallbacks::allocate` fails with;
  /// nothing is recorded then, and all that changed is tried again the next time.
  Result<void> record(VkCommandBuffer commandBuffer, const FrameDescription& frame = {});

  // -- What came of it, as of the last `record`.

  /// One buffer for all outputs; the same for as long as the system lives.
  VkBuffer outputBuffer() const;
  /// Before the first `record` that displays the instance its size is 0.
  Result<InstanceOutput> output(InstanceHandle instance) const;

  /// What was skinned, in no order: vertices, bounds, and whatever was built from them is new.
  /// Without those culled on the GPU.
  std::span<const InstanceHandle> skinnedInstances() const;
  /// Those of which only previous positions changed: they have come to rest, or come back into view
  /// in the pose in which they left it.
  std::span<const InstanceHandle> settledInstances() const;
  /// Those whose output stands elsewhere than before.
  std::span<const InstanceHandle> movedInstances() const;

  /// The exact box of the positions as they were in the newest complete frame; nothing before the
  /// first, and where there is none (`InstanceResult::box`).
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;

  std::uint32_t instanceCapacity() const;  ///< the instance budget: larger than every
                                           ///< `visibilityIndex`
  Result<std::uint32_t> visibilityIndex(InstanceHandle instance) const;

  SystemStatistics statistics() const;

 private:
  SkinningSystem();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis::vulkan
