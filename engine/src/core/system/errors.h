// Sentences about handles.
#pragma once

#include <string>

#include "dermis/handle.h"
#include "dermis/result.h"

namespace dermis {

/// `kind` is "mesh", "palette" or "instance".
template <typename Thing>
Error unknownHandle(const char* kind, Handle<Thing> handle) {
  if (!handle) return {ErrorCode::invalidArgument, std::string("a null ") + kind + " handle"};
  return {ErrorCode::invalidArgument, "there is no " + std::string(kind) + " " +
                                          std::to_string(handle.index) + " of generation " +
                                          std::to_string(handle.generation) +
                                          "; it was removed, or is another system's"};
}

}  // namespace dermis
