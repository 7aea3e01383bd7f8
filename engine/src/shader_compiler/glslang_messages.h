// glslang's log, read back.
#pragma once

#include <string>
#include <string_view>

namespace dermis {

/// The first error in an info log of glslang as "FILE:LINE: text", or as "NAME: text" where it
/// names no line. `name` is the source's.
std::string firstError(std::string_view log, std::string_view name);

}  // namespace dermis
