#include "dermis/version.h"

namespace dermis {

Version libraryVersion() {
  return headerVersion;
}

}  // namespace dermis
