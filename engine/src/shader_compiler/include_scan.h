// Which files a source may include, found without compiling it.
#pragma once

#include <set>
#include <string>
#include <string_view>

#include "shader_compiler/hash.h"
#include "shader_compiler/include_resolver.h"

namespace dermis {

/// Adds every file that `text` may include, directly or through others, to `hash`, and returns
/// their paths. Conditions are not evaluated: files inside a false `#if` are added too. If a file
/// does not exist, that is added, so that the hash changes when the file appears.
///
/// It reads lines of the form `#include "name"` and `#include <name>`. It misses others (with a
/// comment or a line continuation between `#` and the name); the caller notices them by comparing
/// with what the compiler included.
std::set<std::string> hashIncludes(std::string_view text, const std::string& name,
                                   IncludeResolver& resolver, Hash128& hash);

}  // namespace dermis
