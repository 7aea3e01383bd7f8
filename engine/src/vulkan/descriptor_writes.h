// The descriptor writes of one kernel, for a set or to push.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan_core.h>

#include "vulkan/state.h"

namespace dermis::vulkan {

class DescriptorWrites {
 public:
  /// Bindings without a buffer are left out: the kernel's module does not declare them, or the
  /// kernel is not recorded. `bound` must outlive this object.
  explicit DescriptorWrites(const Descriptors& bound, VkDescriptorSet set = VK_NULL_HANDLE) {
    for (std::uint32_t binding = 0; binding < bound.buffers.size(); ++binding) {
      if (bound.buffers[binding].buffer == VK_NULL_HANDLE) continue;
      add(set, binding, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER).pBufferInfo = &bound.buffers[binding];
    }
    for (std::uint32_t index = 0; index < bound.texels.size(); ++index) {
      if (bound.texels[index] == VK_NULL_HANDLE) continue;
      add(set, abi::BINDING_COUNT + index, VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER)
          .pTexelBufferView = &bound.texels[index];
    }
  }

  std::uint32_t count() const { return count_; }
  const VkWriteDescriptorSet* data() const { return writes_.data(); }

 private:
  VkWriteDescriptorSet& add(VkDescriptorSet set, std::uint32_t binding, VkDescriptorType type) {
    VkWriteDescriptorSet& write = writes_[count_++];
    write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    write.dstSet = set;
    write.dstBinding = binding;
    write.descriptorCount = 1;
    write.descriptorType = type;
    return write;
  }

  std::array<VkWriteDescriptorSet, abi::BINDING_COUNT + abi::TEXEL_BINDING_COUNT> writes_{};
  std::uint32_t count_ = 0;
};

}  // namespace dermis::vulkan
