#include "kit/frame_loop.h"

namespace dermis::samples {

FrameLoop::~FrameLoop() {
  static_cast<void>(finish().ok());  // a lost device has nothing to wait for
  for (const Slot& slot : slots_) {
    device_->functions().DestroyFence(device_->handle(), slot.fence, nullptr);
    if (slot.commandBuffer != VK_NULL_HANDLE) device_->freeCommandBuffer(slot.commandBuffer);
  }
}

Result<void> FrameLoop::waitFor(std::uint64_t frame) {
  Slot& slot = slots_[static_cast<std::size_t>(frame % slots_.size())];
  if (slot.isSubmitted) {
    const VkResult waited =
        device_->functions().WaitForFences(device_->handle(), 1, &slot.fence, VK_TRUE, UINT64_MAX);
    if (Result<void> done = checkVulkan("vkWaitForFences", waited); !done) return done;
    slot.isSubmitted = false;
  }
  completed_ = frame;
  return {};
}

Result<VkCommandBuffer> FrameLoop::begin() {
  const VulkanFunctions& functions = device_->functions();
  ++frame_;
  if (frame_ > slots_.size()) {
    if (Result<void> waited = waitFor(frame_ - slots_.size()); !waited) return waited.error();
  }
  Slot& slot = slots_[static_cast<std::size_t>(frame_ % slots_.size())];
  if (slot.fence == VK_NULL_HANDLE) {
    VkFenceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
    const VkResult made = functions.CreateFence(device_->handle(), &info, nullptr, &slot.fence);
    if (Result<void> done = checkVulkan("vkCreateFence", made); !done) return done.error();
  }
  if (slot.commandBuffer != VK_NULL_HANDLE) device_->freeCommandBuffer(slot.commandBuffer);
  slot.commandBuffer = device_->allocateCommandBuffer();
  VkCommandBufferBeginInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  const VkResult begun = functions.BeginCommandBuffer(slot.commandBuffer, &info);
  if (Result<void> done = checkVulkan("vkBeginCommandBuffer", begun); !done) return done.error();
  return slot.commandBuffer;
}

Result<void> FrameLoop::submit() {
  const VulkanFunctions& functions = device_->functions();
  Slot& slot = slots_[static_cast<std::size_t>(frame_ % slots_.size())];
  const VkResult ended = functions.EndCommandBuffer(slot.commandBuffer);
  if (Result<void> done = checkVulkan("vkEndCommandBuffer", ended); !done) return done;
  const VkResult reset = functions.ResetFences(device_->handle(), 1, &slot.fence);
  if (Result<void> done = checkVulkan("vkResetFences", reset); !done) return done;
  VkSubmitInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  info.commandBufferCount = 1;
  info.pCommandBuffers = &slot.commandBuffer;
  const VkResult submitted = functions.QueueSubmit(device_->queue(), 1, &info, slot.fence);
  slot.isSubmitted = submitted == VK_SUCCESS;
  return checkVulkan("vkQueueSubmit", submitted);
}

Result<void> FrameLoop::finish() {
  while (completed_ < frame_) {
    if (Result<void> waited = waitFor(completed_ + 1); !waited) return waited;
  }
  return {};
}

}  // namespace dermis::samples
