// The descriptor writes of one kernel, for a set or to push.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <vulkan/vulkan_core.h>

#include "vulkan/state.h"

namespace dermis::vulkan {

class DescriptorWrites {
 public:
  /// Bindings without a buffer are left out: the kernel does not use them. `bound` must outlive
  /// this object.
  explicit DescriptorWrites(const BoundBuffers& bound, VkDescriptorSet set = VK_NULL_HANDLE) {
    for (std::uint32_t binding = 0; binding < bound.size(); ++binding) {
      if (bound[binding].buffer == VK_NULL_HANDLE) continue;
      VkWriteDescriptorSet& write = writes_[count_++];
      write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
      write.dstSet = set;
      write.dstBinding = binding;
      write.descriptorCount = 1;
      write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
      write.pBufferInfo = &bound[binding];
    }
  }

  std::uint32_t count() const { return count_; }
  const VkWriteDescriptorSet* data() const { return writes_.data(); }

 private:
  std::array<VkWriteDescriptorSet, BoundBuffers().size()> writes_{};
  std::uint32_t count_ = 0;
};

}  // namespace dermis::vulkan
