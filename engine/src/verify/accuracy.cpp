#include "dermis/verify.h"

#include <algorithm>
#include <cmath>

#include "strict_floating_point.h"

namespace dermis {
namespace {

enum class Rounding { none, half, snorm, octahedral };

struct Precision {
  Rounding rounding = Rounding::none;
  double largest = 1;  ///< the largest integer of a snorm component
};

Precision precisionOf(VertexFormat format) {
  switch (format) {
    case VertexFormat::none:
    case VertexFormat::float32x3:
    case VertexFormat::float32x4:
      return {};
    case VertexFormat::float16x3:
    case VertexFormat::float16x4:
      return {Rounding::half, 1};
    case VertexFormat::snorm16x3:
    case VertexFormat::snorm16x4:
      return {Rounding::snorm, 32767};
    case VertexFormat::snorm8x3:
    case VertexFormat::snorm8x4:
      return {Rounding::snorm, 127};
    case VertexFormat::octahedral16x2:
      return {Rounding::octahedral, 32767};
    case VertexFormat::octahedral8x2:
      return {Rounding::octahedral, 127};
  }
  return {};
}

constexpr double halfRounding = 0x1p-11;
constexpr double leastHalfRounding = 0x1p-25;
// Up to 2.5 units in the last place for a division, and about seven other roundings.
constexpr double foldingRounding = 12 * floatRounding;

/// How far a unit vector moves if its point on the octahedron moves by `x` and `y`.
double octahedralBound(double x, double y) {
  return std::sqrt(3.0) * std::hypot(x, y, x + y);
}

/// Bound for a unit vector whose components are rounded separately.
double componentwiseBound(const Precision& precision) {
  if (precision.rounding == Rounding::half) {
    return halfRounding + std::sqrt(3.0) * leastHalfRounding;
  }
  if (precision.rounding == Rounding::none) return 0;
  return std::sqrt(3.0) * (0.5 / precision.largest + floatRounding);
}

}  // namespace

double positionFormatBound(VertexFormat format, const reference::Double3& position,
                           const Box& box) {
  const Precision precision = precisionOf(format);
  reference::Double3 error{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (precision.rounding == Rounding::half) {
      error[axis] = std::max(halfRounding * std::abs(position[axis]), leastHalfRounding);
    } else if (precision.rounding == Rounding::snorm) {
      const auto low = static_cast<double>(box.min[axis]);
      const auto high = static_cast<double>(box.max[axis]);
      const double center = (low + high) / 2, half = (high - low) / 2;
      error[axis] =
          half * (0.5 / precision.largest) + floatRounding * (4 * std::abs(center) + 8 * half);
    }
  }
  return std::hypot(error[0], error[1], error[2]);
}

double normalFormatBound(VertexFormat format) {
  const Precision precision = precisionOf(format);
  if (precision.rounding != Rounding::octahedral) return componentwiseBound(precision);
  const double step = 0.5 / precision.largest + foldingRounding;
  return octahedralBound(step, step);
}

double tangentFormatBound(VertexFormat format) {
  const Precision precision = precisionOf(format);
  if (precision.rounding != Rounding::octahedral) return componentwiseBound(precision);
  return octahedralBound(0.5 / precision.largest + foldingRounding,
                         1 / (precision.largest - 1) + foldingRounding);
}

}  // namespace dermis
