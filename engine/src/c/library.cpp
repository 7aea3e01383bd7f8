// The version, and the end of all objects. Not in `dermis_compare`.
#include "object.h"

extern "C" {

uint32_t dermis_version(void) {
  return dermis::libraryVersion();
}

void dermis_destroy(void* object) {
  const auto* destroyed = static_cast<dermis::c::Object*>(object);
  if (destroyed != nullptr && !destroyed->isLent) delete destroyed;
}

}  // extern "C"
