// Names come from files, and a file may put line ends and terminal controls into them.
#pragma once

#include <string>
#include <string_view>

namespace dermis::samples {

/// The text as one line, whatever a terminal obeys in it escaped (dermis/text.h).
std::string plainLine(std::string_view text);

}  // namespace dermis::samples
