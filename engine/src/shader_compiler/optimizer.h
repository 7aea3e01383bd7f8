// SPIRV-Tools' optimizer and validator for Vulkan 1.1.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dermis/result.h"

namespace dermis {

struct OptimizerOptions {
  bool optimize = true;
  bool keepDebugInfo = false;
  bool scalarBlockLayout = false;  ///< Blocks may have that layout.
};

/// Checks the module, runs the passes, and checks what came out. Unused bindings and specialization
/// constants stay, and NoContraction is respected. Fails with `shaderError`; `name` is the
/// source's, for the message.
Result<std::vector<std::uint32_t>> optimizeAndValidate(std::span<const std::uint32_t> words,
                                                       const OptimizerOptions& options,
                                                       const std::string& name);

/// The version of SPIRV-Tools.
std::string optimizerVersion();

}  // namespace dermis
