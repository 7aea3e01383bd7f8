// Skinning for a whole scene: meshes, poses and instances by handle. They may come, go and change
// while frames are in flight. A SkinningSystem has a Scene (scene.h) and its buffers; the engine
// has the device and the command buffer. It is built on plan.h and `Context`, which an engine with
// its own buffers and instances uses directly.
//
// One frame:
//
//   system.beginFrame(frame, completedFrame);      // the engine's own count of frames
//   std::span<JointMatrix> matrices = *system.writePose(pose);   // for poses that change
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
#include "dermis/mesh.h"
#include "dermis/pack.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/types.h"
#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/memory.h"

namespace dermis::vulkan {

/// The usage that Dermis needs of `SkinningSystemDescription::output`.
inline constexpr VkBufferUsageFlags outputRangeUsage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                                                       VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                                                       VK_BUFFER_USAGE_TRANSFER_DST_BIT;

/// What a system can hold. Its buffers keep their size.
struct SkinningSystemDescription {
  /// Borrowed: it, or the Context that it is moved to, must outlive the system.
  Context* context = nullptr;
  /// As `SceneDescription::framesInFlight`, and so are the budgets.
  std::uint32_t framesInFlight = 2;
  std::uint64_t meshBudget = std::uint64_t{32} << 20;    ///< bytes
  std::uint32_t jointBudget = 65536;                     ///< joints of all poses together
  std::uint64_t outputBudget = std::uint64_t{64} << 20;  ///< bytes
  std::uint32_t instanceBudget = 65536;
  std::uint32_t boundsBudget = 16384;
  /// How the engine uses the output buffer that the system creates:
  /// VK_BUFFER_USAGE_VERTEX_BUFFER_BIT, or that and `buildInputUsage`.
  VkBufferUsageFlags outputUsage = VK_BUFFER_USAGE_VERTEX_BUFFER_BIT;
  /// Or a range of a buffer of the engine's, for all outputs: the system creates no output buffer,
  /// and `outputBudget` and `outputUsage` do not matter. The buffer has `outputRangeUsage` and what
  /// the engine needs; the offset is a multiple of minStorageBufferOffsetAlignment, the size of 4.
  /// Nothing outside the range is written. The engine destroys it after the system.
  BufferRange output;

  /// Both functions, or none: then memory is allocated from the device in blocks of 64 MiB or more.
  MemoryCallbacks memory;
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

/// One thread at a time may call a member function, except `prepare`. Any thread may write the
/// memory that `writePose` returns, until `record`. Nothing here submits, waits or touches a queue.
///
/// All frames are recorded for queues that execute them one after the other, in the order of
/// `record`: usually one queue. Palettes of a system cannot be read by the engine's own shaders:
/// use tier 1 for that.
class SkinningSystem {
 public:
  /// Creates all buffers but tables, history and uploads, which `record` and `addMesh` create.
  /// Fails with `invalidArgument` or `limitExceeded` as `Scene::create`, with `missingEntryPoint`,
  /// `vulkanError`, or what `MemoryCallbacks::allocate` fails with.
  static Result<SkinningSystem> create(const SkinningSystemDescription& description);

  /// Every recorded frame must be complete.
  ~SkinningSystem();
  SkinningSystem(SkinningSystem&&) noexcept;
  SkinningSystem& operator=(SkinningSystem&&) noexcept;

  // -- Meshes, poses, instances: as those of `Scene` (scene.h).

  /// Copies the bytes; the next `record` uploads them. Fails also with `vulkanError`, or what
  /// `MemoryCallbacks::allocate` fails with.
  Result<MeshHandle> addMesh(const PackedMesh& mesh);
  Result<void> removeMesh(MeshHandle mesh);
  /// All joint matrices are the identity until `writePose`.
  Result<PoseHandle> addPose(std::uint32_t jointCount, bool mayScale = true);
  Result<void> removePose(PoseHandle pose);
  Result<InstanceHandle> addInstance(const InstanceDescription& description);
  Result<void> removeInstance(InstanceHandle instance);

  /// As `Context::prepare`, with the system's tuning. May be called by any thread at any time.
  Result<void> prepare(const PipelineNeeds& needs) const;

  // -- What changes: as `Scene`.

  Result<void> beginFrame(std::uint64_t frame, std::uint64_t completedFrame);
  /// Where to write the joint matrices of this frame: mapped memory, to be written as a whole and
  /// never read, until `record`.
  Result<std::span<JointMatrix>> writePose(PoseHandle pose);
  Result<void> change(std::span<const InstanceChange> changes);
  Result<void> setVisible(InstanceHandle instance, bool isVisible);
  Result<void> setUpdateInterval(InstanceHandle instance, std::uint32_t interval);
  Result<void> teleport(InstanceHandle instance);
  Result<void> setMorphWeights(InstanceHandle instance, std::span<const MorphWeight> morphs);
  Result<void> setMesh(InstanceHandle instance, MeshHandle mesh);
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
  /// `MemoryCallbacks::allocate` fails with. Nothing is recorded then, and the next `record` does
  /// all of it.
  Result<void> record(VkCommandBuffer commandBuffer, const FrameDescription& frame = {});

  /// The engine did not submit what the last `record` recorded, and never will. As
  /// `Scene::abandonFrame`: the next `record` does all of it again, uploads included, in the same
  /// frame or in another one.
  Result<void> abandonFrame(std::uint64_t frame);

  // -- Results, as of the last `record`: as `Scene`.

  /// All outputs are in this buffer, as long as the system lives: the system's own, or that of
  /// `SkinningSystemDescription::output`. Offsets count from its beginning. In a range of the
  /// engine's they are multiples of the stride (interleaved layouts) if the range's offset is.
  VkBuffer outputBuffer() const;
  Result<InstanceOutput> output(InstanceHandle instance) const;
  std::span<const InstanceHandle> skinnedInstances() const;
  std::span<const InstanceHandle> settledInstances() const;
  std::span<const InstanceHandle> movedInstances() const;
  Result<std::optional<Box>> bounds(InstanceHandle instance) const;
  /// The instance budget: larger than every `visibilityIndex`.
  std::uint32_t instanceCapacity() const;
  Result<std::uint32_t> visibilityIndex(InstanceHandle instance) const;
  SystemStatistics statistics() const;

 private:
  SkinningSystem();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis::vulkan
