// Which kernel skins a mesh.
#pragma once

#include <cstdint>

#include "dermis/plan.h"

namespace dermis {

/// The `Variant::influences` for a mesh whose vertices have at most so many.
std::uint8_t influenceClass(std::uint32_t maxInfluences);

Variant paletteVariant(const Tuning& tuning);

}  // namespace dermis
