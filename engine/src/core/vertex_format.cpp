#include "dermis/layout.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "strict_floating_point.h"

namespace dermis {
namespace {

/// How the components of a format are stored.
enum class Storage : std::uint8_t { nothing, float32, float16, snorm16, snorm8 };

struct Layout {
  Storage storage;
  bool octahedral;
  std::string_view name;
};

Layout layoutOf(VertexFormat format) {
  switch (format) {
    case VertexFormat::none:
      break;
    case VertexFormat::float32x3:
      return {Storage::float32, false, "float32x3"};
    case VertexFormat::float32x4:
      return {Storage::float32, false, "float32x4"};
    case VertexFormat::float16x3:
      return {Storage::float16, false, "float16x3"};
    case VertexFormat::float16x4:
      return {Storage::float16, false, "float16x4"};
    case VertexFormat::snorm16x3:
      return {Storage::snorm16, false, "snorm16x3"};
    case VertexFormat::snorm16x4:
      return {Storage::snorm16, false, "snorm16x4"};
    case VertexFormat::snorm8x3:
      return {Storage::snorm8, false, "snorm8x3"};
    case VertexFormat::snorm8x4:
      return {Storage::snorm8, false, "snorm8x4"};
    case VertexFormat::octahedral16x2:
      return {Storage::snorm16, true, "octahedral16x2"};
    case VertexFormat::octahedral8x2:
      return {Storage::snorm8, true, "octahedral8x2"};
  }
  return {Storage::nothing, false, "none"};
}

std::uint32_t bytesOf(Storage storage) {
  switch (storage) {
    case Storage::nothing:
      return 0;
    case Storage::float32:
      return 4;
    case Storage::float16:
    case Storage::snorm16:
      return 2;
    case Storage::snorm8:
      return 1;
  }
  return 0;
}

/// The largest integer of a snorm component.
int largestOf(Storage storage) {
  return storage == Storage::snorm8 ? 127 : 32767;
}

/// Assembled from bytes, lowest first, so that the machine's own order does not matter.
std::uint32_t loadBits(const void* data, std::uint32_t component, std::uint32_t bytes) {
  const auto* first = static_cast<const unsigned char*>(data) + std::size_t{component} * bytes;
  std::uint32_t bits = 0;
  for (std::uint32_t byte = 0; byte < bytes; ++byte) {
    bits |= std::uint32_t{first[byte]} << (8 * byte);
  }
  return bits;
}

int loadInteger(const void* data, std::uint32_t component, Storage storage) {
  const std::uint32_t bytes = bytesOf(storage);
  const auto value = static_cast<int>(loadBits(data, component, bytes));
  const int range = 1 << (8 * bytes);
  return value >= range / 2 ? value - range : value;
}

/// IEEE 754-2008, section 3.4, binary16: a sign, 5 bits of exponent, 10 of fraction.
double halfToDouble(std::uint32_t bits) {
  const auto exponent = static_cast<int>(bits >> 10 & 31);
  const double fraction = bits & 1023;
  double magnitude;
  if (exponent == 31) {
    magnitude = fraction == 0 ? HUGE_VAL : std::nan("");
  } else if (exponent == 0) {
    magnitude = std::ldexp(fraction, -24);
  } else {
    magnitude = std::ldexp(1024 + fraction, exponent - 25);
  }
  return (bits >> 15 & 1) != 0 ? -magnitude : magnitude;
}

double loadComponent(const void* data, std::uint32_t component, Storage storage) {
  switch (storage) {
    case Storage::nothing:
      return 0;
    case Storage::float32: {
      const std::uint32_t bits = loadBits(data, component, 4);
      float value;
      std::memcpy(&value, &bits, sizeof(value));
      return static_cast<double>(value);
    }
    case Storage::float16:
      return halfToDouble(loadBits(data, component, 2));
    case Storage::snorm16:
    case Storage::snorm8:
      return std::max(
          -1.0, static_cast<double>(loadInteger(data, component, storage)) / largestOf(storage));
  }
  return 0;
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

std::array<double, 3> loadVector(const Layout& layout, const void* data) {
  return {loadComponent(data, 0, layout.storage), loadComponent(data, 1, layout.storage),
          loadComponent(data, 2, layout.storage)};
}

}  // namespace

std::uint32_t formatAlignment(VertexFormat format) {
  return std::max(bytesOf(layoutOf(format).storage), 1u);
}

std::string_view formatName(VertexFormat format) {
  return layoutOf(format).name;
}

std::array<double, 3> decodePosition(VertexFormat format, const void* data, const Box& box) {
  if (!isPositionFormat(format)) return {};
  std::array<double, 3> position = loadVector(layoutOf(format), data);
  if (!isSnormPosition(format)) return position;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto low = static_cast<double>(box.min[axis]), high = static_cast<double>(box.max[axis]);
    position[axis] = (low + high) / 2 + position[axis] * ((high - low) / 2);
  }
  return position;
}

std::array<double, 3> decodeNormal(VertexFormat format, const void* data) {
  if (!isNormalFormat(format)) return {};
  const Layout layout = layoutOf(format);
  if (!layout.octahedral) return loadVector(layout, data);
  return unfold(loadComponent(data, 0, layout.storage), loadComponent(data, 1, layout.storage));
}

std::array<double, 4> decodeTangent(VertexFormat format, const void* data) {
  if (!isTangentFormat(format)) return {};
  const Layout layout = layoutOf(format);
  if (!layout.octahedral) {
    const std::array<double, 3> v = loadVector(layout, data);
    return {v[0], v[1], v[2], loadComponent(data, 3, layout.storage)};
  }
  // The second component counts from 1, so that its sign is free to be the handedness.
  const int largest = largestOf(layout.storage);
  const int signedStep = loadInteger(data, 1, layout.storage);
  const int step = std::clamp(std::abs(signedStep), 1, largest);
  const double y = 2.0 * (step - 1) / (largest - 1) - 1;
  const std::array<double, 3> v = unfold(loadComponent(data, 0, layout.storage), y);
  return {v[0], v[1], v[2], signedStep < 0 ? -1.0 : 1.0};
}

}  // namespace dermis
