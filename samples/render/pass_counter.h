// How far the device has come with one long submission.
#pragma once

#include <cstdint>
#include <functional>

#include "buffer.h"
#include "device.h"

namespace dermis::samples::render {

class PassCounter {
 public:
  /// `device` must outlive it.
  static Result<PassCounter> create(Device& device, std::uint32_t passes);

  /// Between two passes: one more is done when the device comes here.
  void record(VkCommandBuffer commandBuffer);

  /// Waits for the fence of the submission, and calls `onPass` with each pass that is done, about
  /// when it is. Fails with `vulkanError`.
  Result<void> wait(VkFence fence, const std::function<void()>& onPass) const;
  /// The same, with a fence of its own.
  Result<void> submitAndWait(VkCommandBuffer commandBuffer,
                             const std::function<void()>& onPass) const;

 private:
  Device* device_ = nullptr;
  MappedBuffer words_;  ///< one a pass, not 0 when it is done
  std::uint32_t passes_ = 0, recorded_ = 0;
};

}  // namespace dermis::samples::render
