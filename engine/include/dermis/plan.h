// Turns a batch of instances into commands, on the CPU, without Vulkan. An engine passes the plan
// to `vulkan::Context::record`, or issues the commands with its own RHI. To do so it also needs
// `vulkan::pipelineDescription` and shaders/abi.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis {

/// The device limits that a plan is made for. `vulkan::Context::limits` returns them; an engine
/// without a Context fills in the values of its device. The defaults are the minimum that Vulkan
/// guarantees, except `separateRanges` (how the engine binds) and `comparisonMethods` (how Dermis
/// was built).
struct DeviceLimits {
  std::uint64_t maxStorageBufferRange = std::uint64_t{1} << 27;  ///< bytes, a multiple of 4
  /// Bytes, a power of two. With `texelBuffers`, the larger of this and the alignment of uniform
  /// texel buffers.
  std::uint32_t minStorageBufferOffsetAlignment = 256;
  std::uint32_t maxWorkgroupCountX = 65535;
  std::uint32_t maxWorkgroupCountY = 65535;
  /// Maximum storage buffers of one kernel: maxPerStageDescriptorStorageBuffers. With fewer than
  /// `storageBuffersWanted`, all attributes of a job must go to one buffer, as if `separateRanges`
  /// were false. Bounds and snorm16 positions are then not available.
  std::uint32_t maxStorageBuffersPerStage = 4;
  /// Whether one dispatch may bind another part of the output buffer for each attribute. If false,
  /// and the output buffer is larger than `maxStorageBufferRange`, the attributes of a vertex must
  /// lie in one part of that size. They do if none begins more than 1/32 of it after another.
  /// `vulkan::Context::limits` returns false if VK_KHR_push_descriptor is not enabled.
  bool separateRanges = true;
  /// Whether kernels are those for CPU devices. They read tables, meshes and palettes, and in a
  /// batch with `Method::linear` poses, through uniform texel buffers, and store an attribute, or
  /// all of a vertex, at once; both are faster on lavapipe. Requires the features `shaderInt64` and
  /// `scalarBlockLayout`, and that a uniform texel buffer of 4-byte texels can hold a whole storage
  /// buffer range: `maxStorageBufferRange` is at most 16 × maxTexelBufferElements.
  bool texelBuffers = false;
  /// Whether kernels store interleaved vertices 16 or 8 bytes at a time; where they begin at no
  /// multiple of 8 bytes, through workgroup memory. Needs no device feature. Used only if
  /// - `texelBuffers` is false;
  /// - the method is `linear` or `dualQuaternion`;
  /// - there are no previous positions or results;
  /// - positions, normals and tangents are adjacent, without gaps, and take 8, 12, 16, 24 or
  ///   32 bytes together.
  bool stagedStores = false;
  /// Whether this build has the kernels of comparison methods (`DERMIS_COMPARISON_METHODS`).
  bool comparisonMethods = true;

  friend bool operator==(const DeviceLimits&, const DeviceLimits&) = default;
};

/// Storage buffers that the skin kernel has on most devices: one each for tables, meshes, palettes,
/// the four attributes, and results.
inline constexpr std::uint32_t storageBuffersWanted = 8;

/// How work is divided among invocations. It affects speed only: results are equal to the bit.
struct Tuning {
  /// Invocations; a power of two from 8 to 128. CPU devices sample clips with 8.
  std::uint32_t workgroupSize = 64;
  /// Maximum instances for which one invocation skins its vertex, 1 to 32.
  std::uint32_t instancesPerInvocation = 4;
  /// A dispatch with fewer workgroups than this uses fewer instances per invocation: half as many,
  /// until it has enough workgroups or one instance per invocation. 0: always
  /// `instancesPerInvocation`. Needs no other pipeline.
  std::uint32_t minWorkgroups = 0;
  /// Maximum vertices of a mesh that one invocation skins, one after the other: a power of two from
  /// 1 to 16. For dispatches with few instances of each mesh: they use as many as leave at least 32
  /// workgroups and, for the mean number of instances, at most `instancesPerInvocation` skinned
  /// vertices an invocation. Used only with `DeviceLimits::texelBuffers`. Needs no other pipeline.
  std::uint32_t verticesPerInvocation = 1;
};

/// A pose: `jointCount` consecutive `JointMatrix` (48 bytes each) in the poses buffer.
struct PoseDescription {
  std::uint32_t jointCount = 0;    ///< 1 to `maxPoseJoints`
  std::uint64_t matrixOffset = 0;  ///< bytes into the poses buffer, a multiple of 16
  /// What the joints do. `scaling` takes 32 more bytes of the palettes buffer for each joint and,
  /// on lavapipe, more time. With another promise, joints that scale are counted in `PoseStatus`,
  /// and only `Method::linear` applies their scale; its normals and tangents are then right for
  /// scales between 2^-20 and 2^30.
  JointPromise promise = JointPromise::scaling;
};

/// One instance: a mesh, a pose, and where its skinned vertices are written. Two jobs of a batch
/// must not write the same byte; this is not checked.
struct Job {
  MeshInfo mesh;                 ///< `PackedMesh::info`; its bytes are in the mesh buffer
  std::uint64_t meshOffset = 0;  ///< bytes, a multiple of `packedMeshAlignment`
  std::uint32_t pose = 0;        ///< index into `Batch::poses`
  /// If `needsCentersOfRotation(method)`, the mesh must have centers of rotation.
  Method method = Method::dualQuaternion;

  /// Where the vertices are written: what `placeVertices` returned, or any other attributes; its
  /// `size` and `alignment` are not read. The mesh must have normals and tangents if they are
  /// written. Both get unit length.
  VertexPlaces places;
  /// The box that snorm16 positions are relative to: one of the engine's, or `skinnedBounds` of the
  /// pose. It must be finite, and each side longer than 1e-38.
  Box box;

  /// Active morph targets, in any order, each once. Weights of 0 are skipped. `makePlan` copies
  /// them. Only active targets take time.
  std::span<const MorphWeight> morphs;

  /// Sets previous positions to the new positions: for the first frame of an instance, and after a
  /// teleport. Otherwise they are those of the last time that the instance was skinned; snorm16
  /// values stay relative to the box that they were written with.
  bool restartsMotion = false;
  /// Only copies the positions in the output to the previous positions, and skins nothing: for the
  /// first frame in which an instance no longer moves. Requires previous positions, as
  /// `restartsMotion` does.
  bool settles = false;

  /// Whether the box of the skinned positions is written to the results buffer, at
  /// `Plan::resultOffset`.
  bool bounds = false;
};

/// What the skin kernel writes to the results buffer for a job with `bounds` or snorm16 positions.
///
/// Minimum and maximum are reduced by integer atomics, so they are stored as integers that compare
/// like the floats. `box` converts them; a shader does it with
/// `uintBitsToFloat((n & 0x80000000u) != 0u ? n & 0x7fffffffu : ~n)`.
struct InstanceResult {
  std::uint32_t orderedMin[3] = {0xffffffffu, 0xffffffffu, 0xffffffffu};
  std::uint32_t orderedMax[3] = {0, 0, 0};
  std::uint32_t clampedVertices = 0;  ///< number of vertices outside `Job::box`
  std::uint32_t reserved = 0;

  /// The exact box of the skinned float32 positions, before conversion to their format. NaNs are
  /// ignored. Empty if all positions are NaN, if `Job::bounds` is false, or if the job settles.
  DERMIS_CORE_API std::optional<Box> box() const;
};
static_assert(sizeof(InstanceResult) == 32);

/// Everything that one `record` skins, and the sizes of its buffers.
struct Batch {
  /// Jobs refer to them by index. A pose is converted once for all jobs that read it and whose
  /// methods need the same palette.
  std::span<const PoseDescription> poses;
  std::span<const Job> jobs;     ///< one for each instance
  std::uint64_t meshesSize = 0;  ///< bytes of the mesh buffer
  std::uint64_t posesSize = 0;   ///< bytes of the poses buffer
  /// Bytes of the output buffer of each attribute: `all(size)` if they share one.
  ByStream<std::uint64_t> outputSizes{};
  /// Whether all attributes share one buffer. `OutputAttribute` says when they must. If a kernel
  /// relies on it, `record` checks that positions, normals and tangents are in the same buffer at
  /// the same offset.
  bool isOneOutput = true;
};

/// A compute pipeline: one of Dermis' kernels with values for its specialization constants. The
/// number is the same in every process that uses this version of Dermis. `Context::prepare` builds
/// pipelines; an engine with its own RHI asks `vulkan::pipelineDescription`.
enum class PipelineId : std::uint64_t {};

/// All pipelines that a job like this one can need, with any mesh, pose and morph targets, in any
/// batch, to be built while loading. Jobs are alike if they have the same method, formats, strides,
/// motion and bounds, and if their vertices begin a multiple of 4 bytes later or earlier: all
/// attributes of an interleaved vertex by the same number of bytes, each array by its own.
///
/// They are: the palette kernel for each promise of poses, but for `linear`; the clear kernel, for
/// bounds and snorm16 positions; and the skin kernel for at most 1, 2 and 4 influences, for exactly
/// 4, for 4 with joints that scale, for any number, and for any number with morph targets. Some
/// methods need fewer. With `texelBuffers` each skin kernel may be listed twice: with stores of up
/// to 32 bytes, for jobs whose attributes are all aligned to the size of their stores, and with
/// narrower stores, for all other jobs.
///
/// Fails with `invalidArgument` if the job's method, motion, formats or runs of attributes, the
/// limits or the tuning are not valid.
DERMIS_CORE_API Result<std::vector<PipelineId>> pipelines(const Job& job,
                                                          const DeviceLimits& limits,
                                                          const Tuning& tuning);

/// What pipelines depend on. It is known while loading.
struct PipelineNeeds {
  Method method = Method::dualQuaternion;
  VertexLayout layout = {};
  bool bounds = false;       ///< `Job::bounds`
  bool culledOnGpu = false;  ///< `InstanceDescription::culledOnGpu`
  bool figures = false;      ///< whether poses belong to figures (`Scene::addFigure`)
  /// Whether morph weights have a `MorphWriter` other than the CPU, or are driven.
  bool morphsOnGpu = false;
  bool rigs = false;  ///< whether poses have rigs (`PoseOptions::rig`)
  // -- Optional. Each of these reduces the number of pipelines. Instances that differ from it are
  // then not prepared.
  /// What is true of all meshes: `maxInfluences` is the maximum, `minInfluences` the minimum, and
  /// `morphTargetCount` is not 0 if any mesh has morph targets. Other members are ignored.
  std::optional<MeshInfo> mesh = {};
  std::optional<JointPromise> promise = {};  ///< of all poses
};

/// All pipelines for instances with these needs, at any offset that `placeVertices` accepts. With
/// `culledOnGpu` also the visibility kernel, with `figures` the two that sample clips, with
/// `morphsOnGpu` the one that lists morph targets, and with `rigs` the one that computes what rigs
/// drive, and palette kernels for poses with driven joints. Fails as `placeVertices` does, and with
/// `invalidArgument` if the layout breaks a rule of `OutputAttribute`, or if the method, the limits
/// or the tuning are not valid.
DERMIS_CORE_API Result<std::vector<PipelineId>> pipelines(const PipelineNeeds& needs,
                                                          const DeviceLimits& limits,
                                                          const Tuning& tuning);

/// The buffers of a batch or a scene. Poses, tables, palettes and results of a batch are rewritten
/// in every frame: each frame in flight needs its own.
enum class BufferRole : std::uint8_t {
  meshes = 0,  ///< packed meshes
  poses = 1,   ///< joint matrices; in a scene, those that the CPU writes
  /// What kernels read about poses and instances. In a batch `writeTables` writes it; in a scene
  /// the plan uploads it.
  tables = 2,
  palettes = 3,           ///< what the palette kernel writes: palettes and `PoseStatus`
  results = 4,            ///< `InstanceResult`
  positions = 5,          ///< skinned positions
  output = 5,             ///< in a scene: skinned vertices, all attributes
  normals = 6,            ///< skinned normals
  tangents = 7,           ///< skinned tangents
  previousPositions = 8,  ///< positions of the previous frame
  // Only in a scene (scene.h).
  gpuPoses = 9,   ///< joint matrices that the GPU writes
  readBack = 10,  ///< what the CPU reads of a complete frame; copied from history and results
  /// A word for each instance, not 0 if it is visible. The engine's culling writes it.
  visibility = 11,
  history = 12,  ///< what the visibility kernel counts, and remembers from frame to frame
};
inline constexpr std::size_t bufferRoleCount = 13;  ///< number of values of `BufferRole`

/// What a buffer of a plan or a scene needs.
struct BufferRequirement {
  std::uint64_t size = 0;       ///< minimum, in bytes
  std::uint32_t alignment = 0;  ///< of its offset, if it is part of a larger VkBuffer; in bytes
  /// Minimum VkBufferUsageFlags. The engine adds its own, for example VERTEX_BUFFER for outputs, or
  /// TRANSFER_SRC to copy results.
  std::uint32_t usage = 0;
};

/// In a scene: the number of the buffer of visibility words, which the engine has
/// (`Scene::visibilityCount`).
inline constexpr std::uint32_t visibilityBuffer = 0;

/// A part of a buffer. Bytes.
struct BufferPart {
  /// Its number in commands. In a batch it is its `BufferRole`. In a scene it is the
  /// `SceneBuffer::number`, or `visibilityBuffer`.
  std::uint32_t buffer = noIndex;
  std::uint64_t offset = 0, size = 0;
};

/// A descriptor of descriptor set 0.
struct Binding {
  std::uint32_t slot = 0;
  /// A uniform texel buffer (VK_FORMAT_R32G32B32A32_UINT), else a storage buffer.
  bool isTexelBuffer = false;
  BufferPart part;  ///< at most a storage buffer range
};

// -- Commands, in the terms of Vulkan. An engine with its own RHI visits each and calls what
// corresponds to the Vulkan command.

/// vkCmdBindPipeline, vkCmdPushConstants and vkCmdDispatch or vkCmdDispatchIndirect.
struct DispatchCommand {
  PipelineId pipeline{};
  std::uint32_t groupCountX = 0;  ///< 0 if indirect
  std::uint32_t groupCountY = 0;  ///< the third count is 1
  /// Workgroups that do work. `groupCountX` × `groupCountY` may be a little larger. 0 if indirect.
  std::uint32_t workgroupCount = 0;
  /// Where the VkDispatchIndirectCommand is, if indirect; otherwise of size 0.
  BufferPart indirect;
  /// Push constants from offset 0, the first `constantCount` words: the structure of
  /// shaders/abi.h that is named after the kernel, such as SkinPush.
  std::array<std::uint32_t, 9> constants{};
  std::uint32_t constantCount = 0;
  /// Valid as long as the commands. They are all that the kernel declares: a descriptor of a slot
  /// that is not listed need not be written.
  std::span<const Binding> bindings;
};

/// Bytes of the CPU that are written to a buffer, by way of a staging buffer and vkCmdCopyBuffer.
/// Uploads, copies and clears between two barriers do not depend on each other. The engine may
/// write a mapping instead, if earlier frames that use the buffer are complete and no `CopyCommand`
/// before it in the commands writes there, as one does when a buffer has grown.
struct UploadCommand {
  BufferPart to;
  std::span<const std::byte> bytes;  ///< as many as the part has; valid as long as the commands
};

/// vkCmdCopyBuffer.
struct CopyCommand {
  std::uint32_t from, to;                                ///< numbers of buffers
  std::uint64_t fromOffset = 0, toOffset = 0, size = 0;  ///< bytes
};

/// vkCmdFillBuffer with zeros.
struct ClearCommand {
  BufferPart part;
};

/// How commands use a buffer. Combine uses by `|`.
enum class Use : std::uint32_t {
  /// All that a plan reads and writes. A scene orders its own frames; between two records of
  /// batches with the same buffers, the engine records a barrier.
  dermis = 1,
  vertexInput = 2,                   ///< draws, as a vertex buffer
  vertexShader = 4,                  ///< reads it as a storage or texel buffer, as do the next four
  fragmentShader = 8,                ///< reads it
  taskShader = 16,                   ///< of VK_EXT_mesh_shader, reads it
  meshShader = 32,                   ///< reads it
  rayTracing = 64,                   ///< any shader of a ray-tracing pipeline reads it
  accelerationStructureBuild = 128,  ///< the geometry of a build or refit
  computeRead = 256,
  computeWrite = 512,
  copyRead = 1024,   ///< vkCmdCopyBuffer
  copyWrite = 2048,  ///< vkCmdCopyBuffer, vkCmdUpdateBuffer, vkCmdFillBuffer
  hostRead = 4096,   ///< through a mapping, after a fence
  /// Through a mapping. What is written before the submission needs no barrier: vkQueueSubmit makes
  /// it visible.
  hostWrite = 8192,
  indirectRead = 16384,  ///< the arguments of indirect dispatches and draws
};
/// Both uses.
constexpr Use operator|(Use a, Use b) {
  return static_cast<Use>(static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b));
}
/// Whether `uses` include `one`.
constexpr bool includes(Use uses, Use one) {
  return (static_cast<std::uint32_t>(uses) & static_cast<std::uint32_t>(one)) != 0;
}

/// vkCmdPipelineBarrier with the VkMemoryBarrier of `vulkan::barrierBetween`. Uses are from
/// `computeRead` on, without `hostWrite`.
struct BarrierCommand {
  Use before, after;
};

/// One command of a plan.
using Command =
    std::variant<DispatchCommand, UploadCommand, CopyCommand, ClearCommand, BarrierCommand>;

/// What the palette kernel reports about one pose, in the palettes buffer, at `Plan::statusOffset`.
/// The engine may copy it from there.
struct PoseStatus {
  std::uint32_t twoPhase = 0;         ///< 1 if vertices are skinned in two phases: scale, rotation
  std::uint32_t nonRigidJoints = 0;   ///< joints with scale, shear or a mirror
  std::uint32_t undeclaredScale = 0;  ///< joints whose scale was ignored, as none was promised
  std::uint32_t nonFiniteJoints = 0;  ///< joints with a NaN or an infinity
};

struct PlanData;

/// The commands of a batch. Reuse one object to reuse its memory. While
/// `makePlan` fills it, no other thread may use it. Afterwards it is immutable:
/// any number of threads may read it. A moved-from plan may only be filled, assigned to or
/// destroyed.
class DERMIS_CORE_API Plan {
 public:
  Plan();
  ~Plan();
  Plan(Plan&&) noexcept;
  Plan& operator=(Plan&&) noexcept;

  /// The commands, in the order in which they must be issued: the palette and clear kernels if
  /// there is anything to convert or clear, then the skin kernels, with a barrier before the first
  /// that needs it. The engine records the barriers between these commands and its own use of the
  /// output (`vulkan::barrierBetween`).
  std::span<const Command> commands() const;
  /// The pipelines of the dispatches, each once. `Context::prepare` must have built them.
  std::span<const PipelineId> pipelines() const;
  /// Requirements of a buffer. The sizes of meshes, poses and outputs are those of the `Batch`, and
  /// the sizes of tables, palettes and results are what this plan needs.
  BufferRequirement buffer(BufferRole role) const;
  /// Byte offset of a pose's `PoseStatus` in the palettes buffer. Empty if the pose is not
  /// converted.
  std::optional<std::uint64_t> statusOffset(std::uint32_t pose) const;
  /// Byte offset of a job's `InstanceResult` in the results buffer. Empty if the job has none.
  /// Results are in the order of their jobs, without gaps.
  std::optional<std::uint64_t> resultOffset(std::uint32_t job) const;

  /// The limits that the plan was made for.
  const DeviceLimits& limits() const;

  std::uint32_t dispatchCount() const;  ///< number of dispatches, indirect ones included
  std::uint32_t instanceCount() const;  ///< number of jobs
  /// Vertices of all jobs.
  std::uint64_t vertexCount() const;

 private:
  friend struct PlanData;  // its contents
  std::unique_ptr<PlanData> data_;
};

/// Turns a batch into commands: one dispatch for each variant of the palette kernel, one that
/// clears results if there are any, then one for each variant of the skin kernel and output window.
/// O(poses + jobs + morph weights). An empty batch gives an empty plan.
///
/// Fails with
/// - `invalidArgument` if a job or pose breaks a rule above (the message names it by its index),
///   for example: a pose with fewer joints than the mesh requires, normals for a mesh without
///   normals, a range outside its buffer. Also if limits or tuning are not valid;
/// - `missingFeature` if this build lacks the kernels of the method;
/// - `limitExceeded` if meshes, poses, palettes or tables are larger than a storage buffer range,
///   if a dispatch has too many workgroups, if the device has too few storage buffers for a job, or
///   if the attributes of a vertex must lie in one storage buffer range and do not
///   (`DeviceLimits::separateRanges`).
///
/// After a failure the plan is empty.
DERMIS_CORE_API Result<void> makePlan(const Batch& batch, const DeviceLimits& limits,
                                      const Tuning& tuning, Plan& out);

/// Writes the tables that the kernels read: `plan.buffer(BufferRole::tables).size` bytes. `bytes`
/// may be mapped memory: it is written once, front to back, and never read. Fails with
/// `invalidArgument` if `bytes` is too small.
DERMIS_CORE_API Result<void> writeTables(const Plan& plan, std::span<std::byte> bytes);

}  // namespace dermis
