// The frame loop of a small engine: a command buffer and a fence for each frame in flight.
#pragma once

#include <cstdint>
#include <vector>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"
#include "kit/device.h"

namespace dermis::samples {

/// Frames are numbered from 1. The CPU waits for the oldest frame in flight only when the next one
/// needs its command buffer. Functions fail with `vulkanError`.
class FrameLoop {
 public:
  FrameLoop(Device& device, std::uint32_t framesInFlight)
      : device_(&device), slots_(framesInFlight) {}
  /// Waits for all frames.
  ~FrameLoop();
  FrameLoop(const FrameLoop&) = delete;
  FrameLoop& operator=(const FrameLoop&) = delete;

  /// Begins the next frame and its command buffer.
  Result<VkCommandBuffer> begin();
  Result<void> submit();
  /// Waits for all submitted frames.
  Result<void> finish();

  std::uint64_t frame() const { return frame_; }          ///< the one that was begun last
  std::uint64_t completed() const { return completed_; }  ///< the newest that was waited for

 private:
  struct Slot {
    VkCommandBuffer commandBuffer = VK_NULL_HANDLE;
    VkFence fence = VK_NULL_HANDLE;
    bool isSubmitted = false;
  };

  Result<void> waitFor(std::uint64_t frame);

  Device* device_;
  std::vector<Slot> slots_;
  std::uint64_t frame_ = 0, completed_ = 0;
};

}  // namespace dermis::samples
