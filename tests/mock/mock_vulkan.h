// A Vulkan driver that does nothing but count and remember: for what Dermis asks of a device, in
// which order, and what it leaves behind when a call fails. It has no function to submit, wait, map
// or allocate memory with.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "dermis/vulkan/context.h"

namespace dermis::test {

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
  std::vector<const char*> extensions;
  const VkAllocationCallbacks* allocator = nullptr;

  std::set<std::string> requested;    ///< every entry point that was asked for
  std::map<std::string, int> alive;   ///< objects by kind, created and not destroyed
  std::vector<std::string> commands;  ///< what was recorded
  std::vector<VkMemoryBarrier> memoryBarriers;
  std::vector<VkBufferMemoryBarrier> bufferBarriers;
  bool wrongAllocator = false;  ///< an object came or went without the engine's allocator

  int aliveObjects() const;
};

}  // namespace dermis::test
