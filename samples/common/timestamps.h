// How long the device takes for what a command buffer does.
#pragma once

#include <cstdint>
#include <utility>

#include <vulkan/vulkan_core.h>

#include "dermis/result.h"
#include "device.h"

namespace dermis::samples {

/// Two timestamps, to be written by one command buffer again and again.
class Timestamps {
 public:
  /// Where the device's queue has none, an object that `has` none. Fails with `vulkanError`.
  static Result<Timestamps> create(Device& device);
  Timestamps() = default;
  ~Timestamps();
  Timestamps(Timestamps&& other) noexcept { *this = std::move(other); }
  Timestamps& operator=(Timestamps&& other) noexcept;

  bool has() const { return pool_ != VK_NULL_HANDLE; }

  /// Around what is timed. Without timestamps they record nothing.
  void recordBegin(VkCommandBuffer commandBuffer) const;
  void recordEnd(VkCommandBuffer commandBuffer) const;

  /// Seconds between them in the last submission, which is over. Fails with `vulkanError`.
  Result<double> seconds() const;

 private:
  Device* device_ = nullptr;
  VkQueryPool pool_ = VK_NULL_HANDLE;
  std::uint64_t validBits_ = 0;  ///< a mask
  double period_ = 0;            ///< seconds a tick
};

}  // namespace dermis::samples
