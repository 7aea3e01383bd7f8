// Uses the engine's Vulkan device: builds pipelines, binds the engine's buffers, and records
// batches.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "dermis/export.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/vulkan/barrier.h"
#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/handles.h"
#include "dermis/vulkan/kernels.h"

namespace dermis::vulkan {

/// The features that Dermis uses if the engine enabled them on its device. A bit mask: combine them
/// by `|`.
enum class DeviceFeature : std::uint32_t {
  none = 0,
  /// Of VkPhysicalDeviceScalarBlockLayoutFeatures or VkPhysicalDeviceVulkan12Features.
  scalarBlockLayout = 1,
  shaderInt64 = 2,  ///< of VkPhysicalDeviceFeatures
};

/// Both masks together.
constexpr DeviceFeature operator|(DeviceFeature a, DeviceFeature b) {
  return static_cast<DeviceFeature>(static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b));
}
/// Whether `mask` includes `one`.
constexpr bool includes(DeviceFeature mask, DeviceFeature one) {
  return (static_cast<std::uint32_t>(mask) & static_cast<std::uint32_t>(one)) != 0;
}

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
  /// `scalarBlockLayout` and `shaderInt64` as bits, for engines that do not have the chain. A
  /// feature counts as enabled if it is in the chain or here.
  DeviceFeature enabledFeatureBits = DeviceFeature::none;
  /// Whether kernels are those for CPU devices, if the device supports them and the engine enabled
  /// `scalarBlockLayout` and `shaderInt64` (`DeviceLimits::texelBuffers`). `Plan::buffer` then
  /// returns VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT for these buffers, and
  /// `maxStorageBufferRange` of `Context::limits` is at most what such a buffer can hold. Results
  /// are the same to the bit. If not set: true for CPU devices (measured on lavapipe), false for
  /// others (a guess).
  std::optional<bool> texelBuffers;
  /// Whether kernels may store interleaved vertices through workgroup memory
  /// (`DeviceLimits::stagedStores`). Results are the same to the bit. If not set: true for discrete
  /// GPUs (a guess), false for others.
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
  /// A Context may be moved while its bindings and systems exist and while frames are in flight,
  /// but not while another thread calls one of its functions.
  Context(Context&&) noexcept;
  Context& operator=(Context&&) noexcept;

  /// The limits for `makePlan`.
  const DeviceLimits& limits() const;

  /// The recommended tuning for this class of device, for `makePlan`. The values for CPU devices
  /// were measured on lavapipe; those for GPUs are guesses.
  Tuning tuning() const;

  /// Builds every pipeline that instances with these needs can use, in plans that are made with
  /// `tuning()`. For other tunings use `pipelines`. If `PipelineNeeds::mesh` and `mayScale` are
  /// empty, these are the pipelines for any mesh, pose and morph targets. Once all needs are
  /// prepared, `record` never fails with `notPrepared`. May take long: call it from a loading
  /// thread. If it fails (`invalidArgument`, `missingFeature`, `vulkanError`, or the error of
  /// `KernelSource::get`), the pipelines that were built before remain.
  Result<void> prepare(const PipelineNeeds& needs) const;

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

  /// Records a barrier for all memory, as `barrierBetween` returns it. Call it outside a render
  /// pass. Records nothing if nothing waits: if it has no uses on one side, or is one half of a
  /// queue transfer. A transfer needs a barrier of its buffer, which the engine records itself.
  void recordBarrier(VkCommandBuffer commandBuffer, const Barrier& barrier) const;

 private:
  Context();
  friend class Bindings;
  friend class SceneRecorder;
  std::unique_ptr<ContextState> state_;
};

}  // namespace dermis::vulkan
