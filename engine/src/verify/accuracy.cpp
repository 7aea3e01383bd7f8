#include "dermis/verify/accuracy.h"

#include <algorithm>
#include <cmath>

namespace dermis {
namespace {

/// What a GPU may flush to 0: 64 results below the least normal number, 2^-126, for a vertex.
constexpr double flushed = 0x1p-120;

/// A: by how much dividing by |b| makes errors larger where it is less than a quarter.
double amplification(Method method, const reference::Conditioning& conditioning) {
  return method == Method::linear ? 1 : std::max(1.0, 0.25 / conditioning.blendLength);
}

/// How well a direction is conditioned where it passes through a 3×3.
struct Direction {
  double alignment;
  double bindRounding;     ///< in units of u
  double length;           ///< of what is normalised in the end
  double shortcutsInside;  ///< how many times M's own error counts: M is used so often
};

/// A direction that passes through a 3×3, or is turned by a blended rotation, or both.
double directionBound(Method method, const reference::Conditioning& conditioning,
                      const Direction& direction) {
  constexpr double leastAlignment = 1e-3;
  constexpr double mostOfAlignment = 0.05;
  const double bind = floatRounding * direction.bindRounding;
  const double turned = 1.5e-6 * conditioning.turning * amplification(method, conditioning);
  if (method != Method::linear && conditioning.normalRotatedOnly) {
    return bind > mostOfAlignment ? -1 : turned + conditioning.rigidShortcut + bind;
  }
  const double given = bind + flushed / conditioning.stretch;
  const double aligned = direction.alignment * direction.length;
  if (aligned < leastAlignment || given > mostOfAlignment * aligned) return -1;
  const bool linear = method == Method::linear;
  const double matrix =
      6 * floatRounding + (linear ? 0 : direction.shortcutsInside * conditioning.rigidShortcut);
  const double after = linear ? 2 * floatRounding : turned;
  return ((matrix + given) / direction.alignment + after) / direction.length;
}

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
// Up to 2.5 units in the last place of a division, and about seven other roundings.
constexpr double foldingRounding = 12 * floatRounding;

/// How far a unit vector moves when the point that stands for it on the octahedron moves by `x` and
/// `y`.
double octahedralBound(double x, double y) {
  return std::sqrt(3.0) * std::hypot(x, y, x + y);
}

/// A unit vector whose components are rounded each for itself.
double componentwiseBound(const Precision& precision) {
  if (precision.rounding == Rounding::half) {
    return halfRounding + std::sqrt(3.0) * leastHalfRounding;
  }
  if (precision.rounding == Rounding::none) return 0;
  return std::sqrt(3.0) * (0.5 / precision.largest + floatRounding);
}

}  // namespace

double positionBound(Method method, const reference::Conditioning& conditioning) {
  const double given = floatRounding * conditioning.positionRounding * conditioning.stretch +
                       flushed * (1 + conditioning.distance);
  if (method == Method::linear) return 6 * floatRounding * conditioning.scale + given;
  const double amplified = amplification(method, conditioning);
  return 24 * floatRounding * amplified * amplified * (conditioning.scale + conditioning.leverage) +
         conditioning.rigidShortcut * conditioning.distance + given;
}

double normalBound(Method method, const reference::Conditioning& conditioning) {
  return directionBound(
      method, conditioning,
      {conditioning.normalAlignment, conditioning.normalRounding, conditioning.normalLength, 2});
}

double tangentBound(Method method, const reference::Conditioning& conditioning) {
  return directionBound(
      method, conditioning,
      {conditioning.tangentAlignment, conditioning.tangentRounding, conditioning.tangentLength, 1});
}

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
      const double centre = (low + high) / 2, half = (high - low) / 2;
      error[axis] =
          half * (0.5 / precision.largest) + floatRounding * (4 * std::abs(centre) + 8 * half);
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
