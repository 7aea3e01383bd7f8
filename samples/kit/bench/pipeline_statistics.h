// What a driver tells about the machine code of a kernel (VK_KHR_pipeline_executable_properties).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dermis/vulkan/context.h"
#include "kit/device.h"

namespace dermis::samples {

/// A pipeline as its driver compiled it.
struct CompiledKernel {
  std::uint32_t subgroupSize = 0;
  /// Names and values. Both are those of the driver.
  std::vector<std::pair<std::string, std::uint64_t>> statistics;
  std::string assembly;  ///< the last of the driver's texts; empty unless it was asked for

  /// The number of machine instructions. Empty if the driver does not count them.
  std::optional<std::uint64_t> instructionCount() const;
};

/// Uses a second VkDevice on the same hardware, because `Device` may lack the required extension.
class PipelineStatistics {
 public:
  /// Null if the driver lacks the extension, or if no device can be created with it.
  static std::unique_ptr<PipelineStatistics> create(const Device& device);
  ~PipelineStatistics();
  PipelineStatistics(const PipelineStatistics&) = delete;
  PipelineStatistics& operator=(const PipelineStatistics&) = delete;

  /// The kernel must not use texel buffers, since the second device enables no optional features.
  /// Empty if the driver cannot create the pipeline.
  std::optional<CompiledKernel> compile(const vulkan::PipelineDescription& pipeline,
                                        bool withAssembly = false) const;

 private:
  struct Functions;
  PipelineStatistics();
  bool createLayouts();
  VkPipeline createPipeline(VkShaderModule module, const std::vector<std::uint32_t>& constants,
                            bool withAssembly) const;
  CompiledKernel read(VkPipeline pipeline, bool withAssembly) const;

  std::unique_ptr<Functions> functions_;
  VkDevice device_ = VK_NULL_HANDLE;
  VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
  VkPipelineLayout pipelineLayout_ = VK_NULL_HANDLE;
};

}  // namespace dermis::samples
