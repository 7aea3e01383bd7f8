// Whole files in and out.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "dermis/export.h"
#include "dermis/result.h"

namespace dermis {

/// The bytes of a regular file; nothing for a folder, a device, or what cannot be read.
DERMIS_SHADER_COMPILER_API std::optional<std::string> readFile(const std::filesystem::path& path);

/// Makes or replaces `path` in one step: who reads at the same time sees the old file or the new
/// one, never half of one, and a failure leaves the old one. The folder must exist. Fails with
/// `ioError`.
DERMIS_SHADER_COMPILER_API Result<void> writeFileAtomically(const std::filesystem::path& path,
                                                            std::string_view bytes);

}  // namespace dermis
