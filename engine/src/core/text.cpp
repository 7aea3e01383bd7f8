#include "text.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>

#include "strict_floating_point.h"

namespace dermis {
namespace {

/// A character of UTF-8, or one byte that begins none.
struct Character {
  std::size_t length = 1;
  std::uint32_t code = 0;
  bool isValid = false;
};

Character characterAt(std::string_view text, std::size_t place) {
  const auto byte = [&](std::size_t index) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(text[place + index]));
  };
  const std::uint32_t first = byte(0);
  if (first < 0x80) return {1, first, true};
  const std::size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4 || text.size() - place < length) return {1, first, false};
  std::uint32_t code = first & (0x7fu >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return {1, first, false};
    code = code << 6 | (byte(i) & 0x3f);
  }
  constexpr std::array<std::uint32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
  const bool isSurrogate = code >= 0xd800 && code <= 0xdfff;
  if (code < least[length] || code > 0x10ffff || isSurrogate) return {1, first, false};
  return {length, code, true};
}

/// Controls, separators of lines, and what Unicode calls Bidi_Control.
bool isObeyed(std::uint32_t code) {
  return code < 0x20 || (code >= 0x7f && code <= 0x9f) || code == 0x61c || code == 0x200e ||
         code == 0x200f || (code >= 0x2028 && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069);
}

/// What is shown instead of a character, or nothing if it is shown itself.
std::string escapeOf(const Character& character) {
  if (character.isValid && !isObeyed(character.code)) return {};
  if (character.code == '\n') return "\\n";
  char escaped[8];
  std::snprintf(escaped, sizeof escaped, character.isValid ? "\\u%04x" : "\\x%02x",
                static_cast<unsigned>(character.code));
  return escaped;
}

}  // namespace

std::string oneLine(std::string_view text) {
  return shortName(text, std::numeric_limits<std::size_t>::max());
}

std::string shortName(std::string_view name, std::size_t maxCharacters) {
  std::string line;
  std::size_t shown = 0;
  for (std::size_t place = 0; place < name.size();) {
    const Character character = characterAt(name, place);
    const std::string escape = escapeOf(character);
    shown += escape.empty() ? 1 : escape.size();
    if (shown > maxCharacters) return line + "...";
    line += escape.empty() ? name.substr(place, character.length) : std::string_view(escape);
    place += character.length;
  }
  return line;
}

std::string decimal(double number) {
  char text[40];
  std::snprintf(text, sizeof text, "%.9g", number);
  return text;
}

std::string inQuotes(std::string_view name) {
  std::string quoted(1, '\'');
  quoted += shortName(name);
  quoted += '\'';
  return quoted;
}

}  // namespace dermis
