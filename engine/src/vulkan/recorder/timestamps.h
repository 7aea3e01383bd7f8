// Measures the GPU time of what a SceneRecorder records.
#pragma once

#include <cstdint>
#include <optional>

#include "vulkan/recorder/functions.h"

namespace dermis::vulkan {

/// Two timestamps for each frame in flight.
class Timestamps {
 public:
  Timestamps() = default;
  ~Timestamps();
  Timestamps(const Timestamps&) = delete;
  Timestamps& operator=(const Timestamps&) = delete;

  Result<void> create(const ContextState& context, const SystemFunctions& functions,
                      std::uint32_t frames);
  bool isCreated() const { return pool_ != VK_NULL_HANDLE; }

  void begin(VkCommandBuffer commandBuffer, std::uint32_t frame) const;
  void end(VkCommandBuffer commandBuffer, std::uint32_t frame) const;
  /// The GPU time of a complete frame; empty if timestamps are not created, not available, or not
  /// in ascending order.
  std::optional<double> seconds(std::uint32_t frame) const;

 private:
  const ContextState* context_ = nullptr;
  const SystemFunctions* functions_ = nullptr;
  VkQueryPool pool_ = VK_NULL_HANDLE;
};

}  // namespace dermis::vulkan
