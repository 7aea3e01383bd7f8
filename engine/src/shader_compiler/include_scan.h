// Which files a source may include, found without compiling it.
#pragma once

#include <set>
#include <string>
#include <string_view>

#include "shader_compiler/hash.h"
#include "shader_compiler/include_resolver.h"

namespace dermis {

/// Adds every file that `text` may include, directly or through others, to `hash`, and returns
/// their paths. Conditions are not evaluated: a file behind an `#if` that is false counts, and one
/// that does not exist counts by its absence, so that the hash changes when it appears.
///
/// It reads lines of the form `#include "name"` and `#include <name>`. What hides from it (a
/// comment or a line continuation between `#` and the name) is noticed by comparing with what the
/// compiler really included.
std::set<std::string> hashIncludes(std::string_view text, const std::string& name,
                                   IncludeResolver& resolver, Hash128& hash);

}  // namespace dermis
