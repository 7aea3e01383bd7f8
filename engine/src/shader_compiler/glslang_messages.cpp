#include "shader_compiler/glslang_messages.h"

namespace dermis {
namespace {

constexpr std::string_view errorPrefix = "ERROR: ";

// Whether a message starts with "FILE:LINE: ". FILE itself may contain colons.
bool startsWithPlace(std::string_view message) {
  constexpr std::string_view digits = "0123456789";
  std::size_t colon = message.find(':');
  while (colon != std::string_view::npos) {
    const std::size_t lineEnd = message.find_first_not_of(digits, colon + 1);
    if (lineEnd != std::string_view::npos && lineEnd > colon + 1 &&
        message.substr(lineEnd).starts_with(": ")) {
      return colon > 0;
    }
    colon = message.find(':', colon + 1);
  }
  return false;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.back() == ' ' || text.back() == '\r')) text.remove_suffix(1);
  return text;
}

}  // namespace

std::string firstError(std::string_view log, std::string_view name) {
  std::string_view firstLine = trimmed(log.substr(0, log.find('\n')));
  while (!log.empty()) {
    const std::string_view line = trimmed(log.substr(0, log.find('\n')));
    log.remove_prefix(log.find('\n') == std::string_view::npos ? log.size() : log.find('\n') + 1);
    if (!line.starts_with(errorPrefix)) continue;
    const std::string_view message = line.substr(errorPrefix.size());
    if (startsWithPlace(message)) return std::string(message);
    return std::string(name) + ": " + std::string(message);
  }
  return std::string(name) + ": " +
         (firstLine.empty() ? "the compiler failed without a message" : std::string(firstLine));
}

}  // namespace dermis
