#include "test_device.h"

#include <array>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

namespace dermis::test {
namespace {

struct Attempt {
  bool tried = false;
  std::string reason;
  std::optional<samples::OpenDevice> device;
};

std::array<Attempt, 2> attempts;

/// Devices go before the process's static objects do: those of the loader and its layers among
/// them.
class DestroyDevices : public ::testing::Environment {
 public:
  void TearDown() override {
    for (Attempt& attempt : attempts) attempt.device.reset();
  }
};
[[maybe_unused]] const bool isRegistered = (destroyDevicesAtTheEnd(), true);

/// The same for all devices of the process.
PFN_vkGetInstanceProcAddr realInstanceProcAddr = nullptr;
PFN_vkGetDeviceProcAddr realDeviceProcAddr = nullptr;
VkPhysicalDeviceMemoryProperties memoryProperties{};

/// What a driver gives may hold anything. Lavapipe's is zero, which hides what is not cleared.
VkResult VKAPI_CALL allocateFilled(VkDevice device, const VkMemoryAllocateInfo* info,
                                   const VkAllocationCallbacks* allocator, VkDeviceMemory* memory) {
  const auto call = [&]<typename Function>(Function, const char* name, auto... arguments) {
    return reinterpret_cast<Function>(realDeviceProcAddr(device, name))(device, arguments...);
  };
  const VkResult result = call(PFN_vkAllocateMemory{}, "vkAllocateMemory", info, allocator, memory);
  if (result != VK_SUCCESS) return result;
  const VkMemoryPropertyFlags flags =
      memoryProperties.memoryTypes[info->memoryTypeIndex].propertyFlags;
  void* mapped = nullptr;
  if ((flags & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT) == 0 ||
      call(PFN_vkMapMemory{}, "vkMapMemory", *memory, VkDeviceSize{0}, VK_WHOLE_SIZE,
           VkMemoryMapFlags{0}, &mapped) != VK_SUCCESS)
    return result;
  std::memset(mapped, 0xa5, static_cast<std::size_t>(info->allocationSize));
  call(PFN_vkUnmapMemory{}, "vkUnmapMemory", *memory);
  return result;
}
PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char* name) {
  if (std::string_view(name) == "vkAllocateMemory")
    return reinterpret_cast<PFN_vkVoidFunction>(allocateFilled);
  return realDeviceProcAddr(device, name);
}
PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char* name) {
  if (std::string_view(name) == "vkGetDeviceProcAddr")
    return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
  return realInstanceProcAddr(instance, name);
}

Result<vulkan::Context> createContext(const samples::Device& device) {
  vulkan::DeviceDescription description = device.description();
  realInstanceProcAddr = std::exchange(description.getInstanceProcAddr, getInstanceProcAddr);
  realDeviceProcAddr = reinterpret_cast<PFN_vkGetDeviceProcAddr>(
      realInstanceProcAddr(description.instance, "vkGetDeviceProcAddr"));
  device.functions().GetPhysicalDeviceMemoryProperties(device.physicalDevice(), &memoryProperties);
  return vulkan::Context::create(description);
}

void tryToCreate(bool pushDescriptors, Attempt& attempt) {
  samples::DeviceOptions options = testDeviceOptions();
  options.pushDescriptors = pushDescriptors;
  Result<std::unique_ptr<samples::Device>> device = samples::Device::create(options);
  if (!device) {
    attempt.reason = device.error().message;
    return;
  }
  Result<vulkan::Context> context = createContext(**device);
  if (context) {
    attempt.device = samples::OpenDevice{std::move(*device), std::move(*context)};
  } else {
    attempt.reason = context.error().message;
  }
}

}  // namespace

void destroyDevicesAtTheEnd() {
  [[maybe_unused]] static const ::testing::Environment* const last =
      ::testing::AddGlobalTestEnvironment(new DestroyDevices);
}

samples::DeviceOptions testDeviceOptions() {
  samples::DeviceOptions options;
  options.validation = true;
  options.float64 = true;  // for kernels whose `fma` rounds once
  const char* wanted = std::getenv("DERMIS_TEST_DEVICE");
  if (wanted != nullptr) options.device = wanted;
  return options;
}

samples::OpenDevice* testDevice(bool pushDescriptors, std::string& reason) {
  Attempt& attempt = attempts[pushDescriptors ? 1 : 0];
  if (!attempt.tried) {
    attempt.tried = true;
    tryToCreate(pushDescriptors, attempt);
  }
  reason = attempt.reason;
  return attempt.device ? &*attempt.device : nullptr;
}

bool isContinuousIntegration() {
  return std::getenv("CI") != nullptr;
}

void DeviceTest::useDevice(bool pushDescriptors) {
  std::string reason;
  device_ = testDevice(pushDescriptors, reason);
  if (device_ != nullptr) return;
  if (isContinuousIntegration())
    FAIL() << "CI needs a Vulkan device and the validation layer: " << reason;
  GTEST_SKIP() << reason;
}

void DeviceTest::TearDown() {
  if (device_ == nullptr) return;
  for (const std::string& message : device().takeValidationMessages()) ADD_FAILURE() << message;
}

}  // namespace dermis::test
