// A Vulkan device without a window, and Dermis' context on it, for samples and tests. An engine has
// its own.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "dermis/result.h"
#include "dermis/vulkan/context.h"
#include "kit/device_extensions.h"
#include "kit/vulkan_loader.h"

namespace dermis::samples {

struct DeviceInfo {
  std::string name;
  std::string type;  ///< "discrete GPU", "integrated GPU", "virtual GPU", "CPU" or "other"
  std::uint32_t apiVersion = 0;
  std::uint64_t maxStorageBufferRange = 0;
  std::uint32_t maxWorkgroupCount = 0;
  std::uint32_t storageBuffersPerStage = 0;
  bool pushDescriptors = false;
  bool int64 = false;              ///< kernels can use 64-bit integers
  bool float64 = false;            ///< shaders can compute in double precision
  bool scalarBlockLayout = false;  ///< kernels can store up to 32 bytes at once
  bool accelerationStructures = false;
  bool rayQueries = false;
  bool pipelineStatistics = false;
  bool indirectDraws = false;  ///< many by one command, each with its own first instance
  std::string unusable;        ///< why Dermis cannot run on it; empty if it can
};

struct DeviceOptions {
  /// "auto": the best usable device, GPUs before CPUs; a number: the index in `listDevices`;
  /// otherwise a part of a name, in upper or lower case.
  std::string device = "auto";
  bool validation = false;      ///< enable the Khronos layer with core and synchronization checks;
                                ///< fails if it is not installed
  bool pushDescriptors = true;  ///< enable VK_KHR_push_descriptor if the device has it
  bool rayTracing = false;      ///< enable acceleration structures, buffer device addresses and ray
                                ///< queries if the device has them
  bool graphics = false;        ///< requires a graphics queue; enables `indirectDraws`
  bool float64 = false;         ///< enable `DeviceInfo::float64` if the device has it
  bool pipelineStatistics =
      false;                     ///< enable queries that count invocations if the device has them
  vulkan::KernelSource kernels;  ///< of the context; empty: the library's
  /// Instance extensions for the surface of a window. If there are any, VK_KHR_swapchain is
  /// required and enabled.
  std::vector<std::string> surfaceExtensions;
};

/// Fails with `missingFeature` if there is no loader, or if no instance can be created.
Result<std::vector<DeviceInfo>> listDevices();

class Device {
 public:
  /// Fails with `missingFeature` if there is no loader, no device of that name, no compute or
  /// graphics queue, or no validation layer.
  static Result<std::unique_ptr<Device>> create(const DeviceOptions& options);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  /// The description for Dermis. Valid while this object lives.
  vulkan::DeviceDescription description() const;

  const DeviceInfo& info() const { return info_; }
  const VulkanFunctions& functions() const { return functions_; }
  VkDevice handle() const { return device_; }
  VkPhysicalDevice physicalDevice() const { return physicalDevice_; }
  bool hasExtension(const char* name) const;
  VkQueue queue() const { return queue_; }
  std::uint32_t queueFamily() const { return queueFamily_; }

  /// A memory type with all flags of `required`, and with those of `preferred` if there is one.
  Result<std::uint32_t> memoryType(std::uint32_t allowedTypes, VkMemoryPropertyFlags required,
                                   VkMemoryPropertyFlags preferred) const;

  VkCommandBuffer allocateCommandBuffer(
      VkCommandBufferLevel level = VK_COMMAND_BUFFER_LEVEL_PRIMARY);
  void freeCommandBuffer(VkCommandBuffer commandBuffer);

  /// Submits a command buffer and waits. It is executed as many times as `times` says, one after
  /// the other; more than once only if it was begun for simultaneous use. Fails with `vulkanError`.
  Result<void> submitAndWait(VkCommandBuffer commandBuffer, std::uint32_t times = 1);

  /// Calls `record` between the begin and the end of a command buffer, submits it and waits. Fails
  /// with `vulkanError`, and if `record` does; then nothing is submitted.
  Result<void> run(const std::function<Result<void>(VkCommandBuffer)>& record);

  /// Returns the messages of the validation layer so far, and clears them.
  std::vector<std::string> takeValidationMessages();

 private:
  Device() = default;
  Result<void> createInstance(bool validation, std::span<const std::string> extensions);
  Result<void> choose(const std::string& wanted);
  Result<void> createDevice(const DeviceOptions& options);

  static VKAPI_ATTR VkBool32 VKAPI_CALL onMessage(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                                  VkDebugUtilsMessageTypeFlagsEXT types,
                                                  const VkDebugUtilsMessengerCallbackDataEXT* data,
                                                  void* user);
  friend Result<std::vector<DeviceInfo>> listDevices();

  std::shared_ptr<VulkanLoader> loader_;
  VulkanFunctions functions_;
  DeviceInfo info_;
  VkInstance instance_ = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  VkPhysicalDevice physicalDevice_ = VK_NULL_HANDLE;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  std::uint32_t queueFamily_ = 0;
  VkCommandPool commandPool_ = VK_NULL_HANDLE;
  std::vector<const char*> enabledExtensions_;
  VkPhysicalDeviceFeatures2 features_{};
  VkPhysicalDeviceScalarBlockLayoutFeatures scalarBlockLayout_{};
  RayTracingFeatures rayTracing_;
  std::mutex messagesMutex_;
  std::vector<std::string> messages_;
};

/// The context is declared last, so that it is destroyed before the device.
struct OpenDevice {
  std::unique_ptr<Device> device;
  vulkan::Context context;
};

Result<OpenDevice> openDevice(const DeviceOptions& options);

/// The driver, so that measurements can be compared: "llvmpipe Mesa 22.3.6 (LLVM 15.0.6)", or only
/// a number if the driver does not report more.
std::string driverVersion(const Device& device);

/// `vulkan::barrierBetween(before, after)` for all memory.
void recordBarrier(const Device& device, VkCommandBuffer commandBuffer, Use before, Use after);

/// The error of a Vulkan function.
Error vulkanError(const std::string& function, VkResult result);
/// The same if the result is not VK_SUCCESS.
Result<void> checkVulkan(const char* function, VkResult result);

}  // namespace dermis::samples
