// How the attributes of skinned vertices are stored in the engine's vertex buffers.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "dermis/export.h"
#include "dermis/types.h"

namespace dermis {

/// The format of one attribute. Components are consecutive and little-endian, without padding. All
/// formats round to nearest. The fourth component of `x4` formats is 1 for positions, 0 for
/// normals, and the handedness (1 or -1) for tangents.
///
/// - float16: IEEE 754 binary16. Ties round to even. Values that are too large become infinite.
/// - snorm8, snorm16: component c is stored as round(127 c) or round(32767 c). Positions are
///   relative to a box: c = (p - center) / (half of its size). Positions outside the box are
///   clamped, and counted in `InstanceResult`.
/// - octahedral: the direction is divided by |x| + |y| + |z|, and its lower half is folded outwards
///   (Meyer et al. 2010, "On floating-point normal vectors"). x and y are stored as snorm. A zero
///   vector has no encoding; it becomes (0, 0, 1).
/// - octahedral, for tangents: the sign of the second component is the handedness. Let L = 127 or
///   32767 be the maximum integer. y is stored as q = 1 + round((y + 1) / 2 · (L - 1)), from 1 to
///   L, and q is negated if the handedness is -1. To decode: y = 2 (|q| - 1) / (L - 1) - 1.
enum class VertexFormat : std::uint8_t {
  none = 0,  ///< the attribute is not written
  float32x3 = 1,
  float32x4 = 2,
  float16x3 = 3,
  float16x4 = 4,
  snorm16x3 = 5,
  snorm16x4 = 6,
  snorm8x3 = 7,  ///< `cpu::skin` only: no run with it is whole words (`OutputAttribute`)
  snorm8x4 = 8,
  octahedral16x2 = 9,
  octahedral8x2 = 10,
};

/// All formats except `none`.
inline constexpr std::array<VertexFormat, 10> allVertexFormats{
    VertexFormat::float32x3,    VertexFormat::float32x4, VertexFormat::float16x3,
    VertexFormat::float16x4,    VertexFormat::snorm16x3, VertexFormat::snorm16x4,
    VertexFormat::snorm8x3,     VertexFormat::snorm8x4,  VertexFormat::octahedral16x2,
    VertexFormat::octahedral8x2};

/// Bytes of one element; 0 for `none`.
constexpr std::uint32_t formatSize(VertexFormat format) {
  switch (format) {
    case VertexFormat::none:
      break;
    case VertexFormat::float32x3:
      return 12;
    case VertexFormat::float32x4:
      return 16;
    case VertexFormat::float16x3:
    case VertexFormat::snorm16x3:
      return 6;
    case VertexFormat::float16x4:
    case VertexFormat::snorm16x4:
      return 8;
    case VertexFormat::snorm8x3:
      return 3;
    case VertexFormat::snorm8x4:
    case VertexFormat::octahedral16x2:
      return 4;
    case VertexFormat::octahedral8x2:
      return 2;
  }
  return 0;
}

/// Bytes of one component; 1 for `none`. For vertex input, the offset of an attribute must be a
/// multiple of it.
DERMIS_CORE_API std::uint32_t formatAlignment(VertexFormat format);

/// The name of the format, for example "snorm16x4".
DERMIS_CORE_API std::string_view formatName(VertexFormat format);

/// Whether positions in this format are relative to a box.
constexpr bool isSnormPosition(VertexFormat format) {
  return format == VertexFormat::snorm16x3 || format == VertexFormat::snorm16x4;
}

/// Whether positions may have this format: float32, float16 or snorm16.
constexpr bool isPositionFormat(VertexFormat format) {
  return format == VertexFormat::float32x3 || format == VertexFormat::float32x4 ||
         format == VertexFormat::float16x3 || format == VertexFormat::float16x4 ||
         isSnormPosition(format);
}
/// Whether normals may have this format: any except `none`.
constexpr bool isNormalFormat(VertexFormat format) {
  return formatSize(format) != 0;
}
/// Whether tangents may have this format: those with four components, and octahedral ones.
constexpr bool isTangentFormat(VertexFormat format) {
  return format == VertexFormat::float32x4 || format == VertexFormat::float16x4 ||
         format == VertexFormat::snorm16x4 || format == VertexFormat::snorm8x4 ||
         format == VertexFormat::octahedral16x2 || format == VertexFormat::octahedral8x2;
}

/// Decodes a position in double precision, for tests and tools. `data` points to `formatSize` bytes
/// and needs no alignment. `box` is used for snorm16 only; if it has no extent along an axis, all
/// values have the same coordinate there. Returns zeros if the format is not `isPositionFormat`.
DERMIS_CORE_API std::array<double, 3> decodePosition(VertexFormat format, const void* data,
                                                     const Box& box);
/// Decodes a normal, as `decodePosition`. An octahedral normal has unit length; any other has the
/// length that it was stored with. Returns zeros if the format is not `isNormalFormat`.
DERMIS_CORE_API std::array<double, 3> decodeNormal(VertexFormat format, const void* data);
/// Decodes a tangent, as `decodeNormal`: x, y, z and the handedness. Returns zeros if the format is
/// not `isTangentFormat`.
DERMIS_CORE_API std::array<double, 4> decodeTangent(VertexFormat format, const void* data);

}  // namespace dermis
