// Boxes and affine maps in double precision, for the bounds of a skinned mesh.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "bounds/joint_bounds_data.h"
#include "linear_algebra.h"

namespace dermis::bounds {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

/// Empty by default: min > max.
struct Range {
  math::Vec3 min{infinity, infinity, infinity};
  math::Vec3 max{-infinity, -infinity, -infinity};

  bool empty() const { return min.x > max.x; }
  void add(const math::Vec3& point) { add(Range{point, point}); }
  void add(const Range& other) {
    min = math::min(min, other.min);
    max = math::max(max, other.max);
  }
  Range grownBy(double margin) const { return {min - margin, max + margin}; }
};

inline Range everything() {
  return {math::Vec3(-infinity), math::Vec3(infinity)};
}

inline Range operator+(const Range& a, const Range& b) {
  return {a.min + b.min, a.max + b.max};
}
/// Maximum distance of a point of the range from the origin.
inline double reachOf(const Range& range) {
  return math::length(math::max(math::abs(range.min), math::abs(range.max)));
}

/// The largest float that is not above `value`. A finite `value` above all finite floats gives the
/// largest of them; one below all finite floats gives -inf.
inline float roundDown(double value) {
  constexpr float largest = std::numeric_limits<float>::max();
  if (value < -static_cast<double>(largest)) return -std::numeric_limits<float>::infinity();
  if (value >= static_cast<double>(largest)) {
    return value == infinity ? std::numeric_limits<float>::infinity() : largest;
  }
  const auto rounded = static_cast<float>(value);
  return static_cast<double>(rounded) <= value
             ? rounded
             : std::nextafter(rounded, -std::numeric_limits<float>::infinity());
}

inline float roundUp(double value) {
  return -roundDown(-value);
}

/// Rounded outward.
inline Box boxOf(const Range& range) {
  Box box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.min[axis] = roundDown(range.min[axis]);
    box.max[axis] = roundUp(range.max[axis]);
  }
  return box;
}

inline Range rangeOf(const Box& box) {
  return {{box.min[0], box.min[1], box.min[2]}, {box.max[0], box.max[1], box.max[2]}};
}

/// An affine map x → linear x + offset.
struct AffineMap {
  math::Mat3 linear;
  math::Vec3 offset;
};

inline AffineMap operator+(const AffineMap& a, const AffineMap& b) {
  return {a.linear + b.linear, a.offset + b.offset};
}
inline AffineMap operator-(const AffineMap& a, const AffineMap& b) {
  return {a.linear - b.linear, a.offset - b.offset};
}
inline AffineMap operator*(double factor, const AffineMap& a) {
  return {factor * a.linear, factor * a.offset};
}
/// x → a(x) × v
inline AffineMap cross(const AffineMap& a, const math::Vec3& v) {
  return {{{math::cross(a.linear[0], v), math::cross(a.linear[1], v), math::cross(a.linear[2], v)}},
          math::cross(a.offset, v)};
}

/// `Extent::reach` in double precision.
struct Reach {
  std::array<double, 26> values;

  Reach() { values.fill(-infinity); }
  explicit Reach(const Range& box);
  void add(const Reach& other);
  Extent extent() const;  ///< rounded outward
};

/// A range that contains the image of all points of an extent, which must not be empty. A row d of
/// the map lies between three of the 26 directions, to a face, an edge and a corner of the cube: it
/// is a sum of them with factors ≥ 0. So the same sum of their reaches bounds the reach along d.
Range imageOf(const AffineMap& map, const Extent& extent);

/// The box around an extent.
Range rangeOf(const Extent& extent);

}  // namespace dermis::bounds
