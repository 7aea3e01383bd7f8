#include "dermis/result.h"

#include "text.h"

namespace dermis {

std::string_view errorCodeName(ErrorCode code) {
  constexpr const char* names[] = {"invalidArgument",    "invalidMesh",        "invalidData",
                                   "unsupportedVersion", "unsupportedFeature", "limitExceeded",
                                   "notPrepared",        "missingEntryPoint",  "missingFeature",
                                   "vulkanError",        "shaderError",        "ioError"};
  static_assert(std::size(names) == std::size_t(ErrorCode::ioError) + 1);
  return nameIn(names, code);
}

}  // namespace dermis
