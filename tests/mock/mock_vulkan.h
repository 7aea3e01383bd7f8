// A Vulkan driver that does nothing but count and remember: for what Dermis asks of a device, in
// which order, and what it leaves behind when a call fails. It has no function to submit or wait.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <vulkan/vulkan_core.h>

#include "dermis/vulkan/context.h"

namespace dermis::test {

/// What a binding refers to, itself or by a view.
struct MockDescriptor {
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceSize offset = 0, range = 0;

  friend bool operator==(const MockDescriptor&, const MockDescriptor&) = default;
};
using MockDescriptors = std::map<std::uint32_t, MockDescriptor>;  ///< by binding

/// A dispatch, and the state in which it was recorded.
struct MockDispatch {
  const std::uint32_t* code = nullptr;  ///< of the pipeline's module
  MockDescriptors descriptors;
  VkDescriptorSet set = VK_NULL_HANDLE;  ///< null if descriptors are pushed
  std::array<std::uint32_t, 9> constants{};
  std::uint32_t groupCountX = 0, groupCountY = 0;
};

struct MockSetLayout {
  VkDescriptorSetLayoutCreateFlags flags = 0;
  std::vector<VkDescriptorSetLayoutBinding> bindings;
};

struct MockBuffer {
  VkDeviceSize size = 0;
  VkBufferUsageFlags usage = 0;
  VkDeviceMemory memory = VK_NULL_HANDLE;
};

struct MockMemory {
  std::uint32_t type = 0;
  bool hasAddress = false;       ///< for VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT
  std::vector<std::byte> bytes;  ///< not zero
};

struct MockCopy {
  VkBuffer from = VK_NULL_HANDLE, to = VK_NULL_HANDLE;
  std::vector<VkBufferCopy> regions;
};

struct MockVulkan {
  MockVulkan();
  ~MockVulkan();
  MockVulkan(const MockVulkan&) = delete;
  MockVulkan& operator=(const MockVulkan&) = delete;

  vulkan::DeviceDescription description() const;

  std::set<std::string> missing;  ///< entry points that do not exist
  std::string failing;            ///< the function that fails …
  int failAfter = 0;              ///< … after succeeding so many times
  VkResult failure = VK_ERROR_OUT_OF_DEVICE_MEMORY;
  VkPhysicalDeviceLimits limits{};
  VkPhysicalDeviceType deviceType = VK_PHYSICAL_DEVICE_TYPE_OTHER;
  std::uint32_t vendor = 0;
  std::vector<const char*> physicalExtensions;  ///< of the physical device
  std::vector<const char*> extensions;
  const VkAllocationCallbacks* allocator = nullptr;

  std::set<std::string> requested;    ///< every entry point that was asked for
  std::map<std::string, int> alive;   ///< objects by kind, created and not destroyed
  std::vector<std::string> commands;  ///< what was recorded
  std::vector<vulkan::Barrier> memoryBarriers;
  std::vector<VkBufferMemoryBarrier> bufferBarriers;
  std::vector<MockCopy> copies;
  bool wrongAllocator = false;  ///< an object came or went without the engine's allocator

  std::vector<const std::uint32_t*> modules;       ///< the code of each that was created
  std::vector<VkPipelineCache> cachesOfPipelines;  ///< of each that was created
  std::vector<MockSetLayout> setLayouts;
  std::vector<MockDispatch> dispatches;
  std::map<VkDescriptorSet, MockDescriptors> sets;
  std::uint32_t setsInPool = 0, descriptorsInPool = 0, texelDescriptorsInPool = 0;
  std::map<VkBufferView, VkBufferViewCreateInfo> views;

  /// One type that the CPU can write, as a CPU device has it, unless a test says otherwise.
  VkPhysicalDeviceMemoryProperties memoryTypes{};
  std::array<VkDeviceSize, 4> freeMemory{};  ///< bytes, by type
  VkDeviceSize largestAllocation = ~VkDeviceSize{0};
  std::map<VkBuffer, MockBuffer> buffers;         ///< alive
  std::map<VkDeviceMemory, MockMemory> memories;  ///< alive

  VkDeviceSize memoryBytes() const;

  // The state of the command buffer, and what handles stand for.
  std::map<VkShaderModule, const std::uint32_t*> codeOfModule;
  std::map<VkPipeline, const std::uint32_t*> codeOfPipeline;
  MockDispatch next;

  int aliveObjects() const;
};

}  // namespace dermis::test
