#include "kit/device.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstring>
#include <utility>

#include "kit/device_extensions.h"

namespace dermis::samples {
namespace {

constexpr const char* validationLayer = "VK_LAYER_KHRONOS_validation";

Error unusable(std::string message) {
  return {ErrorCode::missingFeature, std::move(message)};
}

std::string typeName(VkPhysicalDeviceType type) {
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return "discrete GPU";
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return "integrated GPU";
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return "virtual GPU";
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
      return "CPU";
    default:
      return "other";
  }
}

int rank(const DeviceInfo& info) {
  const std::array<const char*, 4> order{"discrete GPU", "integrated GPU", "virtual GPU", "CPU"};
  const auto place = std::find(order.begin(), order.end(), info.type);
  return static_cast<int>(place - order.begin());
}

std::string lowerCase(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

bool contains(const std::vector<VkExtensionProperties>& extensions, const char* name) {
  return std::any_of(extensions.begin(), extensions.end(),
                     [&](const VkExtensionProperties& extension) {
                       return std::strcmp(extension.extensionName, name) == 0;
                     });
}

std::vector<VkPhysicalDevice> physicalDevices(const VulkanFunctions& functions,
                                              VkInstance instance) {
  std::uint32_t count = 0;
  functions.EnumeratePhysicalDevices(instance, &count, nullptr);
  std::vector<VkPhysicalDevice> devices(count);
  functions.EnumeratePhysicalDevices(instance, &count, devices.data());
  devices.resize(count);
  return devices;
}

std::vector<VkExtensionProperties> deviceExtensions(const VulkanFunctions& functions,
                                                    VkPhysicalDevice device) {
  std::uint32_t count = 0;
  functions.EnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr);
  std::vector<VkExtensionProperties> extensions(count);
  functions.EnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data());
  return extensions;
}

/// Finds the first family with all of these flags. Returns false if there is none.
bool findFamily(const VulkanFunctions& functions, VkPhysicalDevice device, VkQueueFlags wanted,
                std::uint32_t& family) {
  std::uint32_t count = 0;
  functions.GetPhysicalDeviceQueueFamilyProperties(device, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  functions.GetPhysicalDeviceQueueFamilyProperties(device, &count, families.data());
  for (family = 0; family < count; ++family) {
    if ((families[family].queueFlags & wanted) == wanted) return true;
  }
  return false;
}

DeviceInfo describe(const VulkanFunctions& functions, VkPhysicalDevice device) {
  VkPhysicalDeviceProperties properties{};
  functions.GetPhysicalDeviceProperties(device, &properties);
  DeviceInfo info;
  info.name = properties.deviceName;
  info.type = typeName(properties.deviceType);
  info.apiVersion = properties.apiVersion;
  info.maxStorageBufferRange = properties.limits.maxStorageBufferRange;
  info.maxWorkgroupCount = properties.limits.maxComputeWorkGroupCount[0];
  info.storageBuffersPerStage = properties.limits.maxPerStageDescriptorStorageBuffers;
  const std::vector<VkExtensionProperties> extensions = deviceExtensions(functions, device);
  info.pushDescriptors = contains(extensions, VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME);
  if (properties.apiVersion >= VK_API_VERSION_1_1) {
    VkPhysicalDeviceScalarBlockLayoutFeatures scalarBlockLayout{};
    scalarBlockLayout.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SCALAR_BLOCK_LAYOUT_FEATURES;
    const bool hasScalar = contains(extensions, VK_EXT_SCALAR_BLOCK_LAYOUT_EXTENSION_NAME);
    VkPhysicalDeviceFeatures2 features{};
    features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
    if (hasScalar) features.pNext = &scalarBlockLayout;
    functions.GetPhysicalDeviceFeatures2(device, &features);
    info.pipelineStatistics = features.features.pipelineStatisticsQuery == VK_TRUE;
    info.int64 = features.features.shaderInt64 == VK_TRUE;
    info.float64 = features.features.shaderFloat64 == VK_TRUE;
    info.indirectDraws = features.features.multiDrawIndirect == VK_TRUE &&
                         features.features.drawIndirectFirstInstance == VK_TRUE;
    info.scalarBlockLayout = scalarBlockLayout.scalarBlockLayout == VK_TRUE;
    const RayTracingFeatures rayTracing(functions, device, extensions);
    info.accelerationStructures = rayTracing.accelerationStructures();
    info.rayQueries = rayTracing.rayQueries();
  }
  std::uint32_t family = 0;
  if (properties.apiVersion < VK_API_VERSION_1_1) {
    info.unusable = "it does not support Vulkan 1.1";
  } else if (!findFamily(functions, device, VK_QUEUE_COMPUTE_BIT, family)) {
    info.unusable = "it has no compute queue";
  }
  return info;
}

}  // namespace

Result<std::vector<DeviceInfo>> listDevices() {
  Result<std::shared_ptr<VulkanLoader>> loader = VulkanLoader::open();
  if (!loader) return loader.error();
  Device device;
  device.loader_ = *loader;
  if (Result<void> made = device.createInstance(false, {}); !made) return made.error();
  std::vector<DeviceInfo> infos;
  for (const VkPhysicalDevice physicalDevice :
       physicalDevices(device.functions_, device.instance_)) {
    infos.push_back(describe(device.functions_, physicalDevice));
  }
  return infos;
}

Result<std::unique_ptr<Device>> Device::create(const DeviceOptions& options) {
  Result<std::shared_ptr<VulkanLoader>> loader = VulkanLoader::open();
  if (!loader) return loader.error();
  std::unique_ptr<Device> device(new Device);
  device->loader_ = *loader;
  if (Result<void> made = device->createInstance(options.validation, options.surfaceExtensions);
      !made)
    return made.error();
  if (Result<void> chosen = device->choose(options.device); !chosen) return chosen.error();
  if (Result<void> made = device->createDevice(options); !made) return made.error();
  return device;
}

Device::~Device() {
  if (device_ != VK_NULL_HANDLE) {
    functions_.DeviceWaitIdle(device_);
    functions_.DestroyCommandPool(device_, commandPool_, nullptr);
    functions_.DestroyDevice(device_, nullptr);
  }
  if (messenger_ != VK_NULL_HANDLE) {
    const auto destroy = reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
        loader_->getInstanceProcAddr(instance_, "vkDestroyDebugUtilsMessengerEXT"));
    destroy(instance_, messenger_, nullptr);
  }
  if (instance_ != VK_NULL_HANDLE) functions_.DestroyInstance(instance_, nullptr);
}

Result<void> Device::createInstance(bool validation, std::span<const std::string> extensions) {
  const auto createInstance = reinterpret_cast<PFN_vkCreateInstance>(
      loader_->getInstanceProcAddr(nullptr, "vkCreateInstance"));
  VkApplicationInfo application{};
  application.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
  application.pApplicationName = "dermis";
  application.apiVersion = VK_API_VERSION_1_1;
  VkInstanceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
  info.pApplicationInfo = &application;

  std::vector<const char*> names;
  for (const std::string& extension : extensions) names.push_back(extension.c_str());
  ValidationRequest request;
  VkDebugUtilsMessengerCreateInfoEXT messengerInfo{};
  if (validation) {
    if (Result<void> found = request.prepare(loader_->getInstanceProcAddr, validationLayer); !found)
      return found;
    messengerInfo.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT;
    messengerInfo.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT |
                                    VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
    messengerInfo.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT |
                                VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT;
    messengerInfo.pfnUserCallback = onMessage;
    messengerInfo.pUserData = this;
    info.pNext = request.chain();
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &validationLayer;
    names.insert(names.end(), request.extensions().begin(), request.extensions().end());
    enabledExtensions_.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
  }
  info.enabledExtensionCount = static_cast<std::uint32_t>(names.size());
  info.ppEnabledExtensionNames = names.data();
  if (const VkResult result = createInstance(&info, nullptr, &instance_); result != VK_SUCCESS) {
    instance_ = VK_NULL_HANDLE;
    return unusable(result == VK_ERROR_INCOMPATIBLE_DRIVER
                        ? "there is no Vulkan driver on this machine"
                        : vulkanError("vkCreateInstance", result).message);
  }
#define DERMIS_LOAD(name) \
  functions_.name =       \
      reinterpret_cast<PFN_vk##name>(loader_->getInstanceProcAddr(instance_, "vk" #name));
  DERMIS_SAMPLE_INSTANCE_FUNCTIONS(DERMIS_LOAD)
#undef DERMIS_LOAD
  if (validation) {
    const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
        loader_->getInstanceProcAddr(instance_, "vkCreateDebugUtilsMessengerEXT"));
    if (const VkResult result = create(instance_, &messengerInfo, nullptr, &messenger_);
        result != VK_SUCCESS) {
      return vulkanError("vkCreateDebugUtilsMessengerEXT", result);
    }
  }
  return {};
}

Result<void> Device::choose(const std::string& wanted) {
  const std::vector<VkPhysicalDevice> devices = physicalDevices(functions_, instance_);
  if (devices.empty()) return unusable("there is no Vulkan device on this machine");
  std::vector<DeviceInfo> infos;
  for (const VkPhysicalDevice device : devices) infos.push_back(describe(functions_, device));

  std::size_t number = 0;
  const auto [end, parsed] = std::from_chars(wanted.data(), wanted.data() + wanted.size(), number);
  const bool isNumber = !wanted.empty() && parsed == std::errc() &&
                        end == wanted.data() + wanted.size() && number < infos.size();
  std::size_t best = infos.size();
  for (std::size_t index = 0; index < infos.size(); ++index) {
    const bool matches =
        !wanted.empty() &&
        (wanted == "auto" ||
         (isNumber ? index == number
                   : lowerCase(infos[index].name).find(lowerCase(wanted)) != std::string::npos));
    if (!matches) continue;
    const bool better = best == infos.size() ||
                        (infos[index].unusable.empty() && !infos[best].unusable.empty()) ||
                        (infos[index].unusable.empty() == infos[best].unusable.empty() &&
                         rank(infos[index]) < rank(infos[best]));
    if (better) best = index;
  }
  if (best == infos.size()) {
    return unusable("there is no Vulkan device '" + wanted +
                    "'; 'dermis devices' lists those of this machine");
  }
  if (!infos[best].unusable.empty()) {
    return unusable("device '" + infos[best].name + "' cannot be used: " + infos[best].unusable);
  }
  physicalDevice_ = devices[best];
  info_ = infos[best];
  return {};
}

Result<void> Device::createDevice(const DeviceOptions& options) {
  // Vulkan 1.3, 4.1: if graphics is supported, some family supports both graphics and compute.
  VkQueueFlags wanted = VK_QUEUE_COMPUTE_BIT;
  if (options.graphics) wanted |= VK_QUEUE_GRAPHICS_BIT;
  if (!findFamily(functions_, physicalDevice_, wanted, queueFamily_)) {
    return unusable("device '" + info_.name + "' has no " +
                    (options.graphics ? "graphics" : "compute") + " queue");
  }
  std::vector<const char*> extensions;
  if (options.pushDescriptors && info_.pushDescriptors)
    extensions.push_back(VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME);
  if (!options.surfaceExtensions.empty()) {
    if (!hasExtension(VK_KHR_SWAPCHAIN_EXTENSION_NAME))
      return unusable("device '" + info_.name + "' cannot show pictures in a window");
    extensions.push_back(VK_KHR_SWAPCHAIN_EXTENSION_NAME);
  }
  features_.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  features_.features.shaderInt64 = info_.int64 ? VK_TRUE : VK_FALSE;
  if (options.float64 && info_.float64) features_.features.shaderFloat64 = VK_TRUE;
  if (options.graphics && info_.indirectDraws)
    features_.features.multiDrawIndirect = features_.features.drawIndirectFirstInstance = VK_TRUE;
  if (options.pipelineStatistics && info_.pipelineStatistics)
    features_.features.pipelineStatisticsQuery = VK_TRUE;
  scalarBlockLayout_.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SCALAR_BLOCK_LAYOUT_FEATURES;
  if (info_.scalarBlockLayout) {
    scalarBlockLayout_.scalarBlockLayout = VK_TRUE;
    features_.pNext = &scalarBlockLayout_;
    extensions.push_back(VK_EXT_SCALAR_BLOCK_LAYOUT_EXTENSION_NAME);
  }
  if (options.rayTracing) {
    rayTracing_ = RayTracingFeatures(functions_, physicalDevice_,
                                     deviceExtensions(functions_, physicalDevice_));
    (info_.scalarBlockLayout ? scalarBlockLayout_.pNext : features_.pNext) = rayTracing_.chain();
    for (const char* extension : rayTracing_.extensions()) extensions.push_back(extension);
  }
  enabledExtensions_.insert(enabledExtensions_.end(), extensions.begin(), extensions.end());

  const float priority = 1;
  VkDeviceQueueCreateInfo queueInfo{};
  queueInfo.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
  queueInfo.queueFamilyIndex = queueFamily_;
  queueInfo.queueCount = 1;
  queueInfo.pQueuePriorities = &priority;
  VkDeviceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
  info.pNext = &features_;
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queueInfo;
  info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  if (const VkResult result = functions_.CreateDevice(physicalDevice_, &info, nullptr, &device_);
      result != VK_SUCCESS) {
    device_ = VK_NULL_HANDLE;
    return vulkanError("vkCreateDevice", result);
  }
#define DERMIS_LOAD(name) \
  functions_.name =       \
      reinterpret_cast<PFN_vk##name>(functions_.GetDeviceProcAddr(device_, "vk" #name));
  DERMIS_SAMPLE_DEVICE_FUNCTIONS(DERMIS_LOAD)
#undef DERMIS_LOAD
  functions_.GetDeviceQueue(device_, queueFamily_, 0, &queue_);

  VkCommandPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
  poolInfo.queueFamilyIndex = queueFamily_;
  if (const VkResult result =
          functions_.CreateCommandPool(device_, &poolInfo, nullptr, &commandPool_);
      result != VK_SUCCESS) {
    return vulkanError("vkCreateCommandPool", result);
  }
  return {};
}

bool Device::hasExtension(const char* name) const {
  return contains(deviceExtensions(functions_, physicalDevice_), name);
}

vulkan::DeviceDescription Device::description() const {
  vulkan::DeviceDescription description;
  description.instance = instance_;
  description.physicalDevice = physicalDevice_;
  description.device = device_;
  description.getInstanceProcAddr = loader_->getInstanceProcAddr;
  description.apiVersion = VK_API_VERSION_1_1;
  description.enabledExtensions = enabledExtensions_;
  description.enabledFeatures = &features_;
  return description;
}

Result<std::uint32_t> Device::memoryType(std::uint32_t allowedTypes, VkMemoryPropertyFlags required,
                                         VkMemoryPropertyFlags preferred) const {
  VkPhysicalDeviceMemoryProperties properties{};
  functions_.GetPhysicalDeviceMemoryProperties(physicalDevice_, &properties);
  for (const VkMemoryPropertyFlags wanted : {required | preferred, required}) {
    for (std::uint32_t type = 0; type < properties.memoryTypeCount; ++type) {
      if ((allowedTypes & (1u << type)) != 0 &&
          (properties.memoryTypes[type].propertyFlags & wanted) == wanted) {
        return type;
      }
    }
  }
  return unusable("device '" + info_.name + "' has no memory of the required kind");
}

VkCommandBuffer Device::allocateCommandBuffer(VkCommandBufferLevel level) {
  VkCommandBufferAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
  info.commandPool = commandPool_;
  info.level = level;
  info.commandBufferCount = 1;
  VkCommandBuffer commandBuffer = VK_NULL_HANDLE;
  functions_.AllocateCommandBuffers(device_, &info, &commandBuffer);
  return commandBuffer;
}

void Device::freeCommandBuffer(VkCommandBuffer commandBuffer) {
  functions_.FreeCommandBuffers(device_, commandPool_, 1, &commandBuffer);
}

Result<void> Device::submitAndWait(VkCommandBuffer commandBuffer, std::uint32_t times) {
  VkFenceCreateInfo fenceInfo{};
  fenceInfo.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  VkFence fence = VK_NULL_HANDLE;
  if (const VkResult result = functions_.CreateFence(device_, &fenceInfo, nullptr, &fence);
      result != VK_SUCCESS) {
    return vulkanError("vkCreateFence", result);
  }
  VkSubmitInfo submit{};
  submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  const std::vector<VkCommandBuffer> commandBuffers(times, commandBuffer);
  submit.commandBufferCount = times;
  submit.pCommandBuffers = commandBuffers.data();
  VkResult result = functions_.QueueSubmit(queue_, 1, &submit, fence);
  const char* function = "vkQueueSubmit";
  if (result == VK_SUCCESS) {
    result = functions_.WaitForFences(device_, 1, &fence, VK_TRUE, UINT64_MAX);
    function = "vkWaitForFences";
  }
  functions_.DestroyFence(device_, fence, nullptr);
  if (result != VK_SUCCESS) return vulkanError(function, result);
  return {};
}

Result<void> Device::run(const std::function<Result<void>(VkCommandBuffer)>& record) {
  const VkCommandBuffer commandBuffer = allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  functions_.BeginCommandBuffer(commandBuffer, &begin);
  Result<void> done = record(commandBuffer);
  functions_.EndCommandBuffer(commandBuffer);
  if (done) done = submitAndWait(commandBuffer);
  freeCommandBuffer(commandBuffer);
  return done;
}

std::vector<std::string> Device::takeValidationMessages() {
  const std::lock_guard lock(messagesMutex_);
  return std::exchange(messages_, {});
}

namespace {

/// Whether this is the false alarm of newer layers about dispatches that write different parts of
/// one buffer (docs/integration.md#barriers). Layers until 1.4.309 do not report what both were.
bool isAboutWritesOfDispatches(const std::string& message) {
  const auto has = [&](const char* part) { return message.find(part) != std::string::npos; };
  return has("SYNC-HAZARD-WRITE-AFTER-WRITE") && has("vkCmdDispatch") &&
         has("does not conflict with a prior write of the same type at the same stage");
}

}  // namespace

VKAPI_ATTR VkBool32 VKAPI_CALL Device::onMessage(VkDebugUtilsMessageSeverityFlagBitsEXT,
                                                 VkDebugUtilsMessageTypeFlagsEXT,
                                                 const VkDebugUtilsMessengerCallbackDataEXT* data,
                                                 void* user) {
  Device& device = *static_cast<Device*>(user);
  // Newer layers leave the identifier out of the text.
  const std::string identifier = data->pMessageIdName != nullptr ? data->pMessageIdName : "";
  std::string message = identifier + ": " + data->pMessage;
  if (isAboutWritesOfDispatches(message)) return VK_FALSE;
  const std::lock_guard lock(device.messagesMutex_);
  device.messages_.push_back(std::move(message));
  return VK_FALSE;
}

Result<OpenDevice> openDevice(const DeviceOptions& options) {
  Result<std::unique_ptr<Device>> device = Device::create(options);
  if (!device) return device.error();
  vulkan::DeviceDescription description = (*device)->description();
  description.kernelSource = options.kernels;
  Result<vulkan::Context> context = vulkan::Context::create(description);
  if (!context) return context.error();
  return OpenDevice{std::move(*device), std::move(*context)};
}

std::string driverVersion(const Device& device) {
  VkPhysicalDeviceDriverProperties driver{};
  driver.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES;
  VkPhysicalDeviceProperties2 properties{};
  properties.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
  if (device.hasExtension(VK_KHR_DRIVER_PROPERTIES_EXTENSION_NAME)) properties.pNext = &driver;
  device.functions().GetPhysicalDeviceProperties2(device.physicalDevice(), &properties);
  if (driver.driverName[0] == '\0')
    return "version " + std::to_string(properties.properties.driverVersion);
  return std::string(driver.driverName) + " " + driver.driverInfo;
}

void recordBarrier(const Device& device, VkCommandBuffer commandBuffer, Use before, Use after) {
  const vulkan::Barrier barrier = vulkan::barrierBetween(before, after);
  const VkMemoryBarrier memory = barrier;
  device.functions().CmdPipelineBarrier(commandBuffer, barrier.sourceStages,
                                        barrier.destinationStages, 0, 1, &memory, 0, nullptr, 0,
                                        nullptr);
}

Error vulkanError(const std::string& function, VkResult result) {
  const auto code = static_cast<std::int32_t>(result);
  return {ErrorCode::vulkanError, function + " failed with VkResult " + std::to_string(code), code};
}

Result<void> checkVulkan(const char* function, VkResult result) {
  if (result == VK_SUCCESS) return {};
  return vulkanError(function, result);
}

}  // namespace dermis::samples
