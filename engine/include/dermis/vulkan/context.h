// The engine's Vulkan device as Dermis uses it: pipelines, bindings, and the recording of batches.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "dermis/export.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/handles.h"

namespace dermis::vulkan {

/// The engine's device and what is enabled on it. Dermis uses only what this structure names. The
/// engine owns all of it.
struct DeviceDescription {
  VkInstance instance{};
  VkPhysicalDevice physicalDevice{};
  VkDevice device{};
  /// The entry point of the loader or of a layer. Dermis gets all other functions through it, and
  /// links no loader.
  PFN_vkGetInstanceProcAddr getInstanceProcAddr = nullptr;
  /// The API version of the instance or of the device, whichever is lower. Minimum: Vulkan 1.1.
  std::uint32_t apiVersion = apiVersion11;
  /// Names of the enabled device extensions. Dermis uses VK_KHR_push_descriptor if it is among
  /// them. The instance extension VK_EXT_debug_utils may be named too; Dermis then names its
  /// objects and labels its commands.
  std::span<const char* const> enabledExtensions;
  /// The enabled features: the pNext chain of VkDeviceCreateInfo. An engine that gave
  /// `pEnabledFeatures` instead points to a VkPhysicalDeviceFeatures2. Dermis uses these if they
  /// are enabled: storageBuffer16BitAccess and storageBuffer8BitAccess of
  /// VkPhysicalDevice16BitStorageFeatures, VkPhysicalDevice8BitStorageFeatures, or
  /// VkPhysicalDeviceVulkan11Features and ...12Features; shaderInt64 of VkPhysicalDeviceFeatures2;
  /// scalarBlockLayout of VkPhysicalDeviceScalarBlockLayoutFeatures or
  /// VkPhysicalDeviceVulkan12Features.
  /// Only `create` reads the chain.
  const void* enabledFeatures = nullptr;
  /// Whether kernels read tables, meshes and palettes through uniform texel buffers, where the
  /// device can. `Plan::buffer` then asks for VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT. Results are
  /// the same to the bit. Not set: on CPU devices (measured on lavapipe), not on
  /// others (a guess).
  std::optional<bool> texelBuffers;
  /// What the engine promises about its meshes and poses, to need fewer pipelines.
  Promises promises;
  /// Optional. Every pipeline is created with it. The engine stores and loads it.
  VkPipelineCache pipelineCache{};
  /// Optional. Used for every object that Dermis creates. It must outlive the Context.
  const VkAllocationCallbacks* allocator = nullptr;
};

struct ContextState;

/// The layouts and pipelines of Dermis on a device. Any thread may call any member function at any
/// time; `record` needs a command buffer that no other thread uses. Destroy the Context before the
/// device, when the GPU has completed all commands that it recorded.
///
/// Nothing here submits, waits, maps, or allocates device memory.
class DERMIS_VULKAN_API Context {
 public:
  /// Gets entry points and limits, and creates layouts. Creates no shader module or pipeline.
  /// Fails with `invalidArgument` (a handle is missing, a promise makes no sense),
  /// `missingEntryPoint`, `missingFeature` (Vulkan below 1.1, too few storage buffers a stage) or
  /// `vulkanError`.
  static Result<Context> create(const DeviceDescription& description);

  ~Context();
  /// May be moved while bindings and systems that were made with it exist, and while frames are in
  /// flight, but not during a call of another thread.
  Context(Context&&) noexcept;
  Context& operator=(Context&&) noexcept;

  /// The limits for `makePlan`.
  const DeviceLimits& limits() const;

  /// The recommended tuning for this device, for `makePlan`. The value for GPUs is a guess.
  Tuning tuning() const;

  /// Builds every pipeline that instances with this method and layout may need, whatever their
  /// mesh, pose and morph targets, in plans made with `tuning` (for others: `everyVariant`). Once
  /// all methods and layouts are prepared, `record` needs no other pipeline. May take long: call it
  /// from a loading thread. If it fails (`invalidArgument`, `missingFeature`, `vulkanError`), what
  /// was built before stays built.
  Result<void> prepare(const PipelineNeeds& needs) const;

  /// Builds the pipelines of these variants only. Those that exist are skipped. For jobs that stand
  /// otherwise than in a `VertexLayout`: `everyVariant`.
  Result<void> prepare(std::span<const Variant> variants) const;

  /// Makes the descriptor sets and buffer views for a set of buffers. Fails with `invalidArgument`
  /// (misaligned, a size of 0 or no multiple of 4), `limitExceeded` (larger than a storage buffer
  /// range where that is not allowed; different outputs on a device with fewer than
  /// `storageBuffersWanted` a stage) or `vulkanError`.
  Result<Bindings> createBindings(const BatchBuffers& buffers) const;

  /// Records the commands of the plan of a batch. O(dispatches). Call it outside a render pass,
  /// with a primary or secondary command buffer for a queue with compute. Afterwards the compute
  /// pipeline, descriptor set 0 of compute and push constants are undefined; the graphics state is
  /// as it was.
  ///
  /// The engine puts barriers before and after (scope.h), sees to it that the tables of this very
  /// plan stand in the tables buffer when the GPU gets there, and keeps the bindings until the GPU
  /// is done.
  ///
  /// Fails with `notPrepared` if `prepare` was not called for a method or layout, and with
  /// `invalidArgument` where a buffer is smaller than the plan needs; nothing is recorded then.
  Result<void> record(VkCommandBuffer commandBuffer, const Plan& plan,
                      const Bindings& bindings) const;

 private:
  Context();
  friend class Bindings;
  friend class SkinningSystem;
  std::unique_ptr<ContextState> state_;
};

}  // namespace dermis::vulkan
