// Makes names from files safe to print in messages. A name in a file may have millions of
// characters, and may contain line breaks, control characters for terminals, or marks that reverse
// the writing direction.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "dermis/result.h"

namespace dermis {

/// The text on one line, without characters that a terminal interprets. Control characters (C0,
/// DEL, C1), line and paragraph separators and the marks of bidirectional text are escaped: `\n`,
/// `\u001b`, `\u202e`. A byte that is not UTF-8 becomes its hexadecimal value: `\xff`. Nothing else
/// changes.
DERMIS_CORE_API std::string oneLine(std::string_view text);

/// The first characters of `oneLine(name)`, with "..." after them if there are more.
DERMIS_CORE_API std::string shortName(std::string_view name, std::size_t maxCharacters = 80);

/// A number with nine digits, or fewer if they are zeros.
DERMIS_CORE_API std::string decimal(double number);

/// `shortName` in single quotation marks.
DERMIS_CORE_API std::string inQuotes(std::string_view name);

/// The name of an enumerator; enumerators count from 0. "unknown" for other values.
template <typename Enum, std::size_t count>
const char* nameIn(const char* const (&names)[count], Enum value) {
  const auto index = static_cast<std::size_t>(value);
  return index < count ? names[index] : "unknown";
}

}  // namespace dermis
