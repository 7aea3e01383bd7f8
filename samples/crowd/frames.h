// The frame loop of a small engine: a command buffer and a fence for each frame in flight.
#pragma once

#include <cstdint>
#include <vector>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"
#include "kit/device.h"

namespace crowd {

/// Frames count from 1. The CPU may be ahead of the GPU by all frames in flight. It waits for the
/// oldest frame only when the next one needs its slot.
class FrameLoop {
 public:
  /// Fails with `vulkanError`.
  static dermis::Result<FrameLoop> create(dermis::samples::Device& device,
                                          std::uint32_t framesInFlight);
  /// Waits for all frames.
  ~FrameLoop();
  FrameLoop(FrameLoop&& other) noexcept;
  FrameLoop& operator=(FrameLoop&&) = delete;

  /// Waits until there is a slot for the next frame, and begins its command buffer.
  dermis::Result<VkCommandBuffer> begin();
  dermis::Result<void> submit();
  /// The fence of the frame that was submitted last. The loop waits for it, too.
  VkFence fence() const { return slots_[frame_ % slots_.size()].fence; }
  /// Waits for all submitted frames.
  dermis::Result<void> finish();

  std::uint64_t frame() const { return frame_; }          ///< the one that was begun last
  std::uint64_t completed() const { return completed_; }  ///< the newest that was waited for

 private:
  struct Slot {
    VkCommandBuffer commandBuffer = VK_NULL_HANDLE;
    VkFence fence = VK_NULL_HANDLE;
    bool isSubmitted = false;
  };

  explicit FrameLoop(dermis::samples::Device& device) : device_(&device) {}
  Slot& slotOf(std::uint64_t frame) { return slots_[frame % slots_.size()]; }
  dermis::Result<void> waitFor(std::uint64_t frame);

  dermis::samples::Device* device_;
  std::vector<Slot> slots_;
  std::uint64_t frame_ = 0;
  std::uint64_t completed_ = 0;
};

}  // namespace crowd
