// Finds the error in glslang's log.
#pragma once

#include <string>
#include <string_view>

namespace dermis {

/// The first error in an info log of glslang as "FILE:LINE: text", or as "NAME: text" if it names
/// no line. Without an error, `text` is the first line of the log. `name` is the source's.
std::string firstError(std::string_view log, std::string_view name);

}  // namespace dermis
