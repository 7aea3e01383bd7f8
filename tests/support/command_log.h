// Counts what Dermis calls on its way to the driver, and leaves out barriers that a test wants
// forgotten.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "intercepted_device.h"

namespace dermis::test {

/// Of one device at a time, as `InterceptedDevice`.
class CommandLog {
 public:
  /// Puts itself between Dermis and the driver; must live as long as what was made of it.
  explicit CommandLog(InterceptedDevice& device);
  ~CommandLog();
  CommandLog(const CommandLog&) = delete;
  CommandLog& operator=(const CommandLog&) = delete;

  /// Calls by name, "vkCmdDispatch".
  std::map<std::string, std::uint32_t> calls;
  std::uint32_t count(const char* name) const {
    const auto found = calls.find(name);
    return found == calls.end() ? 0 : found->second;
  }
  /// The regions of each vkCmdCopyBuffer, in order.
  std::vector<std::vector<VkBufferCopy>> copies;
  /// Objects that live: created and not destroyed, allocated and not freed.
  std::int64_t buffersAlive = 0, allocationsAlive = 0;
  std::uint64_t allocatedBytes = 0;  ///< of all allocations there were

  /// Bytes, of storage buffers in pushed descriptors.
  VkDeviceSize longestRange = 0;
  /// The stages of each vkCmdPipelineBarrier, in order.
  std::vector<std::pair<VkPipelineStageFlags, VkPipelineStageFlags>> barriers;

  /// Asked of every vkCmdPipelineBarrier, with its number since `calls` was cleared: whether it is
  /// forgotten.
  std::function<bool(std::uint32_t number)> forgetsBarrier;

  /// Results that a function gives instead of what it would do.
  std::map<std::string, VkResult> failures;
  /// The number, from now on, of the call that fails among those that can; none if it is negative.
  int failsAt = -1;
};

}  // namespace dermis::test
