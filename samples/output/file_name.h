// Names of output files: their endings, the numbers of frames, and whether they are inputs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "dermis/result.h"

namespace dermis::samples {

/// Of a name in UTF-8, as programs take them from the command line. What `std::filesystem::path`
/// makes of a `std::string` depends on the standard library on Windows.
std::filesystem::path pathOf(std::string_view name);

/// Whether something stands before that ending, which is given in lower case, in any case.
bool hasEnding(std::string_view name, std::string_view ending);

/// The name of a frame: the first %0Nd in the pattern, N from 1 to 9, replaced by its number.
/// Nothing if there is none.
std::optional<std::string> frameName(const std::string& pattern, std::uint32_t frame);

/// Whether a name has a place for a number that is not %0Nd, or more than one.
bool hasWrongPattern(std::string_view name);

/// What an option asks to write.
struct RequestedOutput {
  std::string_view option;   ///< "--json"
  std::string name;          ///< empty: nothing
  std::uint32_t frames = 1;  ///< if the name has a place for a number
};

/// Fails with `invalidArgument` if an output, or one of its frames, would overwrite a file that is
/// read, or another output: whatever they are called, links are the same file. Devices and FIFOs
/// may be named twice.
Result<void> checkOutputFiles(std::span<const RequestedOutput> outputs,
                              std::span<const std::filesystem::path> inputs);

}  // namespace dermis::samples
