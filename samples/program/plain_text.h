// Names come from files, and a file may put line ends and terminal controls into them.
#pragma once

#include <string>
#include <string_view>

namespace dermis::samples {

/// The text as one line: every control character, those of ISO 6429's upper half in UTF-8 too, is a
/// space.
std::string plainLine(std::string_view text);

}  // namespace dermis::samples
