// The kernel that chooses, on the GPU, which instances are skinned.
#pragma once

#include <vulkan/vulkan_core.h>

#include <cstdint>
#include <vector>

#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/vulkan/bindings.h"
#include "plan/builder.h"
#include "vulkan/system/functions.h"

namespace dermis::vulkan {

class Visibility {
 public:
  Visibility() = default;
  ~Visibility();
  Visibility(const Visibility&) = delete;
  Visibility& operator=(const Visibility&) = delete;

  /// Pipeline and layouts. `setCount` is the number of frames whose commands may be in flight.
  Result<void> create(const ContextState& context, const Tuning& tuning, std::uint32_t setCount);

  struct Buffers {
    BufferRange tables, visibility, history, counters, results;
  };
  /// Both passes, a barrier between them, and one behind them for the indirect dispatches. `frame`
  /// counts records from 1; `set` is that of the frame, whose earlier commands are complete.
  void record(VkCommandBuffer commandBuffer, const CulledTables& tables, const Buffers& buffers,
              std::uint32_t frame, std::uint32_t set) const;

 private:
  bool hasResults() const;
  Result<void> createLayouts(std::uint32_t setCount);
  Result<void> createPipeline(const Tuning& tuning);
  void bind(VkCommandBuffer commandBuffer, const Buffers& buffers, std::uint32_t set) const;

  const ContextState* context_ = nullptr;
  VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
  VkPipelineLayout pipelineLayout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  std::vector<VkDescriptorSet> sets_;  ///< without push descriptors
};

}  // namespace dermis::vulkan
