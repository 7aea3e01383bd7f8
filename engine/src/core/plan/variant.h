// Which kernel skins a mesh.
#pragma once

#include <cstdint>

#include "dermis/plan.h"

namespace dermis {

/// The `Variant::influences` for a mesh whose vertices have at most so many.
std::uint8_t influenceClass(std::uint32_t maxInfluences);

Variant paletteVariant(const Tuning& tuning);

/// Whether there is a kernel for a variant that reads through uniform texel buffers. Those that
/// store less than a word, and devices with few storage buffers, do without.
bool mayReadTexels(const Variant& variant, const DeviceLimits& limits);

/// Whether one with the outputs of this job may store pairs, given that it reads texels and that
/// its outputs are one buffer.
bool mayStorePairs(const Job& job, const DeviceLimits& limits);

/// Whether tables and palettes, or meshes, of that many bytes fit in a uniform texel buffer.
bool fitsUnitTexels(std::uint64_t bytes, const DeviceLimits& limits);
bool fitsWordTexels(std::uint64_t bytes, const DeviceLimits& limits);

}  // namespace dermis
