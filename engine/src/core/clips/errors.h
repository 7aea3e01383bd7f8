// The errors that a bank stores, of all nodes at once.
#pragma once

#include <cstddef>
#include <vector>

#include "dermis/clips.h"

namespace dermis {

/// `PackedClips::error` of each node of a skeleton, without that of weights.
DERMIS_CORE_API std::vector<ClipError> errorsOf(const PackedClips& clips, std::size_t nodeCount);

}  // namespace dermis
