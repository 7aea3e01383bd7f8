// Checks that stored bytes are a packed mesh that is safe for kernels to read.
#pragma once

#include <cstdint>
#include <span>

#include "abi.h"
#include "dermis/result.h"
#include "stored.h"

namespace dermis {

inline constexpr StoredKind storedMesh{"packed mesh", abi::MESH_MAGIC, abi::MESH_VERSION,
                                       abi::MESH_HEADER_WORDS};

/// Checks every offset, count and index of words that are `storedMesh`. O(words).
Result<void> checkMeshWords(std::span<const std::uint32_t> words);

}  // namespace dermis
