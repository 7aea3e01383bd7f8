// Names of output files: their endings, frame numbers, and whether they are inputs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "dermis/result.h"

namespace dermis::samples {

/// The path of a name in UTF-8, the encoding of command-line arguments here. On Windows the
/// encoding that `std::filesystem::path` expects in a `std::string` depends on the standard
/// library.
std::filesystem::path pathOf(std::string_view name);

/// Whether the name ends with `ending` in upper or lower case, and has something before it.
/// `ending` is in lower case.
bool hasEnding(std::string_view name, std::string_view ending);

/// The name of a frame: the first %0Nd in the pattern, with N from 1 to 9, is replaced by the
/// number of the frame. Empty if the pattern has none.
std::optional<std::string> frameName(const std::string& pattern, std::uint32_t frame);

/// Whether a name has more than one placeholder for a number, or one that is not %0Nd.
bool hasWrongPattern(std::string_view name);

/// An output that an option requests.
struct RequestedOutput {
  std::string_view option;   ///< "--json"
  std::string name;          ///< empty: nothing
  std::uint32_t frames = 1;  ///< if the name has a placeholder for a number
};

/// Fails with `invalidArgument` if an output, or one of its frames, would overwrite an input file
/// or another output. Files are compared by identity, so a link counts as the file that it leads
/// to. Devices and FIFOs may be named twice. Of frames, only those that exist are looked at.
Result<void> checkOutputFiles(std::span<const RequestedOutput> outputs,
                              std::span<const std::filesystem::path> inputs);

}  // namespace dermis::samples
