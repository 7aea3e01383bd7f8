// Reads and writes whole files.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "dermis/result.h"

namespace dermis {

/// The bytes of a regular file; nothing for a folder, a device, or what cannot be read.
DERMIS_SHADER_COMPILER_API std::optional<std::string> readFile(const std::filesystem::path& path);

/// Creates or replaces `path` in one step: a concurrent reader sees either the old file or the new
/// one, complete. If it fails, the old file remains. The folder must exist. Fails with `ioError`.
DERMIS_SHADER_COMPILER_API Result<void> writeFileAtomically(const std::filesystem::path& path,
                                                            std::string_view bytes);

}  // namespace dermis
