// Measures the GPU time of a command buffer.
#pragma once

#include <cstdint>
#include <utility>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"
#include "kit/device.h"

namespace dermis::samples {

/// Two timestamps, which one command buffer may write repeatedly.
class Timestamps {
 public:
  /// If the queue of the device does not support timestamps, `has` is false. Fails with
  /// `vulkanError`.
  static Result<Timestamps> create(Device& device);
  Timestamps() = default;
  ~Timestamps();
  Timestamps(Timestamps&& other) noexcept { *this = std::move(other); }
  Timestamps& operator=(Timestamps&& other) noexcept;

  bool has() const { return pool_ != VK_NULL_HANDLE; }

  /// Record these before and after the timed commands. Without timestamps they record nothing.
  void recordBegin(VkCommandBuffer commandBuffer) const;
  void recordEnd(VkCommandBuffer commandBuffer) const;

  /// Seconds between both in the last submission, which must be complete. Fails with `vulkanError`.
  Result<double> seconds() const;

  /// Executes a command buffer that contains both, and returns the seconds that it took: on the
  /// device if it has timestamps, otherwise from submission to the end of waiting. A GPU lowers its
  /// clock between short submissions, so it executes the command buffer repeatedly, for 20 ms, and
  /// the last execution counts: begin it for simultaneous use, with a barrier after the previous
  /// execution. Fails with `vulkanError`.
  Result<double> measure(VkCommandBuffer commandBuffer) const;

 private:
  Device* device_ = nullptr;
  VkQueryPool pool_ = VK_NULL_HANDLE;
  std::uint64_t validBits_ = 0;  ///< a mask
  double period_ = 0;            ///< seconds per tick
};

}  // namespace dermis::samples
