// Uses the engine's Vulkan device: builds pipelines, binds the engine's buffers, records batches
// and barriers.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <vulkan/vk_platform.h>

#include "dermis/layout.h"
#include "dermis/plan.h"
#include "dermis/result.h"

// ---- Declares the Vulkan types that Dermis' headers use, as vulkan_core.h does, but does not
// include it. So an engine may include volk, or Vulkan's header with or without prototypes, before
// or after Dermis' headers. Only drawing.h includes vulkan_core.h.

struct VkAllocationCallbacks;
struct VkBufferCreateInfo;
struct VkBufferMemoryBarrier;
struct VkBufferMemoryBarrier2;
struct VkMemoryBarrier;
struct VkMemoryBarrier2;

using VkDeviceSize = std::uint64_t;
using VkFlags = std::uint32_t;
using VkAccessFlags = VkFlags;
using VkBufferUsageFlags = VkFlags;
using VkPipelineStageFlags = VkFlags;

using VkInstance = struct VkInstance_T*;
using VkPhysicalDevice = struct VkPhysicalDevice_T*;
using VkDevice = struct VkDevice_T*;
using VkCommandBuffer = struct VkCommandBuffer_T*;
// The same condition as in vulkan_core.h.
#if defined(__LP64__) || defined(_WIN64) || (defined(__x86_64__) && !defined(__ILP32__)) || \
    defined(_M_X64) || defined(__ia64) || defined(_M_IA64) || defined(__aarch64__) ||       \
    defined(__powerpc64__)
using VkBuffer = struct VkBuffer_T*;
using VkPipelineCache = struct VkPipelineCache_T*;
#else
using VkBuffer = std::uint64_t;
using VkPipelineCache = std::uint64_t;
#endif

using PFN_vkVoidFunction = void(VKAPI_PTR*)();
using PFN_vkGetInstanceProcAddr = PFN_vkVoidFunction(VKAPI_PTR*)(VkInstance instance,
                                                                 const char* name);

namespace dermis::vulkan {

inline constexpr VkBufferUsageFlags vertexBufferUsage =
    0x80;  ///< VK_BUFFER_USAGE_VERTEX_BUFFER_BIT

// ---- The barriers that the engine records around `record`, and before and after its own writes to
// what `record` reads. Dermis records the barriers between its own commands, and does not track the
// state of resources.
//
//   context.recordBarrier(commandBuffer, Use::vertexInput, Use::dermis);
//   context.record(commandBuffer, plan, bindings);  // or SceneRecorder::record
//   context.recordBarrier(commandBuffer, Use::dermis, Use::vertexInput);

/// Which half of a queue-family ownership transfer a barrier is. A transfer needs two barriers with
/// the same uses: the release on the queue that used the buffer, and the acquire on the queue that
/// will use it. Vulkan ignores the destination of a release and the source of an acquire (Vulkan
/// 1.3, 7.7.4). The host has no queue family. So its uses are left out of a transfer; and where it
/// alone uses the buffer before or after, there is no transfer, and all three values are the same.
enum class QueueTransfer : std::uint8_t { none = 0, release = 1, acquire = 2 };

/// Stages and accesses of both sides of a barrier. VkPipelineStageFlags2 and VkAccessFlags2 have
/// the same bits.
struct DERMIS_VULKAN_API Barrier {
  VkPipelineStageFlags sourceStages = 0;
  VkAccessFlags sourceAccesses = 0;
  VkPipelineStageFlags destinationStages = 0;
  VkAccessFlags destinationAccesses = 0;

  // For engines that record barriers themselves.

  /// For vkCmdPipelineBarrier, which takes the stages as parameters.
  operator VkMemoryBarrier() const;
  /// The same for a whole buffer, without a transfer. The caller sets `buffer`, and may set the
  /// range and the queue families.
  operator VkBufferMemoryBarrier() const;
  /// For vkCmdPipelineBarrier2 (Vulkan 1.3 or VK_KHR_synchronization2).
  operator VkMemoryBarrier2() const;
  /// The same for a whole buffer, without a transfer, as for VkBufferMemoryBarrier.
  operator VkBufferMemoryBarrier2() const;
};

/// The barrier between two uses of a buffer, or of several buffers. After reads alone it has no
/// source accesses: the second use only waits.
DERMIS_VULKAN_API Barrier barrierBetween(Use before, Use after,
                                         QueueTransfer transfer = QueueTransfer::none);

// ---- The engine's buffers, and the descriptors with which Dermis binds them.

/// A part of a VkBuffer.
struct BufferRange {
  VkBuffer buffer{};
  /// Bytes; a multiple of `DeviceLimits::minStorageBufferOffsetAlignment`.
  VkDeviceSize offset = 0;
  VkDeviceSize size = 0;  ///< bytes; a multiple of 4, not VK_WHOLE_SIZE
};

/// The buffers of a batch. The engine owns them. `Plan::buffer` returns their sizes and usage: each
/// has VK_BUFFER_USAGE_STORAGE_BUFFER_BIT. If `DeviceLimits::texelBuffers` is set, meshes, poses,
/// tables and palettes have VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT, too; an engine that cannot
/// add that usage sets `DeviceDescription::texelBuffers` to false.
///
/// A buffer that no plan needs may be left out: meshes and outputs if there are no jobs, poses and
/// tables if batches are empty, palettes if all jobs are linear, results if no job has results, and
/// the output of an attribute that no job writes.
struct BatchBuffers {
  BufferRange meshes;    ///< packed meshes, each at its `Job::meshOffset`
  BufferRange poses;     ///< joint matrices at `PoseDescription::matrixOffset`
  BufferRange tables;    ///< what `writeTables` wrote
  BufferRange palettes;  ///< palettes and `PoseStatus`, which the palette kernel writes
  /// The output buffer of each attribute: `all(range)` if they share one. Each may be larger than a
  /// storage buffer range.
  ByStream<BufferRange> outputs{};
  BufferRange results;  ///< `InstanceResult` at `Plan::resultOffset`
};

struct BindingsState;

/// Descriptor sets and buffer views for one set of buffers, made by `Context::createBindings`. They
/// must live until the GPU has completed all commands that were recorded with them. Destroy them
/// before the buffers and the Context. Any number of threads may `record` with them at the same
/// time.
class DERMIS_VULKAN_API Bindings {
 public:
  Bindings();
  ~Bindings();
  Bindings(Bindings&&) noexcept;
  Bindings& operator=(Bindings&&) noexcept;

 private:
  friend class Context;
  friend class SceneRecorder;
  friend struct ContextState;
  std::unique_ptr<BindingsState> state_;
};

// ---- How to build a pipeline, for an engine that executes the commands of a plan with its own
// RHI, and modules that replace those of the library. Needs no Vulkan device.
//
// What kernels read and write, and the push constants, are declared in shaders/abi.h, which
// compiles as C++. It is installed in DERMIS_SHADER_DIR.

/// What a compute pipeline is built from.
struct PipelineDescription {
  std::string name;    ///< for messages and debuggers
  std::string module;  ///< name of the SPIR-V module, for example "skin_texels"
  /// SPIR-V 1.3, entry point "main". The memory is static; pipelines of one module have the same.
  /// With texel buffers it requires the features `shaderInt64` and `scalarBlockLayout`.
  std::span<const std::uint32_t> spirv;
  /// The values of the specialization constants from id 0 on, 4 bytes each.
  std::vector<std::uint32_t> constants;
  /// Descriptor set 0 has storage buffers in the slots from 0 on, and uniform texel buffers in the
  /// slots that follow. The only other resource is a range of push constants, at most
  /// `DispatchCommand::constants`. All pipelines for one device can share a layout: the largest.
  std::uint32_t storageBuffers = 0, texelBuffers = 0;
};

/// Describes a pipeline. Fails with `invalidArgument` if `pipelines` never lists it, and with
/// `missingFeature` if this build of Dermis does not contain its module.
DERMIS_VULKAN_API Result<PipelineDescription> pipelineDescription(PipelineId id);

/// Supplies modules to a Context that replace those in the library: `RuntimeCompiler::source`
/// (compilers.h), or the engine's own build of the kernels.
struct KernelSource {
  void* user = nullptr;  ///< passed to `get`
  /// Returns the SPIR-V of the module with this name (`PipelineDescription::module`).
  /// `Context::prepare` calls it for each pipeline that it creates, in the thread that calls
  /// `prepare`; several threads may call it at once. If it fails, `prepare` fails with the same
  /// error. It must not throw. If null, the modules in the library are used.
  Result<std::vector<std::uint32_t>> (*get)(void* user, std::string_view name) = nullptr;
};

/// A module and its name. The caller owns the memory.
struct KernelModule {
  std::string_view name;
  std::span<const std::uint32_t> spirv;
};

// ---- The context.

/// The engine's device and what the engine enabled on it. Dermis uses nothing else. The engine owns
/// all of it.
struct DeviceDescription {
  VkInstance instance{};
  VkPhysicalDevice physicalDevice{};
  VkDevice device{};
  /// vkGetInstanceProcAddr of the loader or of a layer. Dermis gets all other functions through it,
  /// and does not link the loader.
  PFN_vkGetInstanceProcAddr getInstanceProcAddr = nullptr;
  /// The lower of the API versions of instance and device, for example VK_API_VERSION_1_1, which is
  /// the minimum. Required.
  std::uint32_t apiVersion = 0;
  /// Names of the enabled device extensions. Dermis uses VK_KHR_push_descriptor if it is listed.
  /// The instance extension VK_EXT_debug_utils may be listed, too; Dermis then names its objects
  /// and labels its commands. Only `Context::create` reads the names.
  std::span<const char* const> enabledExtensions;
  /// The enabled features: the pNext chain of VkDeviceCreateInfo. If the engine used
  /// `pEnabledFeatures`, it passes a VkPhysicalDeviceFeatures2 with the same contents. Dermis uses
  /// these features if they are enabled:
  /// - scalarBlockLayout of VkPhysicalDeviceScalarBlockLayoutFeatures or
  ///   VkPhysicalDeviceVulkan12Features;
  /// - shaderInt64 of VkPhysicalDeviceFeatures2.
  ///
  /// Only `Context::create` reads the chain.
  const void* enabledFeatures = nullptr;
  /// Whether these features are enabled, for engines that do not have the chain. A feature counts
  /// as enabled if it is in the chain or here.
  bool hasScalarBlockLayout = false, hasShaderInt64 = false;
  /// Whether kernels are those for CPU devices, if the device supports them and the engine enabled
  /// `scalarBlockLayout` and `shaderInt64` (`DeviceLimits::texelBuffers`). `Plan::buffer` then
  /// returns VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT for these buffers, and
  /// `maxStorageBufferRange` of `Context::limits` is at most what such a buffer can hold. Results
  /// are the same to the bit. If not set: true for CPU devices (measured on lavapipe), false for
  /// others (a guess).
  std::optional<bool> texelBuffers;
  /// Whether kernels may store interleaved vertices widely, or through workgroup memory
  /// (`DeviceLimits::stagedStores`). Results are the same to the bit. If not set: true for discrete
  /// GPUs (a guess) but those of AMD and Intel, false for others.
  std::optional<bool> stagedStores;
  /// Optional. Supplies the kernels instead of the library. Its `user` must outlive the Context.
  KernelSource kernelSource;
  /// Optional. Used for every pipeline. The engine stores and loads it.
  VkPipelineCache pipelineCache{};
  /// Optional. Used for every object that Dermis creates. It must outlive the Context.
  const VkAllocationCallbacks* allocator = nullptr;
};

struct ContextState;

/// The layouts and pipelines of Dermis on one device. It does not submit, wait, map memory, or
/// allocate device memory.
///
/// Any thread may call any member function at any time. `record` needs a command buffer that no
/// other thread uses. Destroy the Context before the device, and after the GPU has completed all
/// commands that it recorded.
class DERMIS_VULKAN_API Context {
 public:
  /// Gets entry points and limits, and creates layouts, but no shader modules or pipelines. Fails
  /// with
  /// - `invalidArgument` if a required handle is null, or `apiVersion` is 0;
  /// - `missingEntryPoint` if the driver does not have a function;
  /// - `missingFeature` if the API version is below 1.1, or the device has fewer than four storage
  ///   buffers per stage;
  /// - `vulkanError`.
  static Result<Context> create(const DeviceDescription& description);

  ~Context();
  /// A Context may be moved while its bindings and recorders exist and while frames are in flight,
  /// but not while another thread calls one of its functions.
  Context(Context&&) noexcept;
  Context& operator=(Context&&) noexcept;

  /// The limits for `makePlan`.
  const DeviceLimits& limits() const;

  /// The recommended tuning for this class of device, for `makePlan`. The values for CPU devices
  /// were measured on lavapipe; those for GPUs are guesses.
  Tuning tuning() const;

  /// Builds every pipeline that instances with these needs can use, in plans that are made with
  /// this tuning; if empty, with `tuning()`. If `PipelineNeeds::mesh` and `promise` are empty,
  /// these are the pipelines for any mesh, pose and morph targets. Once all needs are prepared,
  /// `record` never fails with `notPrepared`. May take long: call it from a loading thread. If it
  /// fails (`invalidArgument`, `missingFeature`, `vulkanError`, or the error of
  /// `KernelSource::get`), the pipelines that were built before remain.
  Result<void> prepare(const PipelineNeeds& needs, const std::optional<Tuning>& tuning = {}) const;

  /// Builds these pipelines. Those that exist are skipped. For jobs whose attributes are not placed
  /// by a `VertexLayout`: `pipelines` lists all that they can need, `Plan::pipelines` those of one
  /// plan. Fails as the other does, with `invalidArgument` for a number that neither lists.
  Result<void> prepare(std::span<const PipelineId> ids) const;

  /// Swaps kernels between two frames: creates every existing pipeline of these modules again, and
  /// returns their number. Either all are replaced or none. `record` uses the new pipelines from
  /// then on. Does not wait for the GPU. `kernelSource` must return the new modules from then on;
  /// pipelines that `prepare` creates on another thread during the call are created again.
  ///
  /// `frame` is the frame that is recorded next, `completedFrame` the last frame that the GPU has
  /// completed: as for `Scene::beginFrame`, even if there is no scene. Once `frame` is
  /// complete, the next call, with or without modules, destroys the replaced pipelines. Command
  /// buffers that were recorded before must not be submitted again after `frame`. Other threads may
  /// record during the call, for `frame` or an earlier frame; each of their dispatches uses either
  /// the old or the new kernel.
  ///
  /// Fails with `vulkanError`, and with `invalidArgument` if there are modules but no
  /// `kernelSource`, a module is empty, or `completedFrame` is not before `frame`. If it fails,
  /// nothing changes.
  Result<std::uint32_t> replaceKernels(std::span<const KernelModule> modules, std::uint64_t frame,
                                       std::uint64_t completedFrame) const;

  /// Makes the descriptor sets and buffer views for a set of buffers. Fails with
  /// - `invalidArgument` if a range is misaligned, or its size is 0 or not a multiple of 4;
  /// - `limitExceeded` if a range other than the output is larger than a storage buffer range, or
  ///   if attributes have different outputs on a device with fewer than `storageBuffersWanted`
  ///   storage buffers per stage;
  /// - `vulkanError`.
  Result<Bindings> createBindings(const BatchBuffers& buffers) const;

  /// Records the commands of a plan that `makePlan` made. O(dispatches). Call it outside a render
  /// pass, with a primary or secondary command buffer, for a queue that supports compute.
  /// Afterwards the compute pipeline, the descriptor sets of compute and the push constants are
  /// undefined. Graphics state is not changed. But an engine that uses VK_EXT_descriptor_heap must
  /// bind its heaps and push its data again, for graphics, too: binding descriptor sets or pushing
  /// constants invalidates both.
  ///
  /// The engine records barriers before and after it (`recordBarrier`). When the GPU executes the
  /// commands, the tables buffer must hold the tables of this plan (`writeTables`). The bindings
  /// must live until the GPU has completed them.
  ///
  /// Fails with `notPrepared` if `prepare` was not called for a method or layout, and with
  /// `invalidArgument` if a buffer is smaller than the plan needs, or if the plan was made for
  /// other limits. If it fails, nothing is recorded.
  Result<void> record(VkCommandBuffer commandBuffer, const Plan& plan,
                      const Bindings& bindings) const;

  /// Records `barrierBetween(before, after)` for all memory. Call it outside a render pass. Records
  /// nothing if there are no uses on one side.
  void recordBarrier(VkCommandBuffer commandBuffer, Use before, Use after) const;

 private:
  Context();
  friend class Bindings;
  friend class SceneRecorder;
  std::unique_ptr<ContextState> state_;
};

}  // namespace dermis::vulkan
