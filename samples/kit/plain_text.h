// Makes names from files safe to print: they may contain line breaks and terminal control
// characters.
#pragma once

#include <string>
#include <string_view>

namespace dermis::samples {

/// The text on one line, with terminal control characters escaped (dermis/text.h).
std::string plainLine(std::string_view text);

}  // namespace dermis::samples
