// What a vertex of a layout takes.
#pragma once

#include <cstdint>

#include "dermis/layout.h"

namespace dermis {

/// Bytes of one vertex: what its attributes take.
std::uint32_t attributeBytes(const VertexLayout& layout);

}  // namespace dermis
