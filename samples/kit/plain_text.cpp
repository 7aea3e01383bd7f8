#include "kit/plain_text.h"

#include "dermis/text.h"

namespace dermis::samples {

std::string plainLine(std::string_view text) {
  return oneLine(text);
}

}  // namespace dermis::samples
