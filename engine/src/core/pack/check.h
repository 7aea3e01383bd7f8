// Whether stored bytes are a packed mesh that no kernel can be led astray by.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "dermis/result.h"

namespace dermis {

/// Of all words that follow the checksum's own: FNV-1a's step, turned by 15 bits, since multiplying
/// carries changes upwards only. Each step is a bijection: no single damaged word goes unnoticed.
std::uint32_t checksumOfBlob(std::span<const std::uint32_t> words);

Error damagedBlob(const std::string& what);

/// The length, the version, the checksum, and every offset, count and index. O(words).
Result<void> checkBlob(std::span<const std::uint32_t> words);

}  // namespace dermis
