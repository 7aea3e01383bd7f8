// Names of numbered files.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace dermis::samples {

/// The name of a frame: %0Nd in the pattern replaced by its number, or nothing where there is no
/// such place.
std::optional<std::string> frameName(const std::string& pattern, std::uint32_t frame);

/// Whether a name looks as if a number were meant to go into it in a way, or as often, as none
/// goes.
bool hasWrongPattern(const std::string& name);

}  // namespace dermis::samples
