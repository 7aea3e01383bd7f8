// The driver's statistics about the machine code of a kernel.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "dermis/plan.h"
#include "kit/device.h"

namespace dermis::samples {

/// Uses a second VkDevice on the same hardware, because `Device` may lack the required extension
/// VK_KHR_pipeline_executable_properties.
class PipelineStatistics {
 public:
  /// Null if the driver lacks the extension, or if no device can be created with it.
  static std::unique_ptr<PipelineStatistics> create(const Device& device);
  ~PipelineStatistics();
  PipelineStatistics(const PipelineStatistics&) = delete;
  PipelineStatistics& operator=(const PipelineStatistics&) = delete;

  /// The number of machine instructions of a kernel. The kernel must store whole words, since the
  /// second device enables no optional features for other stores. Empty if the driver does not
  /// count instructions.
  std::optional<std::uint64_t> instructionCount(const Variant& variant,
                                                const DeviceLimits& limits) const;

 private:
  struct Functions;
  PipelineStatistics();
  bool createLayouts();
  VkPipeline createPipeline(VkShaderModule module, const Variant& variant) const;
  std::optional<std::uint64_t> readCount(VkPipeline pipeline) const;

  std::unique_ptr<Functions> functions_;
  VkDevice device_ = VK_NULL_HANDLE;
  VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
  VkPipelineLayout pipelineLayout_ = VK_NULL_HANDLE;
};

}  // namespace dermis::samples
