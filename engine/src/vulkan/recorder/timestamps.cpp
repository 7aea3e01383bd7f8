#include "vulkan/recorder/timestamps.h"

#include <array>

namespace dermis::vulkan {

Timestamps::~Timestamps() {
  if (pool_ != VK_NULL_HANDLE)
    functions_->destroyQueryPool(context_->device, pool_, context_->allocator);
}

Result<void> Timestamps::create(const ContextState& context, const SystemFunctions& functions,
                                std::uint32_t frames) {
  context_ = &context;
  functions_ = &functions;
  VkQueryPoolCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
  info.queryType = VK_QUERY_TYPE_TIMESTAMP;
  info.queryCount = frames * 2;
  if (const VkResult result =
          functions.createQueryPool(context.device, &info, context.allocator, &pool_);
      result != VK_SUCCESS) {
    pool_ = VK_NULL_HANDLE;
    return vulkanError("vkCreateQueryPool", result);
  }
  nameObject(context.table, context.device, VK_OBJECT_TYPE_QUERY_POOL, pool_, "dermis timestamps");
  return {};
}

void Timestamps::begin(VkCommandBuffer commandBuffer, std::uint32_t frame) const {
  if (!isCreated()) return;
  functions_->cmdResetQueryPool(commandBuffer, pool_, frame * 2, 2);
  functions_->cmdWriteTimestamp(commandBuffer, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool_,
                                frame * 2);
}

void Timestamps::end(VkCommandBuffer commandBuffer, std::uint32_t frame) const {
  if (!isCreated()) return;
  functions_->cmdWriteTimestamp(commandBuffer, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool_,
                                frame * 2 + 1);
}

std::optional<double> Timestamps::seconds(std::uint32_t frame) const {
  std::array<std::uint64_t, 2> ticks{};
  if (!isCreated() ||
      functions_->getQueryPoolResults(context_->device, pool_, frame * 2, 2, sizeof(ticks),
                                      ticks.data(), sizeof(std::uint64_t),
                                      VK_QUERY_RESULT_64_BIT) != VK_SUCCESS ||
      ticks[1] < ticks[0])
    return std::nullopt;
  return static_cast<double>(ticks[1] - ticks[0]) * static_cast<double>(context_->timestampPeriod) *
         1e-9;
}

}  // namespace dermis::vulkan
