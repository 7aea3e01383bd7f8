// What stands in the tables for one instance.
#pragma once

#include <cstdint>

#include "dermis/types.h"

namespace dermis {

/// The words of an extension that say how positions in snorm16 are relative to a box.
void writeBox(std::uint32_t* extension, const Box& box);

}  // namespace dermis
