#include "dermis/result.h"

namespace dermis {

Version libraryVersion() {
  return headerVersion;
}

}  // namespace dermis
