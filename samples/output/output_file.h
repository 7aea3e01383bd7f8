// Files that are there whole or not at all.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

#include "dermis/result.h"

namespace dermis::samples {

/// Replaces a file. Where writing it stops half-way, it is removed if it is a regular file; one
/// that cannot be opened stays as it is. Fails with `ioError`.
Result<void> writeFile(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace dermis::samples
