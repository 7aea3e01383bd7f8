#include "kit/render/pass_counter.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace dermis::samples::render {

constexpr std::uint64_t pollInterval = 100'000'000;  // nanoseconds

Result<PassCounter> PassCounter::create(Device& device, std::uint32_t passes) {
  PassCounter counter;
  counter.device_ = &device;
  counter.passes_ = passes;
  Result<MappedBuffer> words =
      MappedBuffer::create(device, std::uint64_t{passes} * sizeof(std::uint32_t),
                           VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
  if (!words) return words.error();
  counter.words_ = std::move(*words);
  std::ranges::fill(counter.words_.bytes(), std::byte{0});
  return counter;
}

void PassCounter::record(VkCommandBuffer commandBuffer) {
  if (recorded_ == passes_) return;
  const VkDeviceSize offset = std::uint64_t{recorded_++} * sizeof(std::uint32_t);
  device_->functions().CmdFillBuffer(commandBuffer, words_.handle(), offset, sizeof(std::uint32_t),
                                     1);
}

Result<void> PassCounter::wait(VkFence fence, const std::function<void()>& onPass) const {
  std::uint32_t told = 0;
  VkResult result = VK_TIMEOUT;
  while (result == VK_TIMEOUT) {
    result =
        device_->functions().WaitForFences(device_->handle(), 1, &fence, VK_TRUE, pollInterval);
    // A value read before the fence may be outdated; then a pass is only reported a moment later.
    for (; told < recorded_; ++told) {
      std::uint32_t word = 0;
      std::memcpy(&word, words_.bytes().data() + std::size_t{told} * sizeof(word), sizeof(word));
      if (word == 0 && result != VK_SUCCESS) break;
      onPass();
    }
  }
  return checkVulkan("drawing", result);
}

Result<void> PassCounter::submitAndWait(VkCommandBuffer commandBuffer,
                                        const std::function<void()>& onPass) const {
  const VulkanFunctions& functions = device_->functions();
  VkFenceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  VkFence fence = VK_NULL_HANDLE;
  Result<void> done =
      checkVulkan("drawing", functions.CreateFence(device_->handle(), &info, nullptr, &fence));
  if (!done) return done;
  VkSubmitInfo submit{};
  submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commandBuffer;
  done = checkVulkan("drawing", functions.QueueSubmit(device_->queue(), 1, &submit, fence));
  if (done) done = wait(fence, onPass);
  functions.DestroyFence(device_->handle(), fence, nullptr);
  return done;
}

}  // namespace dermis::samples::render
