// The version of these headers and of the library that is used at run time. CMake reads the version
// from here.
#pragma once

#include <cstdint>

#include "dermis/export.h"

/// Changes if the interface breaks.
#define DERMIS_VERSION_MAJOR 0
/// Changes if the interface grows. While the major version is 0: also if it breaks.
#define DERMIS_VERSION_MINOR 1
/// Changes if only the implementation changes.
#define DERMIS_VERSION_PATCH 0

namespace dermis {

/// A version number.
struct Version {
  std::uint32_t major = 0, minor = 0, patch = 0;

  friend constexpr bool operator==(const Version&, const Version&) = default;
};

/// The version of the headers that the program was compiled with.
inline constexpr Version headerVersion{DERMIS_VERSION_MAJOR, DERMIS_VERSION_MINOR,
                                       DERMIS_VERSION_PATCH};

/// The version of the library that the program was linked with or has loaded.
DERMIS_CORE_API Version libraryVersion();

/// Whether a library of version `library` has the interface that headers of version `headers`
/// declare. The major versions must be equal. If they are 0, the minor versions must be equal, too;
/// otherwise the minor version of the library must not be lower.
constexpr bool isCompatible(const Version& headers, const Version& library) {
  if (headers.major != library.major) return false;
  return headers.major == 0 ? headers.minor == library.minor : headers.minor <= library.minor;
}

/// Whether the library that is used at run time has the interface of the headers that the caller
/// was compiled with. A program that loads Dermis as a shared library calls this first.
inline bool libraryFitsHeaders() {
  return isCompatible(headerVersion, libraryVersion());
}

}  // namespace dermis
