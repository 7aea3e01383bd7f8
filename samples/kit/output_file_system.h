// What output_file.cpp gets from the operating system, besides the members of OutputFile.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "kit/output_file.h"

namespace dermis::samples {

/// Where output to a file of this name goes. Fails with `ioError`.
Result<OutputTarget> findTarget(const std::filesystem::path& name);

/// Writes to a target that is written through. Fails with `ioError`.
Result<void> writeThrough(const OutputTarget& target, std::span<const std::byte> bytes);

/// A name in a folder that no other file has. It is short, since the name of the target may already
/// have the maximum length.
std::string temporaryNameIn(const std::filesystem::path& folder);

}  // namespace dermis::samples
