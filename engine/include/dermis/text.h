// Names that come from files, made fit for a message. A file may put three million characters into
// a name, and line ends, terminal controls or marks that turn the direction of writing around.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "dermis/export.h"

namespace dermis {

/// The text on one line, nothing in it that a terminal obeys: controls (C0, DEL, C1), line and
/// paragraph separators and the marks of bidirectional text become `\n`, `\u001b`, `\u202e` and so
/// on; bytes that are not UTF-8 become `\xff`. Nothing else changes.
DERMIS_CORE_API std::string oneLine(std::string_view text);

/// The first characters of a name on one line, "..." behind them if there are more.
DERMIS_CORE_API std::string shortName(std::string_view name, std::size_t mostCharacters = 80);

/// `shortName` in single quotation marks.
DERMIS_CORE_API std::string inQuotes(std::string_view name);

}  // namespace dermis
