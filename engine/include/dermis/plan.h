// A batch of instances turned into dispatches, on the CPU, without Vulkan. An engine hands the plan
// to `vulkan::Context::record`, or issues the dispatches with its own RHI: everything that it needs
// for that is here and in vulkan/kernels.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/method.h"
#include "dermis/pack.h"
#include "dermis/result.h"
#include "dermis/types.h"
#include "dermis/vertex_format.h"

namespace dermis {

/// What an engine promises of its meshes and palettes, so that it needs fewer pipelines (see
/// `everyVariant`). `makePlan`, `addMesh` and `addPalette` refuse what breaks a promise.
struct Promises {
  /// Maximum influences of a vertex: 1, 2 or 4. All meshes are then skinned by pipelines for that
  /// number. 0: no promise; there are pipelines for 1, 2, 4 and any number.
  std::uint8_t maxInfluences = 0;
  bool noMorphTargets = false;  ///< no mesh has morph targets
  bool noScale = false;         ///< no palette has `mayScale`

  friend bool operator==(const Promises&, const Promises&) = default;
};

/// The limits of a device, and what the engine promised, that a plan must keep to;
/// `vulkan::Context::limits` fills them. The defaults are what every Vulkan device has.
struct DeviceLimits {
  std::uint64_t maxStorageBufferRange = std::uint64_t{1} << 27;  ///< bytes
  /// Bytes, a power of two; also that of texel buffers, where they are read.
  std::uint32_t minStorageBufferOffsetAlignment = 256;
  std::uint32_t maxWorkgroupCountX = 65535;
  std::uint32_t maxWorkgroupCountY = 65535;
  /// Storage buffers that one kernel may see. With fewer than `storageBuffersWanted` all attributes
  /// must go to one buffer, near to each other, in whole words, without bounds or snorm16
  /// positions.
  std::uint32_t maxStorageBuffersPerStage = 4;
  /// Whether kernels may store 2 bytes, 1 byte (VkPhysicalDevice16BitStorageFeatures::
  /// storageBuffer16BitAccess, VkPhysicalDevice8BitStorageFeatures::storageBuffer8BitAccess).
  /// Without, attributes must fill whole words. A Dermis that was built without
  /// `DERMIS_SUBWORD_STORES` stores neither.
  bool storage16Bit = false;
  bool storage8Bit = false;
  /// Whether kernels read tables, meshes and palettes through uniform texel buffers, which is
  /// faster on lavapipe. A uniform texel buffer of 4-byte texels must then hold a whole storage
  /// buffer range. Kernels that store less than a word do not.
  bool texelBuffers = false;
  /// Whether kernels may use 64-bit integers (VkPhysicalDeviceFeatures::shaderInt64): to store two
  /// words at a time, which is faster on lavapipe.
  bool shaderInt64 = false;
  /// Whether there are kernels for methods that are there for comparison: not where Dermis was
  /// built without `DERMIS_COMPARISON_METHODS`.
  bool comparisonMethods = true;
  Promises promises;

  friend bool operator==(const DeviceLimits&, const DeviceLimits&) = default;
};

/// Tables, meshes, palettes, the four attributes, results.
inline constexpr std::uint32_t storageBuffersWanted = 8;

/// How the work is cut up. It changes the speed, never a bit of the result.
struct Tuning {
  std::uint32_t workgroupSize = 64;  ///< invocations; a power of two from 8 to 128
  std::uint32_t instancesPerInvocation =
      4;  ///< instances for which one invocation skins its vertex, 1 to 32
};

/// A pose: `jointCount` consecutive `JointMatrix` (48 bytes each) in the matrices buffer.
struct Palette {
  std::uint32_t jointCount = 0;    ///< 1 to `maxPaletteJoints`
  std::uint64_t matrixOffset = 0;  ///< bytes into the matrices buffer, a multiple of 16
  /// Whether joints may scale or shear: many exporters leave a scale in their joints. It costs 32
  /// bytes a joint of scratch, and on lavapipe time, whether or not a pose makes use of it.
  /// Where it is denied, joints that do so all the same are skinned by their rotation alone, and
  /// counted in `PaletteStatus`.
  bool mayScale = true;
};

/// Where one attribute of the skinned vertices goes: vertex v to `offset + v * stride` in the
/// output buffer of that attribute. Bytes between attributes are never touched.
///
/// If positions and normals are float32x3 with equal strides, a multiple of 8, and normals begin 12
/// bytes behind positions, both must go to one buffer (`OutputSizes::isOneBuffer`) and positions
/// must begin at a multiple of 8.
///
/// Offset, stride and the format's size are multiples of 4. With `DeviceLimits::storage16Bit` they
/// may be multiples of 2 and, where `storage8Bit` is there too, any number.
struct OutputAttribute {
  std::uint64_t offset = 0;                  ///< bytes
  std::uint32_t stride = 0;                  ///< bytes, at least `formatSize(format)`
  VertexFormat format = VertexFormat::none;  ///< `none`: the attribute is not wanted
};

/// Where previous positions, for motion vectors, come from.
enum class Motion : std::uint8_t {
  none,
  /// What stood in the output before: the positions of the last time that this instance was
  /// skinned. Costs a read and a write; the output must live from frame to frame.
  kept,
  /// Skinned again from the palette and morph weights of that time: costs a second skinning, but
  /// nothing has to be kept but the pose.
  reskinned,
};

/// One instance: a mesh, a palette and the places its skinned vertices go to. No two jobs of a
/// batch may write the same byte; that is not checked.
struct Job {
  MeshInfo mesh;  ///< `PackedMesh::info` of the mesh whose bytes stand in the mesh buffer
  std::uint64_t meshOffset = 0;  ///< bytes, a multiple of `packedMeshAlignment`
  std::uint32_t palette = 0;     ///< index into `Batch::palettes`
  /// One that `needsCentersOfRotation`, only for a mesh that has them.
  Method method = Method::dualQuaternion;

  OutputAttribute positions;  ///< `isPositionFormat`; always wanted
  OutputAttribute normals;    ///< of unit length; only for a mesh that has normals
  OutputAttribute tangents;   ///< of unit length; only for a mesh that has tangents
  /// The box that positions in snorm16 are relative to; its sides must be finite, and longer than
  /// 1e-38. The engine's, or `skinnedBounds` of the pose (bounds.h).
  Box box;

  /// Active morph targets in any order, none twice; those of weight 0 are skipped. `makePlan`
  /// copies them. Only these cost time, however many the mesh has.
  std::span<const MorphWeight> morphs;

  Motion motion = Motion::none;
  /// In the format of `positions`, whose own is not looked at. With `Motion::kept`, snorm16 keeps
  /// the box of the time it was written in.
  OutputAttribute previousPositions;
  /// reskinned: index into `Batch::palettes`, with as many joints as the mesh needs.
  std::uint32_t previousPalette = 0;
  std::span<const MorphWeight> previousMorphs;  ///< reskinned: the weights of that time
  /// Previous positions are the current ones: on an instance's first frame, and after a teleport.
  bool restartsMotion = false;
  /// The instance is not skinned; its previous positions become those that stand in the output. For
  /// the first frame in which an instance is not updated: it no longer moves.
  bool settles = false;

  /// The box of the skinned positions is wanted: `Plan::resultOffset`.
  bool bounds = false;
};

/// What the skin kernel finds out about one instance; it stands in the results buffer. Only for
/// jobs that ask for bounds, or have positions in snorm16.
///
/// Extremes are reduced by integer atomics: they are stored as numbers in the order of the floats,
/// to which `box` turns them. A shader does it with
/// `uintBitsToFloat((n & 0x80000000u) != 0u ? n & 0x7fffffffu : ~n)`.
struct InstanceResult {
  std::uint32_t orderedMin[3] = {0xffffffffu, 0xffffffffu, 0xffffffffu};
  std::uint32_t clampedVertices = 0;  ///< those outside `Job::box`
  std::uint32_t orderedMax[3] = {0, 0, 0};
  std::uint32_t reserved = 0;

  /// The exact box of the skinned float32 positions, before conversion to their format, NaNs left
  /// out. Nothing for an instance that has none, did not ask for bounds, or settled.
  std::optional<Box> box() const;
};
static_assert(sizeof(InstanceResult) == 32);

/// Bytes of the output buffers, by attribute. Several may be one buffer.
struct OutputSizes {
  std::uint64_t positions = 0;
  std::uint64_t normals = 0;
  std::uint64_t tangents = 0;
  std::uint64_t previousPositions = 0;
  /// All attributes go to one and the same buffer. `record` checks the bindings if it matters
  /// (`Variant::pairs`).
  bool isOneBuffer = false;

  static constexpr OutputSizes oneBuffer(std::uint64_t size) {
    return {size, size, size, size, true};
  }
};

/// Everything that one `record` skins, and the sizes of the buffers it works on.
struct Batch {
  std::span<const Palette> palettes;
  std::span<const Job> jobs;
  std::uint64_t meshesSize = 0;    ///< bytes of the mesh buffer
  std::uint64_t matricesSize = 0;  ///< bytes of the matrices buffer
  OutputSizes outputs;
};

enum class Kernel : std::uint8_t { palette, skin };

/// The four attributes of an output, in the order of the arrays below.
enum class Stream : std::uint8_t { positions, normals, tangents, previousPositions };
inline constexpr std::size_t streamCount = 4;

/// One specialisation of a kernel: what a pipeline is built from. All but `kernel` and
/// `workgroupSize` is the skin kernel's.
struct Variant {
  Kernel kernel = Kernel::skin;
  Method method = Method::dualQuaternion;
  VertexFormat positions = VertexFormat::float32x3;
  VertexFormat normals = VertexFormat::none;
  VertexFormat tangents = VertexFormat::none;
  /// Bytes that one store writes to each stream: 4, 2 or 1.
  std::array<std::uint8_t, streamCount> units{4, 4, 4, 4};
  Motion motion = Motion::none;
  bool bounds = false;
  /// With `scales`, and influences for any vertex.
  bool morphs = false;
  /// Whether joints may scale or shear (`Palette::mayScale`). Never for linear blending, which does
  /// not ask.
  bool scales = false;
  /// Tables, meshes and palettes are read as uniform texel buffers, not as storage buffers.
  bool texels = false;
  /// Positions and, right behind each, normals in the same buffer, float32x3 both and at multiples
  /// of 8 bytes, are stored together, two words at a time. Only with `texels`, without motion and
  /// results, and with `DeviceLimits::shaderInt64`.
  bool pairs = false;
  /// Maximum influences of a vertex: 1, 2, 4, or 0 for any number.
  std::uint8_t influences = 0;
  std::uint8_t instancesPerInvocation = 1;
  std::uint16_t workgroupSize = 64;

  friend bool operator==(const Variant&, const Variant&) = default;
  /// A number that is different for every variant.
  std::uint64_t key() const;
};

/// Whether the kernel writes `InstanceResult`: for bounds, and positions in snorm16.
bool hasResults(const Variant& variant);

/// Every variant that jobs with the method, outputs, motion and bounds of this one may need,
/// whatever their mesh, palette and morph targets and whatever else is in their batch: for
/// `Context::prepare`, while loading. The palette kernel; and the skin kernel for at most 1, 2 and
/// 4 influences; for 4 with joints that scale; for any number; for any number with morph targets.
/// Some methods need fewer, and `Promises` leave more out.
std::vector<Variant> everyVariant(const Job& job, const DeviceLimits& limits, const Tuning& tuning);

/// The buffers of a batch.
enum class BufferRole : std::uint8_t {
  meshes,
  matrices,
  tables,
  palettes,
  results,
  positions,
  normals,
  tangents,
  previousPositions
};

struct BufferRequirement {
  std::uint64_t size = 0;       ///< bytes, at least
  std::uint32_t alignment = 0;  ///< of the offset at which it may stand in a larger VkBuffer
  std::uint32_t usage = 0;      ///< VkBufferUsageFlags
  bool perFrame = false;        ///< Rewritten every frame: needs a copy for each frame in flight.
  bool hostWritten = false;     ///< The CPU writes it: mapped, or copied to before `record`.
};

/// Numbers of a dispatch that go into its push constants, in this order (shaders/abi.h).
struct DispatchConstants {
  std::uint32_t firstRecord = 0;  ///< word offset of its records in the tables
  std::uint32_t recordCount = 0;
  std::uint32_t workgroupCount = 0;   ///< before folding into y
  std::uint32_t instanceRecords = 0;  ///< word offset of the instance records in the tables
};

/// The part of an output buffer that a dispatch writes.
struct OutputWindow {
  std::uint32_t index = 0;   ///< counts the windows of that buffer
  std::uint64_t offset = 0;  ///< bytes at which it begins; 0 unless the buffer is larger than a
                             ///< storage buffer range may be
};

struct Dispatch {
  Variant variant;
  std::uint32_t groupCountX = 0;
  std::uint32_t groupCountY = 0;
  DispatchConstants constants;
  /// It reads what the palette kernel wrote, or may see results that the palette kernel cleared: a
  /// memory barrier stands before this dispatch.
  bool afterPalettes = false;
  std::array<OutputWindow, streamCount> windows;
};

/// How many bytes lie between the beginnings of two output ranges on a device with these limits. A
/// range is at most `maxStorageBufferRange` bytes; they overlap, so that an instance lies in one or
/// is cut by vertices into pieces that do.
std::uint64_t outputWindowStep(const DeviceLimits& limits);

/// What the palette kernel found out about one pose; it stands in the palettes buffer, where the
/// engine may read it.
struct PaletteStatus {
  std::uint32_t twoPhase = 0;        ///< 1 where the two-phase path was taken
  std::uint32_t nonRigidJoints = 0;  ///< joints with scale, shear or a mirror
  std::uint32_t undeclaredScale =
      0;  ///< those in a palette that did not declare `mayScale`: their scale was lost
  std::uint32_t nonFiniteJoints = 0;  ///< joints with a NaN or an infinity
};

struct PlanData;

/// The dispatches of a batch. Reuse one object: its memory is kept. Not thread-safe while
/// `makePlan` fills it, immutable after.
class Plan {
 public:
  Plan();
  ~Plan();
  Plan(Plan&&) noexcept;
  Plan& operator=(Plan&&) noexcept;

  /// In the order in which they must be issued.
  std::span<const Dispatch> dispatches() const;
  /// The variants that the dispatches use, each once: what `Context::prepare` must have built.
  std::span<const Variant> variants() const;
  /// What the buffer of that role must be. Meshes, matrices and outputs: as large as the batch said
  /// they are. Tables, palettes and results: as large as this plan needs.
  BufferRequirement buffer(BufferRole role) const;
  /// Bytes into the palettes buffer at which the `PaletteStatus` of a palette stands; `noStatus`
  /// where only linear jobs use that palette.
  std::uint64_t statusOffset(std::uint32_t palette) const;
  static constexpr std::uint64_t noStatus = ~std::uint64_t{0};
  /// Bytes into the results buffer at which the `InstanceResult` of a job stands; `noResult` where
  /// it has none. Results stand in the order of their jobs, without gaps.
  std::uint64_t resultOffset(std::uint32_t job) const;
  static constexpr std::uint64_t noResult = ~std::uint64_t{0};

  /// The limits that the plan was made for.
  const DeviceLimits& limits() const;

  std::uint32_t instanceCount() const;
  std::uint64_t vertexCount() const;  ///< skinned vertices, over all instances

 private:
  friend struct PlanData;  // what it consists of
  friend Result<void> makePlan(const Batch&, const DeviceLimits&, const Tuning&, Plan&);
  std::unique_ptr<PlanData> data_;
};

/// Turns a batch into dispatches: one for all palettes, then one for each combination of method,
/// formats, motion and the like (and output range). O(palettes + jobs + morph weights), no Vulkan
/// call. An empty batch gives an empty plan.
///
/// Fails with `invalidArgument` where a job or palette breaks a rule written above (the sentence
/// names it by its index), among them: a palette with fewer joints than the mesh needs, normals
/// wanted of a mesh that has none, a range outside its buffer; with `missingFeature` where an
/// attribute does not fill whole words and the device cannot store less; and with `limitExceeded`
/// where a vertex' attribute, or a buffer, does not fit a device's storage buffer range. The plan
/// is then empty.
Result<void> makePlan(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning,
                      Plan& out);

/// Writes the tables that the kernels read, `buffer(BufferRole::tables).size` bytes, to mapped
/// memory. The memory is written once from front to back and never read. Fails with
/// `invalidArgument` where `bytes` is too small.
Result<void> writeTables(const Plan& plan, std::span<std::byte> bytes);

}  // namespace dermis
