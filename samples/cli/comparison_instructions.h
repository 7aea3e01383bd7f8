// How long a kernel is, for devices whose driver does not say.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "dermis/plan.h"

namespace dermis::cli {

/// A kernel with its constants specialised, everything inlined, and without what they leave dead;
/// nothing if SPIRV-Tools fail.
std::vector<std::uint32_t> specializedSpirv(const Variant& variant, const DeviceLimits& limits);

/// The SPIR-V instructions of a kernel that calculate or touch memory, once its constants are
/// specialised and what they leave dead is gone. One for a vector, and a loop's counted once.
/// Nothing if SPIRV-Tools fail, or the command was built without them.
std::optional<std::uint64_t> spirvInstructionCount(const Variant& variant,
                                                   const DeviceLimits& limits);

}  // namespace dermis::cli
