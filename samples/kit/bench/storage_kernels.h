// Small compute kernels: pipelines whose bindings are all storage buffers of one descriptor set.
#pragma once

#include <cstdint>
#include <span>

#include "dermis/result.h"
#include "dermis/vulkan/context.h"
#include "kit/device.h"
#include "kit/render/owned.h"

namespace dermis::samples {

/// Several pipelines with one layout. The device must outlive this object.
class StorageKernels {
 public:
  /// `bindings`: storage buffers, numbered from 0. `sets`: how often `bind` may be called. All
  /// functions fail with `vulkanError`.
  static Result<StorageKernels> create(Device& device, std::uint32_t bindings,
                                       std::uint32_t pushConstantBytes, std::uint32_t sets);

  Result<render::Owned<VkPipeline>> makePipeline(std::span<const std::uint32_t> spirv) const;

  /// Binds a pipeline, and the buffers to the bindings from 0 on. Each call takes a descriptor set.
  Result<void> bind(VkCommandBuffer commandBuffer, VkPipeline pipeline,
                    std::span<const vulkan::BufferRange> buffers) const;

  /// Pushes the bytes of `values`.
  void push(VkCommandBuffer commandBuffer, std::span<const std::uint32_t> values) const;

 private:
  Device* device_ = nullptr;
  render::Owned<VkDescriptorSetLayout> setLayout_;
  render::Owned<VkPipelineLayout> layout_;
  render::Owned<VkDescriptorPool> pool_;
};

}  // namespace dermis::samples
