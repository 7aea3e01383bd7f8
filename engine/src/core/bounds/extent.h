// Extents: what `jointBounds` makes of vertices and `skinnedBounds` maps by joints.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "bounds/box.h"
#include "dermis/bounds.h"

namespace dermis::bounds {

/// How far each direction of an `Extent` reaches, in double precision.
struct Reach {
  std::array<double, 26> values;

  Reach() { values.fill(-infinity); }
  explicit Reach(const Range& box);
  void add(const Reach& other);
  Extent extent() const;  ///< rounded outward
};

/// A range that holds the image of all points of an extent, which must not be empty. A row d of the
/// map is a sum, with factors that are not negative, of the directions at the corners of the
/// triangle around d: as far as they reach, no point reaches further.
Range imageOf(const Affine& map, const Extent& extent);

/// The box around an extent.
Range rangeOf(const Extent& extent);

}  // namespace dermis::bounds
