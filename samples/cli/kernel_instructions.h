// Counts the SPIR-V instructions of a kernel.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "dermis/vulkan/context.h"

namespace dermis::cli {

/// Opcodes. SPIR-V 1.3, section 3.32.
inline constexpr std::uint32_t opExtInst = 12, opFunction = 54;

/// A kernel with specialized constants, all functions inlined, and dead code removed. Empty if
/// SPIRV-Tools fail, or if the command was built without them.
std::vector<std::uint32_t> specializedSpirv(const vulkan::PipelineDescription& pipeline);

/// The number of SPIR-V instructions of a kernel that calculate or access memory, after
/// specialization and removal of dead code. A vector instruction counts once, and so do the
/// instructions of a loop. Empty if SPIRV-Tools fail, or if the command was built without them.
std::optional<std::uint64_t> spirvInstructionCount(const vulkan::PipelineDescription& pipeline);

}  // namespace dermis::cli
