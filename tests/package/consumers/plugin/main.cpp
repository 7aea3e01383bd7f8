// A plugin of an engine, with all of Dermis linked in.
#include "dermis/result.h"

extern "C" __attribute__((visibility("default"))) int dermisPluginMain() {
  return dermis::libraryFitsHeaders() ? 0 : 1;
}
