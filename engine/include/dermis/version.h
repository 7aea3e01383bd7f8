// The version of Dermis: of these headers, and of the library that runs. CMake reads it from here.
#pragma once

#include <cstdint>

#include "dermis/export.h"

#define DERMIS_VERSION_MAJOR 0
#define DERMIS_VERSION_MINOR 1
#define DERMIS_VERSION_PATCH 0

namespace dermis {

struct Version {
  std::uint32_t major = 0, minor = 0, patch = 0;

  friend constexpr bool operator==(const Version&, const Version&) = default;
};

/// The version of the headers that a program was compiled with.
inline constexpr Version headerVersion{DERMIS_VERSION_MAJOR, DERMIS_VERSION_MINOR,
                                       DERMIS_VERSION_PATCH};

/// The version of the library that the program was linked with or has loaded.
DERMIS_CORE_API Version libraryVersion();

/// Whether a library of version `library` has the interface that headers of version `headers`
/// declare: the major version is the same and, while that is 0, the minor version too; else the
/// library's minor version is not lower.
constexpr bool isCompatible(const Version& headers, const Version& library) {
  if (headers.major != library.major) return false;
  return headers.major == 0 ? headers.minor == library.minor : headers.minor <= library.minor;
}

/// Whether the library that runs fits the headers that the caller was compiled with. A program
/// that loads a shared library of Dermis calls this first.
inline bool libraryFitsHeaders() {
  return isCompatible(headerVersion, libraryVersion());
}

}  // namespace dermis
