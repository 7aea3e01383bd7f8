#include "dermis/result.h"

namespace dermis {

std::uint32_t libraryVersion() {
  return headerVersion;
}

}  // namespace dermis
