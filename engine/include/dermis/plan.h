// A batch of instances turned into dispatches, on the CPU, without Vulkan. An engine hands the plan
// to `vulkan::Context::record`, or issues the dispatches with its own RHI: everything that it needs
// for that is here and in vulkan/kernels.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dermis/method.h"
#include "dermis/pack.h"
#include "dermis/result.h"
#include "dermis/types.h"

namespace dermis {

/// The limits of a device that a plan must keep to; `vulkan::Context::limits` fills them. The
/// defaults are what every Vulkan device has.
struct DeviceLimits {
  std::uint64_t maxStorageBufferRange = std::uint64_t{1} << 27;  ///< bytes
  std::uint32_t minStorageBufferOffsetAlignment = 256;           ///< bytes, a power of two
  std::uint32_t maxWorkgroupCountX = 65535;
  std::uint32_t maxWorkgroupCountY = 65535;

  friend bool operator==(const DeviceLimits&, const DeviceLimits&) = default;
};

/// How the work is cut up. It changes the speed, never a bit of the result.
struct Tuning {
  std::uint32_t workgroupSize = 64;  ///< invocations; a power of two from 8 to 128
  std::uint32_t instancesPerInvocation =
      4;  ///< instances for which one invocation skins its vertex, 1 to 16
};

/// A pose: `jointCount` consecutive `JointMatrix` (48 bytes each) in the matrices buffer.
struct Palette {
  std::uint32_t jointCount = 0;    ///< 1 to `maxPaletteJoints`
  std::uint64_t matrixOffset = 0;  ///< bytes into the matrices buffer, a multiple of 16
  /// Whether joints may scale or shear: many exporters leave a scale in their joints. It costs 32
  /// bytes a joint of scratch. Where it is denied, joints that do so all the same are skinned by
  /// their rotation alone, and counted in `PaletteStatus`.
  bool mayScale = true;
};

/// Where one attribute of the skinned vertices goes: vertex v to `offset + v * stride` in the
/// output buffer.
struct OutputAttribute {
  std::uint64_t offset = 0;  ///< bytes, a multiple of 4
  std::uint32_t stride =
      0;  ///< bytes, a multiple of 4, at least 12; 0 where the attribute is not wanted
};

/// One instance: a mesh, a palette and the places its skinned vertices go to. No two jobs of a
/// batch may write the same byte; that is not checked. Bytes between the attributes are never
/// touched.
struct Job {
  MeshInfo mesh;  ///< `PackedMesh::info` of the mesh whose bytes stand in the mesh buffer
  std::uint64_t meshOffset = 0;  ///< bytes, a multiple of `packedMeshAlignment`
  std::uint32_t palette = 0;     ///< index into `Batch::palettes`
  Method method = Method::dualQuaternion;
  OutputAttribute positions;  ///< float32 × 3; always written
  OutputAttribute normals;    ///< float32 × 3, unit length; only for a mesh that has normals
};

/// Everything that one `record` skins, and the sizes of the buffers it works on.
struct Batch {
  std::span<const Palette> palettes;
  std::span<const Job> jobs;
  std::uint64_t meshesSize = 0;    ///< bytes of the mesh buffer
  std::uint64_t matricesSize = 0;  ///< bytes of the matrices buffer
  std::uint64_t outputSize = 0;    ///< bytes of the output buffer
};

enum class Kernel : std::uint8_t { palette, skin };

/// One specialisation of a kernel: what a pipeline is built from.
struct Variant {
  Kernel kernel = Kernel::skin;
  Method method = Method::dualQuaternion;  ///< skin only
  bool normals = false;                    ///< skin only
  /// skin only: 1, 2, 4, or 0 for any number of influences a vertex.
  std::uint8_t influences = 0;
  std::uint8_t instancesPerInvocation = 1;  ///< skin only
  std::uint16_t workgroupSize = 64;

  friend bool operator==(const Variant&, const Variant&) = default;
  /// A number that is different for every variant.
  std::uint64_t key() const;
};

/// Every variant that a plan with this tuning may need: for an engine that cannot foresee its
/// batches, to hand to `Context::prepare` while loading.
std::vector<Variant> everyVariant(const Tuning& tuning);

/// The buffers of a batch.
enum class BufferRole : std::uint8_t { meshes, matrices, tables, palettes, output };

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

struct Dispatch {
  Variant variant;
  std::uint32_t groupCountX = 0;
  std::uint32_t groupCountY = 0;
  DispatchConstants constants;
  /// The palette kernel writes what the skin kernel reads: a memory barrier stands before this
  /// dispatch.
  bool afterPalettes = false;
  /// The output range it writes begins at this byte of the output buffer (0 unless the output is
  /// larger than a storage buffer range may be); `outputWindow` counts those ranges.
  std::uint64_t outputOffset = 0;
  std::uint32_t outputWindow = 0;
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
  /// What the buffer of that role must be. Meshes, matrices and output: as large as the batch said
  /// they are. Tables and palettes: as large as this plan needs.
  BufferRequirement buffer(BufferRole role) const;
  /// Bytes into the palettes buffer at which the `PaletteStatus` of a palette stands; `noStatus`
  /// where no dual-quaternion job uses that palette.
  std::uint64_t statusOffset(std::uint32_t palette) const;
  static constexpr std::uint64_t noStatus = ~std::uint64_t{0};

  /// The limits that the plan was made for.
  const DeviceLimits& limits() const;

  std::uint32_t instanceCount() const;
  std::uint64_t vertexCount() const;  ///< skinned vertices, over all instances

 private:
  friend Result<void> makePlan(const Batch&, const DeviceLimits&, const Tuning&, Plan&);
  friend Result<void> writeTables(const Plan&, std::span<std::byte>);
  struct State;
  std::unique_ptr<State> state_;
};

/// Turns a batch into dispatches: one for all palettes, then one for each combination of method and
/// attributes (and output range). O(palettes + jobs), no Vulkan call. An empty batch gives an empty
/// plan.
///
/// Fails with `invalidArgument` where a job or palette breaks a rule written above (the sentence
/// names it by its index), among them: a palette with fewer joints than the mesh needs, normals
/// wanted of a mesh that has none, a range outside its buffer; and with `limitExceeded` where one
/// vertex's attributes lie further apart than a device's storage buffer range allows. The plan is
/// then empty.
Result<void> makePlan(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning,
                      Plan& out);

/// Writes the tables that the kernels read, `buffer(BufferRole::tables).size` bytes, to mapped
/// memory. The memory is written once from front to back and never read. Fails with
/// `invalidArgument` where `bytes` is too small.
Result<void> writeTables(const Plan& plan, std::span<std::byte> bytes);

}  // namespace dermis
