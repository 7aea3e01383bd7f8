// Records the frames of a scene (scene.h) into the engine's command buffers. A recorder owns the
// scene and its buffers; the engine owns the device and the command buffers. An engine that manages
// its own buffers and instances uses `Context` and plan.h instead.
//
//     vulkan::SceneRecorder recorder = *vulkan::SceneRecorder::create(context);
//     Scene& scene = recorder.scene();
//     recorder.prepare(instance);   // while loading, for each kind of instance
//
// and in each frame:
//
//     scene.beginFrame(frame, completedFrame);       // frame numbers of the engine
//     std::span<JointMatrix> matrices = *scene.writePose(pose);   // for each pose that changes
//     ... add, remove, change ...
//     recorder.record(commandBuffer);                // with the engine's barriers before and after
//     draw from recorder.outputBuffer() at scene.output(instance)
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/vulkan/context.h"

namespace dermis::vulkan {

/// Who uses the memory of a buffer. This decides on the memory type.
enum class BufferUse : std::uint8_t {
  /// Only the GPU: device-local if possible.
  device = 0,
  /// The CPU writes it and never reads it, the GPU reads it: host-visible and host-coherent, also
  /// device-local if possible.
  upload = 1,
  /// The GPU writes it, the CPU reads it: host-visible and host-coherent, also host-cached if
  /// possible.
  readBack = 2,
};

/// A buffer with its memory.
struct CreatedBuffer {
  VkBuffer buffer{};
  /// For `upload` and `readBack`: address of the first byte. The memory stays mapped.
  void* mapped = nullptr;
  void* allocation = nullptr;  ///< for the engine's allocator; `destroy` gets it
};

/// Create and destroy the buffers of a SceneRecorder. They are called in the thread that calls the
/// recorder or its scene, and may call Vulkan. They must not throw, and must not call either. vma.h
/// has them for the Vulkan Memory Allocator.
struct BufferCallbacks {
  void* user = nullptr;  ///< passed to both functions
  /// Creates a buffer and binds memory to it. If it fails, the function that needs it fails with
  /// the same error. `info` has the size and the usage, VK_SHARING_MODE_EXCLUSIVE, and an empty
  /// pNext chain; it is valid during the call only. If the usage has
  /// VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT, the memory must be allocated with
  /// VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT. `name` is for debugging, for example "dermis output": a
  /// constant, the same for all buffers of a kind.
  Result<CreatedBuffer> (*create)(void* user, const VkBufferCreateInfo& info, BufferUse use,
                                  const char* name) = nullptr;
  /// Destroys a buffer that the GPU no longer uses, and frees its memory.
  void (*destroy)(void* user, const CreatedBuffer& buffer) = nullptr;
};

/// What `SceneRecorder::create` needs to know.
struct SceneRecorderDescription {
  SceneDescription scene;

  // -- Optional: parts of buffers that the engine owns. If one is not set, the recorder creates the
  // buffer. `SceneRecorder::requirement` returns the usage and alignment that a range needs. A
  // range does not grow: its size is the capacity, and that of `scene` is ignored. Dermis reads and
  // writes nothing outside the range. The engine destroys the buffer after the recorder.
  BufferRange meshes;
  BufferRange poses;  ///< for poses that the CPU writes
  /// Address of the first byte of `poses`. The memory is host-coherent and stays mapped.
  void* mappedPoses = nullptr;
  BufferRange gpuPoses;  ///< for poses that a GPU pass of the engine writes
  BufferRange output;
  /// What the engine uses the output buffer for, if the recorder creates it. For example
  /// `vertexBufferUsage`, or that with `buildInputUsage` (drawing.h). Dermis adds what it needs
  /// itself, and always VK_BUFFER_USAGE_TRANSFER_SRC_BIT.
  VkBufferUsageFlags outputUsage = vertexBufferUsage;

  /// Create and destroy all other buffers. Set both functions or none. Buffers are created by
  /// `SceneRecorder::create`, by functions of the scene that add something, by `Scene::change`, and
  /// by `record` if a frame needs larger buffers for tables, uploads, read-back or culling. If not
  /// set, the recorder allocates memory blocks: small ones first, and at most 64 MiB each unless
  /// one buffer is larger.
  BufferCallbacks buffers;
  /// Whether the GPU time of each `record` is measured with timestamps. The queue family must
  /// support them.
  bool measuresGpuTime = false;
  std::optional<Tuning> tuning;  ///< if empty: `Context::tuning`
};

/// What `SceneRecorder::statistics` returns, besides `Scene::statistics`.
struct RecorderStatistics {
  // -- Of the last `record`; zeros after `Scene::abandonFrame`.
  std::uint32_t dispatches = 0;     ///< direct and indirect
  std::uint64_t workgroups = 0;     ///< of direct dispatches
  std::uint32_t copies = 0;         ///< copy commands: tables, meshes, moved outputs, results
  std::uint64_t uploadedBytes = 0;  ///< tables, meshes and `SceneStatistics::Frame::poseBytes`
  double planSeconds = 0;           ///< CPU time to plan the frame and write its tables
  double recordSeconds = 0;         ///< CPU time to record the commands

  /// GPU time of the newest complete frame, if `measuresGpuTime`.
  std::optional<double> gpuSeconds;
  /// Bytes of the memory blocks. With `BufferCallbacks`: bytes of all buffers that they created.
  std::uint64_t deviceMemory = 0;
};

/// Owns a scene and the buffers for it. It does not submit, wait, or use a queue.
///
/// One thread at a time may call a function of the recorder or of its scene. Any thread may write
/// the memory that `Scene::writePose` returns, until `record`.
///
/// The GPU must execute all frames one after the other, in the order of `record`; usually they are
/// on one queue. The engine's own shaders cannot read the palettes of a scene: use `Context` and
/// plan.h for that.
class DERMIS_VULKAN_API SceneRecorder {
 public:
  /// Creates a scene, and the buffers with their initial capacities. The context must outlive the
  /// recorder, but may be moved. Fails with `invalidArgument` if a member of the description is not
  /// valid, with `limitExceeded` if an initial capacity needs a buffer larger than a storage buffer
  /// range, with `missingEntryPoint`, with `vulkanError`, or with the error of
  /// `BufferCallbacks::create`.
  static Result<SceneRecorder> create(const Context& context,
                                      const SceneRecorderDescription& description = {});

  /// Call it before `create`, to find out what a range of the engine needs. `role` is `meshes`,
  /// `poses`, `gpuPoses` or `output`. Returns usage and alignment, and the size for the initial
  /// capacity in `description`. The alignment of the output need not be a power of two. An instance
  /// begins at a multiple of its `VertexPlaces::alignment` from the beginning of the buffer. With
  /// the layouts of the instances, the size of the output has room for that, wherever the range
  /// begins, if the instances of each layout are interleaved and added one after the other. For
  /// other roles it returns the initial requirement; tables have size 0, since their size depends
  /// on the frame. Creates nothing. Fails as `create` and `placeVertices` do.
  static Result<BufferRequirement> requirement(const Context& context,
                                               const SceneRecorderDescription& description,
                                               BufferRole role,
                                               std::span<const VertexLayout> layouts = {});

  /// The GPU must have completed every recorded frame.
  ~SceneRecorder();
  SceneRecorder(SceneRecorder&&) noexcept;
  SceneRecorder& operator=(SceneRecorder&&) noexcept;

  /// Stays at one address until the recorder is destroyed, even if the recorder is moved.
  Scene& scene() const;

  /// Builds the pipelines that such an instance can need: `Context::prepare` with
  /// `Scene::pipelineNeeds` and the tuning of this recorder. May take long. To build them in
  /// another thread, call these two.
  Result<void> prepare(const InstanceDescription& instance) const;

  /// Records the uploads and the commands of the frame, with the barriers between them. Records
  /// nothing if nothing changed and no instance is culled on the GPU. Call it once after each
  /// `beginFrame`, outside a render pass, with a primary or secondary command buffer. Before it the
  /// engine records the barrier between the last use, if any, of the output, and of what
  /// `poseRange` and `drivenRange` name, and `Use::dermis`, and after it the barrier between
  /// `Use::dermis` and the next use.
  ///
  /// `visibility` is required if instances are `culledOnGpu`: a part of a buffer with
  /// VK_BUFFER_USAGE_STORAGE_BUFFER_BIT that holds `Scene::visibilityCount` words of 4 bytes. An
  /// instance is visible if the word at its `visibilityIndex` is not 0. The engine's culling writes
  /// them on the GPU before `record`, with the barrier `barrierBetween(Use::computeWrite,
  /// Use::dermis)` in between; or the CPU writes them through a mapping before the submission,
  /// without a barrier, to a buffer that no frame in flight uses.
  ///
  /// Fails with
  /// - `notPrepared` if `prepare` was not called for such instances;
  /// - `invalidArgument` if `beginFrame` was not called, if the offset of `visibility` is not
  ///   aligned, or if instances are culled on the GPU and it has fewer words;
  /// - `limitExceeded` if the tables are larger than a storage buffer range;
  /// - `vulkanError`, or the error of `BufferCallbacks::create`.
  ///
  /// If it fails, nothing is recorded, and the next `record` does all of the work. If the frame is
  /// not submitted, call `Scene::abandonFrame`.
  Result<void> record(VkCommandBuffer commandBuffer, const BufferRange& visibility = {});

  /// The buffer that holds all outputs as of the last `record`: one that the recorder created, or
  /// the buffer of `SceneRecorderDescription::output`. Offsets of outputs count from its beginning.
  /// To read vertices on the CPU, record a barrier from `Use::dermis` to `Use::copyRead`, copy
  /// them, and record one from `Use::copyWrite` to `Use::hostRead`.
  VkBuffer outputBuffer() const;
  /// A number that changes whenever `outputBuffer` becomes another buffer: when it grew, or when
  /// the frame in which it grew was abandoned. Offsets stay the same when it grows.
  std::uint64_t outputGeneration() const;

  /// Where the joint matrices of a pose are that a GPU pass of the engine writes, or that belongs
  /// to a figure: consecutive `JointMatrix`, 48 bytes each. The range stays the same until the pose
  /// is removed. Poses of one call of `addPoses` are consecutive in one buffer, and the offset of
  /// the first is a multiple of minStorageBufferOffsetAlignment, so that it can be bound; so is
  /// that of the first pose of a figure. Poses of different calls may be in different buffers. A
  /// buffer that the recorder created has VK_BUFFER_USAGE_STORAGE_BUFFER_BIT and those for
  /// transfers from it and to it.
  ///
  /// The engine records `barrierBetween(Use::dermis, Use::computeWrite)`, as frames in flight may
  /// still read the matrices, then its pass, then `barrierBetween(Use::computeWrite, Use::dermis)`;
  /// and it calls `Scene::markWritten`. It only reads the poses of figures, after the commands of a
  /// frame: as they were last sampled. Fails with `invalidArgument` for a pose that the CPU writes.
  Result<BufferRange> poseRange(PoseHandle pose) const;
  /// The same for the morph weights of an instance (`MorphWriter::gpu`): a float for each target of
  /// its mesh that no rig drives, in ascending order. The engine calls `Scene::markMorphsWritten`.
  /// The range stays the same until the instance is removed; its offset is a multiple of 16. Fails
  /// with `invalidArgument` for an instance whose weights the CPU writes.
  Result<BufferRange> weightsRange(InstanceHandle instance) const;
  /// Where the joints are that the rig of a pose drives, and behind them all its weights, a float
  /// each. The engine only reads them, after the commands of a frame: as they were when the pose
  /// was last needed. The range stays the same until the pose is removed. Fails with
  /// `invalidArgument` for a pose without a rig.
  Result<BufferRange> drivenRange(PoseHandle pose) const;

  /// Of the last frame that was recorded.
  RecorderStatistics statistics() const;

 private:
  SceneRecorder();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis::vulkan
