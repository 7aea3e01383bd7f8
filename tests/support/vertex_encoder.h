// What a kernel should write for a value, in double precision and by the plainest means: each
// component rounded to the nearest that its format has, as layout.h documents.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dermis/layout.h"
#include "dermis/mesh.h"

namespace dermis::test {

using EncodedVertex = std::vector<unsigned char>;

/// The lowest `bytes` bytes of `bits`, lowest first.
inline void appendBits(EncodedVertex& encoded, std::uint32_t bits, std::uint32_t bytes) {
  for (std::uint32_t byte = 0; byte < bytes; ++byte) {
    encoded.push_back(static_cast<unsigned char>(bits >> (8 * byte) & 255));
  }
}

/// The binary16 nearest to a number, ties to even.
inline std::uint32_t halfOf(double value) {
  const std::uint32_t sign = std::signbit(value) ? 0x8000 : 0;
  if (std::isnan(value)) return sign | 0x7e00;
  const double magnitude = std::abs(value);
  if (magnitude >= 65520) return sign | 0x7c00;
  const int exponent = magnitude < std::ldexp(1.0, -14) ? -14 : std::ilogb(magnitude);
  const double steps = std::nearbyint(std::ldexp(magnitude, 10 - exponent));
  // The leading 1 of a normal number carries into the exponent, and so does a step too many.
  return sign |
         (static_cast<std::uint32_t>(exponent + 14) * 1024 + static_cast<std::uint32_t>(steps));
}

inline int snormOf(double value, int largest) {
  return static_cast<int>(std::lround(std::clamp(value, -1.0, 1.0) * largest));
}

inline void appendComponent(EncodedVertex& encoded, VertexFormat format, double value) {
  switch (format) {
    case VertexFormat::float32x3:
    case VertexFormat::float32x4: {
      const auto rounded = static_cast<float>(value);
      const auto* bytes = reinterpret_cast<const unsigned char*>(&rounded);
      encoded.insert(encoded.end(), bytes, bytes + sizeof(rounded));
      break;
    }
    case VertexFormat::float16x3:
    case VertexFormat::float16x4:
      appendBits(encoded, halfOf(value), 2);
      break;
    case VertexFormat::snorm16x3:
    case VertexFormat::snorm16x4:
    case VertexFormat::octahedral16x2:
      appendBits(encoded, static_cast<std::uint32_t>(snormOf(value, 32767)), 2);
      break;
    case VertexFormat::snorm8x3:
    case VertexFormat::snorm8x4:
    case VertexFormat::octahedral8x2:
      appendBits(encoded, static_cast<std::uint32_t>(snormOf(value, 127)), 1);
      break;
    case VertexFormat::none:
      break;
  }
}

inline bool isOctahedral(VertexFormat format) {
  return format == VertexFormat::octahedral16x2 || format == VertexFormat::octahedral8x2;
}

inline bool hasFourComponents(VertexFormat format) {
  return formatName(format).ends_with("x4");
}

/// Meyer et al. 2010: the octahedron's lower half folded outwards.
inline std::array<double, 2> foldedOctahedron(const std::array<double, 3>& v) {
  const double sum = std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]);
  if (sum == 0) return {0, 0};
  const double x = v[0] / sum, y = v[1] / sum;
  if (v[2] >= 0) return {x, y};
  return {(1 - std::abs(y)) * (x < 0 ? -1 : 1), (1 - std::abs(x)) * (y < 0 ? -1 : 1)};
}

inline EncodedVertex encodePosition(VertexFormat format, const std::array<double, 3>& position,
                                    const Box& box = {}) {
  EncodedVertex encoded;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double value = position[axis];
    if (isSnormPosition(format)) {
      const double low = double{box.min[axis]}, high = double{box.max[axis]};
      value = high > low ? (value - (low + high) / 2) / ((high - low) / 2) : 0;
    }
    appendComponent(encoded, format, value);
  }
  if (hasFourComponents(format)) appendComponent(encoded, format, 1);
  return encoded;
}

inline EncodedVertex encodeNormal(VertexFormat format, const std::array<double, 3>& normal) {
  EncodedVertex encoded;
  if (isOctahedral(format)) {
    for (const double part : foldedOctahedron(normal)) appendComponent(encoded, format, part);
    return encoded;
  }
  for (const double part : normal) appendComponent(encoded, format, part);
  if (hasFourComponents(format)) appendComponent(encoded, format, 0);
  return encoded;
}

inline EncodedVertex encodeTangent(VertexFormat format, const std::array<double, 4>& tangent) {
  const std::array<double, 3> direction{tangent[0], tangent[1], tangent[2]};
  EncodedVertex encoded;
  if (isOctahedral(format)) {
    const std::array<double, 2> folded = foldedOctahedron(direction);
    const int largest = format == VertexFormat::octahedral8x2 ? 127 : 32767;
    const auto step = 1 + static_cast<int>(std::lround((folded[1] + 1) / 2 * (largest - 1)));
    appendComponent(encoded, format, folded[0]);
    appendBits(encoded, static_cast<std::uint32_t>(tangent[3] < 0 ? -step : step),
               largest == 127 ? 1 : 2);
    return encoded;
  }
  for (const double part : direction) appendComponent(encoded, format, part);
  appendComponent(encoded, format, tangent[3]);
  return encoded;
}

}  // namespace dermis::test
