// Reports the progress of the device in one long submission.
#pragma once

#include <cstdint>
#include <functional>

#include "kit/buffer.h"
#include "kit/device.h"

namespace dermis::samples::render {

class PassCounter {
 public:
  /// `device` must outlive it.
  static Result<PassCounter> create(Device& device, std::uint32_t passes);

  /// Record this between two passes: it marks one more pass as done.
  void record(VkCommandBuffer commandBuffer);

  /// Submits and waits. Calls `onPass` for each completed pass, at about the time when it
  /// completes. Fails with `vulkanError`.
  Result<void> submitAndWait(VkCommandBuffer commandBuffer,
                             const std::function<void()>& onPass) const;

 private:
  Result<void> wait(VkFence fence, const std::function<void()>& onPass) const;

  Device* device_ = nullptr;
  MappedBuffer words_;  ///< one per pass; not 0 when it is done
  std::uint32_t passes_ = 0, recorded_ = 0;
};

}  // namespace dermis::samples::render
