#include "gltf/failure.h"

#include <cstdio>

namespace dermis::gltf {

std::string textOf(double number) {
  char text[40];
  std::snprintf(text, sizeof text, "%.9g", number);
  return text;
}

std::string inQuotes(std::string_view name) {
  constexpr std::size_t longest = 80;
  std::string text = "'";
  for (const char character : name.substr(0, longest)) {
    const bool printable = static_cast<unsigned char>(character) >= 0x20 && character != 0x7f;
    text.push_back(printable ? character : '?');
  }
  if (name.size() > longest) {
    // Not in the middle of a UTF-8 sequence.
    while ((static_cast<unsigned char>(text.back()) & 0xc0) == 0x80) text.pop_back();
    if (static_cast<unsigned char>(text.back()) >= 0xc0) text.pop_back();
    text += "...";
  }
  return text + "'";
}

void fail(ErrorCode code, std::string message) {
  throw Failure{Error{code, std::move(message), 0}};
}

}  // namespace dermis::gltf
