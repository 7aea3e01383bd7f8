// How the attributes of skinned vertices are stored in the engine's vertex buffers.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "dermis/export.h"
#include "dermis/types.h"

namespace dermis {

/// The format of one attribute. Components stand one after the other, little-endian, without
/// padding.
///
/// `x4` formats fill their fourth component: 1 for positions, 0 for normals, the handedness (1 or
/// -1) for tangents. Rounding is to nearest everywhere.
///
/// - float16: IEEE 754 binary16, ties to even; what is too large becomes infinite.
/// - snorm8, snorm16: round(127 c), round(32767 c). Positions are taken relative to a box, c =
///   (p - centre) / half its size: what lies outside is clamped, and counted.
/// - octahedral: Meyer et al. 2010, "On floating-point normal vectors": the direction divided by
///   |x| + |y| + |z|, its lower half folded outwards; two snorm components. A zero vector cannot be
///   told: it becomes (0, 0, 1).
/// - octahedral tangents have the handedness as the sign of the second component: with L = 127 or
///   32767, the largest integer, y goes from 1 to L instead of -L to L: q = 1 + round((y + 1) / 2
///   · (L - 1)), negated for a handedness of -1. So y = 2 (|q| - 1) / (L - 1) - 1.
enum class VertexFormat : std::uint8_t {
  none,  ///< the attribute is not wanted
  float32x3,
  float32x4,
  float16x3,
  float16x4,
  snorm16x3,
  snorm16x4,
  snorm8x3,
  snorm8x4,
  octahedral16x2,
  octahedral8x2,
};

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

/// Bytes of one component: vertex fetch requires attributes to begin at multiples of them. 1 for
/// `none`.
DERMIS_CORE_API std::uint32_t formatAlignment(VertexFormat format);

/// The format's name in reports: "snorm16x4".
DERMIS_CORE_API std::string_view formatName(VertexFormat format);

/// Whether positions in this format are relative to a box.
constexpr bool isSnormPosition(VertexFormat format) {
  return format == VertexFormat::snorm16x3 || format == VertexFormat::snorm16x4;
}

/// Whether skinned positions, normals, tangents may be stored so: positions as float32, float16 or
/// snorm16; normals as anything; tangents as anything with four components, or octahedral.
constexpr bool isPositionFormat(VertexFormat format) {
  return format == VertexFormat::float32x3 || format == VertexFormat::float32x4 ||
         format == VertexFormat::float16x3 || format == VertexFormat::float16x4 ||
         isSnormPosition(format);
}
constexpr bool isNormalFormat(VertexFormat format) {
  return formatSize(format) != 0;
}
constexpr bool isTangentFormat(VertexFormat format) {
  return format == VertexFormat::float32x4 || format == VertexFormat::float16x4 ||
         format == VertexFormat::snorm16x4 || format == VertexFormat::snorm8x4 ||
         format == VertexFormat::octahedral16x2 || format == VertexFormat::octahedral8x2;
}

/// What stands at `data`, in double precision: by the formulas above, for tests and tools. A
/// direction that was stored octahedral is of unit length, any other as long as it was stored.
/// `box` matters for snorm16 only; along an axis where it has no extent every value stands for its
/// one coordinate. `data` needs no alignment, and holds `formatSize` bytes. A format that the
/// attribute may not have gives zeros.
DERMIS_CORE_API std::array<double, 3> decodePosition(VertexFormat format, const void* data,
                                                     const Box& box);
DERMIS_CORE_API std::array<double, 3> decodeNormal(VertexFormat format, const void* data);
/// x y z and the handedness.
DERMIS_CORE_API std::array<double, 4> decodeTangent(VertexFormat format, const void* data);

}  // namespace dermis
