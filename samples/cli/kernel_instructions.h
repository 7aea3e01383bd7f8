// Counts the instructions of a kernel: machine instructions if the driver reports them, otherwise
// those of SPIR-V.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "dermis/vulkan/context.h"
#include "kit/device.h"

namespace dermis::cli {

/// A kernel with specialized constants, all functions inlined, and dead code removed. Empty if
/// SPIRV-Tools fail, or if the command was built without them.
std::vector<std::uint32_t> specializedSpirv(const vulkan::PipelineDescription& pipeline);

/// The number of SPIR-V instructions of a kernel that calculate or access memory, after
/// specialization and removal of dead code. A vector instruction counts once, and so do the
/// instructions of a loop. Empty if SPIRV-Tools fail, or if the command was built without them.
std::optional<std::uint64_t> spirvInstructionCount(const vulkan::PipelineDescription& pipeline);

/// Uses a second VkDevice on the same hardware, because `Device` may lack the required extension
/// VK_KHR_pipeline_executable_properties.
class PipelineStatistics {
 public:
  /// Null if the driver lacks the extension, or if no device can be created with it.
  static std::unique_ptr<PipelineStatistics> create(const samples::Device& device);
  ~PipelineStatistics();
  PipelineStatistics(const PipelineStatistics&) = delete;
  PipelineStatistics& operator=(const PipelineStatistics&) = delete;

  /// The number of machine instructions of a kernel. The kernel must store whole words, since the
  /// second device enables no optional features for other stores. Empty if the driver does not
  /// count instructions.
  std::optional<std::uint64_t> instructionCount(const vulkan::PipelineDescription& pipeline) const;

 private:
  struct Functions;
  PipelineStatistics();
  bool createLayouts();
  VkPipeline createPipeline(VkShaderModule module,
                            const std::vector<std::uint32_t>& constants) const;
  std::optional<std::uint64_t> readCount(VkPipeline pipeline) const;

  std::unique_ptr<Functions> functions_;
  VkDevice device_ = VK_NULL_HANDLE;
  VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
  VkPipelineLayout pipelineLayout_ = VK_NULL_HANDLE;
};

}  // namespace dermis::cli
