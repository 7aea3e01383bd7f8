#include "plain_text.h"

namespace dermis::samples {

std::string plainLine(std::string_view text) {
  std::string line(text);
  for (std::size_t i = 0; i < line.size(); ++i) {
    const auto byte = static_cast<unsigned char>(line[i]);
    if (byte < 0x20 || byte == 0x7f) line[i] = ' ';
    if (byte == 0xc2 && i + 1 < line.size()) {
      const auto next = static_cast<unsigned char>(line[i + 1]);
      if (next >= 0x80 && next <= 0x9f) line[i] = line[i + 1] = ' ';
    }
  }
  return line;
}

}  // namespace dermis::samples
