#include "dermis/result.h"

namespace dermis {

std::string_view errorCodeName(ErrorCode code) {
  switch (code) {
    case ErrorCode::invalidArgument:
      return "invalidArgument";
    case ErrorCode::invalidMesh:
      return "invalidMesh";
    case ErrorCode::invalidData:
      return "invalidData";
    case ErrorCode::unsupportedVersion:
      return "unsupportedVersion";
    case ErrorCode::unsupportedFeature:
      return "unsupportedFeature";
    case ErrorCode::limitExceeded:
      return "limitExceeded";
    case ErrorCode::notPrepared:
      return "notPrepared";
    case ErrorCode::missingEntryPoint:
      return "missingEntryPoint";
    case ErrorCode::missingFeature:
      return "missingFeature";
    case ErrorCode::vulkanError:
      return "vulkanError";
    case ErrorCode::shaderError:
      return "shaderError";
    case ErrorCode::ioError:
      return "ioError";
  }
  return "unknown";
}

}  // namespace dermis
