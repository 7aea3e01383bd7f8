#include "dermis/layout.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "attribute.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

struct Layout {
  std::string_view name;
  ComponentType type;
  bool octahedral = false;
};

const Layout& layoutOf(VertexFormat format) {
  static constexpr Layout layouts[] = {{"none", ComponentType::snorm8},
                                       {"float32x3", ComponentType::float32},
                                       {"float32x4", ComponentType::float32},
                                       {"float16x3", ComponentType::float16},
                                       {"float16x4", ComponentType::float16},
                                       {"snorm16x3", ComponentType::snorm16},
                                       {"snorm16x4", ComponentType::snorm16},
                                       {"snorm8x3", ComponentType::snorm8},
                                       {"snorm8x4", ComponentType::snorm8},
                                       {"octahedral16x2", ComponentType::snorm16, true},
                                       {"octahedral8x2", ComponentType::snorm8, true}};
  const auto index = static_cast<std::size_t>(format);
  return layouts[index < std::size(layouts) ? index : 0];
}

/// The stored vector as an attribute of one element.
AttributeView viewOf(const Layout& layout, const void* data) {
  return {data, 1, 0, layout.type, 4};
}

/// A point of the unfolded octahedron to the direction that it stands for.
std::array<double, 3> unfold(double x, double y) {
  const double z = 1 - std::abs(x) - std::abs(y);
  if (z < 0) {
    const double foldedX = (1 - std::abs(y)) * (x < 0 ? -1 : 1);
    y = (1 - std::abs(x)) * (y < 0 ? -1 : 1);
    x = foldedX;
  }
  const double length = std::hypot(x, y, z);
  return {x / length, y / length, z / length};
}

std::array<double, 3> loadVector(const AttributeView& stored) {
  return {loadReal(stored, 0, 0), loadReal(stored, 0, 1), loadReal(stored, 0, 2)};
}

}  // namespace

std::uint32_t formatAlignment(VertexFormat format) {
  return componentSize(layoutOf(format).type);
}

std::string_view formatName(VertexFormat format) {
  return layoutOf(format).name;
}

std::array<double, 3> decodePosition(VertexFormat format, const void* data, const Box& box) {
  if (!isPositionFormat(format)) return {};
  std::array<double, 3> position = loadVector(viewOf(layoutOf(format), data));
  if (!isSnormPosition(format)) return position;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto low = static_cast<double>(box.min[axis]), high = static_cast<double>(box.max[axis]);
    position[axis] = (low + high) / 2 + position[axis] * ((high - low) / 2);
  }
  return position;
}

std::array<double, 3> decodeNormal(VertexFormat format, const void* data) {
  if (!isNormalFormat(format)) return {};
  const Layout& layout = layoutOf(format);
  const AttributeView stored = viewOf(layout, data);
  if (!layout.octahedral) return loadVector(stored);
  return unfold(loadReal(stored, 0, 0), loadReal(stored, 0, 1));
}

std::array<double, 4> decodeTangent(VertexFormat format, const void* data) {
  if (!isTangentFormat(format)) return {};
  const Layout& layout = layoutOf(format);
  const AttributeView stored = viewOf(layout, data);
  if (!layout.octahedral) {
    const std::array<double, 3> v = loadVector(stored);
    return {v[0], v[1], v[2], loadReal(stored, 0, 3)};
  }
  // The second component counts from 1, so that its sign is free to be the handedness.
  const bool isWide = layout.type == ComponentType::snorm16;
  const int largest = isWide ? 32767 : 127;
  const int signedStep = isWide ? int{loadComponent<std::int16_t>(stored, 0, 1)}
                                : int{loadComponent<std::int8_t>(stored, 0, 1)};
  const int step = std::clamp(std::abs(signedStep), 1, largest);
  const double y = 2.0 * (step - 1) / (largest - 1) - 1;
  const std::array<double, 3> v = unfold(loadReal(stored, 0, 0), y);
  return {v[0], v[1], v[2], signedStep < 0 ? -1.0 : 1.0};
}

}  // namespace dermis
