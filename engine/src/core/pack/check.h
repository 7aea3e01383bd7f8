// Checks that stored bytes are a packed mesh that is safe for kernels to read.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "dermis/result.h"

namespace dermis {

/// Checksum of all words after the checksum itself: the step of FNV-1a, rotated by 15 bits, since
/// multiplication carries changes upwards only. Each step is a bijection, so any single damaged
/// word is detected.
std::uint32_t checksumOfBlob(std::span<const std::uint32_t> words);

Error damagedBlob(const std::string& what);

/// Checks the length, the version, the checksum, and every offset, count and index. O(words).
Result<void> checkBlob(std::span<const std::uint32_t> words);

}  // namespace dermis
