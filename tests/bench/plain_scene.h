// The baselines: a crowd skinned by the plain kernels, plain_palette.comp with plain_skin.comp, or
// plain_linear.comp; and only copied, by plain_copy.comp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "buffer.h"
#include "crowd.h"
#include "open_device.h"

namespace dermis::bench {

/// The entry points that the baseline needs besides those of the samples.
struct PlainFunctions {
  PFN_vkCreateShaderModule createShaderModule = nullptr;
  PFN_vkDestroyShaderModule destroyShaderModule = nullptr;
  PFN_vkCreateDescriptorSetLayout createDescriptorSetLayout = nullptr;
  PFN_vkDestroyDescriptorSetLayout destroyDescriptorSetLayout = nullptr;
  PFN_vkCreatePipelineLayout createPipelineLayout = nullptr;
  PFN_vkDestroyPipelineLayout destroyPipelineLayout = nullptr;
  PFN_vkCreateComputePipelines createComputePipelines = nullptr;
  PFN_vkDestroyPipeline destroyPipeline = nullptr;
  PFN_vkCreateDescriptorPool createDescriptorPool = nullptr;
  PFN_vkDestroyDescriptorPool destroyDescriptorPool = nullptr;
  PFN_vkAllocateDescriptorSets allocateDescriptorSets = nullptr;
  PFN_vkUpdateDescriptorSets updateDescriptorSets = nullptr;
  PFN_vkCmdBindPipeline cmdBindPipeline = nullptr;
  PFN_vkCmdBindDescriptorSets cmdBindDescriptorSets = nullptr;
  PFN_vkCmdPushConstants cmdPushConstants = nullptr;
  PFN_vkCmdDispatch cmdDispatch = nullptr;
};

enum class PlainKernel : std::uint8_t { dualQuaternion, linear, copy };

class PlainScene {
 public:
  /// Ends the process with a message where a Vulkan call fails. As many dispatches as the output
  /// needs storage buffer ranges, each of whole instances.
  PlainScene(samples::OpenDevice& open, const Crowd& crowd,
             PlainKernel kernel = PlainKernel::dualQuaternion);
  ~PlainScene();
  PlainScene(const PlainScene&) = delete;
  PlainScene& operator=(const PlainScene&) = delete;

  /// Submits the palettes and the crowd, waits, and returns the seconds that both took.
  double skin();

  /// Position and normal of every vertex of every instance, interleaved.
  std::span<const std::byte> output() const { return output_.bytes(); }

 private:
  void makeBuffers(const Crowd& crowd);
  void makeLayouts();
  VkPipeline makePipeline(std::span<const std::uint32_t> spirv);
  void record(const Crowd& crowd);
  void recordPalettes(const Crowd& crowd);
  void recordSkinning(const Crowd& crowd);
  void bind(VkPipeline pipeline, std::span<const vulkan::BufferRange> buffers);

  samples::Device& device_;
  PlainKernel kernel_;
  std::uint64_t maxRange_;
  PlainFunctions functions_;
  samples::MappedBuffer vertices_, matrices_, palettes_, output_;
  VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  VkPipeline palettePipeline_ = VK_NULL_HANDLE, skinPipeline_ = VK_NULL_HANDLE;
  VkCommandBuffer commandBuffer_ = VK_NULL_HANDLE;
};

}  // namespace dermis::bench
