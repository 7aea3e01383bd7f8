#include "frames.h"

#include <cstdint>
#include <string>
#include <utility>

using namespace dermis;

namespace crowd {
namespace {

Result<void> checked(const char* function, VkResult result) {
  if (result == VK_SUCCESS) return {};
  return Error{
      ErrorCode::vulkanError,
      std::string(function) + " failed with VkResult " + std::to_string(static_cast<int>(result)),
      static_cast<std::int32_t>(result)};
}

}  // namespace

Result<FrameLoop> FrameLoop::create(samples::Device& device, std::uint32_t framesInFlight) {
  FrameLoop loop(device);
  for (std::uint32_t index = 0; index < framesInFlight; ++index) {
    Slot slot;
    VkFenceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
    if (Result<void> made =
            checked("vkCreateFence",
                    device.functions().CreateFence(device.handle(), &info, nullptr, &slot.fence));
        !made)
      return made.error();
    loop.slots_.push_back(slot);
  }
  return loop;
}

FrameLoop::FrameLoop(FrameLoop&& other) noexcept
    : device_(other.device_),
      slots_(std::exchange(other.slots_, {})),
      frame_(other.frame_),
      completed_(other.completed_) {}

FrameLoop::~FrameLoop() {
  static_cast<void>(finish().ok());  // a device that is lost has nothing to wait for
  for (const Slot& slot : slots_) {
    device_->functions().DestroyFence(device_->handle(), slot.fence, nullptr);
    if (slot.commandBuffer != VK_NULL_HANDLE) device_->freeCommandBuffer(slot.commandBuffer);
  }
}

Result<void> FrameLoop::waitFor(std::uint64_t frame) {
  Slot& slot = slotOf(frame);
  if (slot.isSubmitted) {
    if (Result<void> waited =
            checked("vkWaitForFences", device_->functions().WaitForFences(
                                           device_->handle(), 1, &slot.fence, VK_TRUE, UINT64_MAX));
        !waited)
      return waited;
    slot.isSubmitted = false;
  }
  completed_ = frame;
  return {};
}

Result<VkCommandBuffer> FrameLoop::begin() {
  ++frame_;
  if (frame_ > slots_.size()) {
    if (Result<void> waited = waitFor(frame_ - slots_.size()); !waited) return waited.error();
  }
  Slot& slot = slotOf(frame_);
  if (slot.commandBuffer != VK_NULL_HANDLE) device_->freeCommandBuffer(slot.commandBuffer);
  slot.commandBuffer = device_->allocateCommandBuffer();
  VkCommandBufferBeginInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  if (Result<void> begun = checked("vkBeginCommandBuffer", device_->functions().BeginCommandBuffer(
                                                               slot.commandBuffer, &info));
      !begun)
    return begun.error();
  return slot.commandBuffer;
}

Result<void> FrameLoop::submit() {
  Slot& slot = slotOf(frame_);
  const samples::VulkanFunctions& functions = device_->functions();
  if (Result<void> ended =
          checked("vkEndCommandBuffer", functions.EndCommandBuffer(slot.commandBuffer));
      !ended)
    return ended;
  if (Result<void> reset =
          checked("vkResetFences", functions.ResetFences(device_->handle(), 1, &slot.fence));
      !reset)
    return reset;
  VkSubmitInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  info.commandBufferCount = 1;
  info.pCommandBuffers = &slot.commandBuffer;
  Result<void> submitted =
      checked("vkQueueSubmit", functions.QueueSubmit(device_->queue(), 1, &info, slot.fence));
  slot.isSubmitted = submitted.ok();
  return submitted;
}

Result<void> FrameLoop::finish() {
  for (std::uint64_t frame = completed_ + 1; frame <= frame_ && !slots_.empty(); ++frame) {
    if (Result<void> waited = waitFor(frame); !waited) return waited;
  }
  return {};
}

}  // namespace crowd
