#include "frame_name.h"

#include <fmt/format.h>

#include <iterator>
#include <regex>

namespace dermis::samples {

std::optional<std::string> frameName(const std::string& pattern, std::uint32_t frame) {
  static const std::regex place("%0([1-9])d");
  std::smatch match;
  if (!std::regex_search(pattern, match, place)) return std::nullopt;
  return match.prefix().str() + fmt::format("{:0{}}", frame, std::stoi(match[1].str())) +
         match.suffix().str();
}

bool hasWrongPattern(const std::string& name) {
  static const std::regex anyPlace("%[0-9]*d");
  const auto places = std::distance(std::sregex_iterator(name.begin(), name.end(), anyPlace),
                                    std::sregex_iterator());
  return places > 1 || (places == 1 && !frameName(name, 0));
}

}  // namespace dermis::samples
