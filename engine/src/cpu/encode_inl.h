// Encodes attributes in the formats of VertexFormat, by the rules of shaders/encode.glsl.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "cpu/simd_inl.h"
#include "cpu/task.h"
#include "dermis/layout.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

template <class D>
using Words = hn::Vec<hn::RebindToUnsigned<D>>;

/// An encoded attribute of one vertex per lane, up to four words each.
template <class D>
struct Encoded {
  Words<D> words[4];
};

/// IEEE 754 binary16, rounded to nearest, ties to even.
template <class D>
DERMIS_INLINE Words<D> halfBits(D d, Vec<D> value) {
  const hn::RebindToUnsigned<D> du;
  const auto set = [&](std::uint32_t word) HWY_ATTR { return hn::Set(du, word); };
#if HWY_MAX_BYTES >= 32 && !defined(HWY_DISABLE_F16C)
  // The instruction keeps the lower bits of a NaN.
  const Vec<D> quiet = hn::CopySign(hn::BitCast(d, set(0x7fc00000)), value);
  const Vec<D> number = hn::IfThenElse(hn::Eq(value, value), value, quiet);
  const auto half = hn::DemoteTo(hn::Rebind<hwy::float16_t, D>(), number);
  return hn::PromoteTo(du, hn::BitCast(hn::Rebind<std::uint16_t, D>(), half));
#else
  const Words<D> bits = hn::BitCast(du, value);
  const Words<D> magnitude = hn::And(bits, set(0x7fffffff));
  const Words<D> odd = hn::And(hn::ShiftRight<13>(magnitude), set(1));
  const Words<D> normal =
      hn::ShiftRight<13>(hn::Add(hn::Add(hn::Sub(magnitude, set(0x38000000)), set(0xfff)), odd));
  // Below 2^-14 the step is 2^-24, which is the step of a float32 at 0.5.
  const Vec<D> shifted =
      hn::Add(hn::BitCast(d, hn::Min(magnitude, set(0x38800000))), hn::Set(d, 0.5f));
  const Words<D> subnormal = hn::Sub(hn::BitCast(du, shifted), set(0x3f000000));
  const Words<D> finite = hn::IfThenElse(hn::Lt(magnitude, set(0x38800000)), subnormal, normal);
  const Words<D> special =
      hn::IfThenElse(hn::Gt(magnitude, set(0x7f800000)), set(0x7e00), set(0x7c00));
  const Words<D> sign = hn::And(hn::ShiftRight<16>(bits), set(0x8000));
  return hn::Or(sign, hn::IfThenElse(hn::Gt(magnitude, set(0x477fefff)), special, finite));
#endif
}

/// Clamps to [-1, 1]; NaN becomes 0.
template <class D>
DERMIS_INLINE Vec<D> clampUnit(D d, Vec<D> value) {
  const Vec<D> one = hn::Set(d, 1.0f), minusOne = hn::Set(d, -1.0f);
  const Vec<D> number = hn::IfThenElseZero(hn::Eq(value, value), value);
  return hn::Max(minusOne, hn::Min(one, number));
}

template <class D>
DERMIS_INLINE Words<D> snorm(D d, Vec<D> value, float largest) {
  const hn::RebindToUnsigned<D> du;
  return hn::BitCast(du, hn::NearestInt(hn::Mul(clampUnit(d, value), hn::Set(d, largest))));
}

/// The octahedron's lower half is folded outwards.
template <class D>
DERMIS_INLINE void octahedral(D d, const Vec3<D>& v, Vec<D>& x, Vec<D>& y) {
  const Vec<D> zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const Vec<D> sum = hn::Add(hn::Add(hn::Abs(v.x), hn::Abs(v.y)), hn::Abs(v.z));
  const Vec<D> divisor = hn::IfThenElse(hn::Eq(sum, zero), one, sum);
  const Vec<D> upperX = hn::Div(v.x, divisor), upperY = hn::Div(v.y, divisor);
  const Vec<D> foldedX = hn::Sub(one, hn::Abs(upperY)), foldedY = hn::Sub(one, hn::Abs(upperX));
  const auto isUpper = hn::Ge(v.z, zero);
  x = hn::IfThenElse(isUpper, upperX,
                     hn::IfThenElse(hn::Lt(upperX, zero), hn::Neg(foldedX), foldedX));
  y = hn::IfThenElse(isUpper, upperY,
                     hn::IfThenElse(hn::Lt(upperY, zero), hn::Neg(foldedY), foldedY));
}

/// Maps [-1, 1] to 1 … `largest`, negated for a left-handed frame.
template <class D>
DERMIS_INLINE Words<D> signedByHand(D d, Vec<D> value, Vec<D> hand, float largest) {
  const hn::RebindToSigned<D> di;
  const hn::RebindToUnsigned<D> du;
  const Vec<D> half = hn::Set(d, 0.5f);
  const Vec<D> scaled =
      hn::Mul(hn::Add(hn::Mul(clampUnit(d, value), half), half), hn::Set(d, largest - 1));
  const auto step = hn::Add(hn::NearestInt(scaled), hn::Set(di, 1));
  const auto isLeft = hn::RebindMask(di, hn::Lt(hand, hn::Zero(d)));
  return hn::BitCast(du, hn::IfThenElse(isLeft, hn::Neg(step), step));
}

template <class D>
DERMIS_INLINE Words<D> pair16(D, Words<D> low, Words<D> high) {
  const hn::RebindToUnsigned<D> du;
  return hn::Or(hn::And(low, hn::Set(du, 0xffffu)), hn::ShiftLeft<16>(high));
}
template <class D>
DERMIS_INLINE Words<D> byteOf(D, Words<D> value) {
  const hn::RebindToUnsigned<D> du;
  return hn::And(value, hn::Set(du, 0xffu));
}

/// Any format but the octahedral ones.
template <class D>
DERMIS_INLINE Encoded<D> encodeComponents(D d, VertexFormat format, const Vec4<D>& v) {
  const hn::RebindToUnsigned<D> du;
  const Words<D> zero = hn::Zero(du);
  switch (format) {
    case VertexFormat::float16x3:
    case VertexFormat::float16x4:
      return {{pair16(d, halfBits(d, v.x), halfBits(d, v.y)),
               pair16(d, halfBits(d, v.z), halfBits(d, v.w)), zero, zero}};
    case VertexFormat::snorm16x3:
    case VertexFormat::snorm16x4:
      return {{pair16(d, snorm(d, v.x, 32767), snorm(d, v.y, 32767)),
               pair16(d, snorm(d, v.z, 32767), snorm(d, v.w, 32767)), zero, zero}};
    case VertexFormat::snorm8x3:
    case VertexFormat::snorm8x4: {
      const Words<D> low =
          hn::Or(byteOf(d, snorm(d, v.x, 127)), hn::ShiftLeft<8>(byteOf(d, snorm(d, v.y, 127))));
      const Words<D> high = hn::Or(hn::ShiftLeft<16>(byteOf(d, snorm(d, v.z, 127))),
                                   hn::ShiftLeft<24>(snorm(d, v.w, 127)));
      return {{hn::Or(low, high), zero, zero, zero}};
    }
    default:
      return {
          {hn::BitCast(du, v.x), hn::BitCast(du, v.y), hn::BitCast(du, v.z), hn::BitCast(du, v.w)}};
  }
}

/// If the format is relative to a box, `v` already is.
template <class D>
DERMIS_INLINE Encoded<D> encodePosition(D d, VertexFormat format, const Vec3<D>& v) {
  return encodeComponents(d, format, Vec4<D>{v.x, v.y, v.z, hn::Set(d, 1.0f)});
}

template <class D>
DERMIS_INLINE Encoded<D> encodeOctahedral(D d, VertexFormat format, const Vec3<D>& v,
                                          const Vec<D>* hand) {
  const hn::RebindToUnsigned<D> du;
  const Words<D> zero = hn::Zero(du);
  const bool isWide = format == VertexFormat::octahedral16x2;
  const float largest = isWide ? 32767 : 127;
  Vec<D> x, y;
  octahedral(d, v, x, y);
  const Words<D> first = snorm(d, x, largest);
  const Words<D> second =
      hand != nullptr ? signedByHand(d, y, *hand, largest) : snorm(d, y, largest);
  if (isWide) return {{pair16(d, first, second), zero, zero, zero}};
  return {{hn::Or(byteOf(d, first), hn::ShiftLeft<8>(byteOf(d, second))), zero, zero, zero}};
}

inline bool isOctahedral(VertexFormat format) {
  return format == VertexFormat::octahedral16x2 || format == VertexFormat::octahedral8x2;
}

template <class D>
DERMIS_INLINE Encoded<D> encodeNormal(D d, VertexFormat format, const Vec3<D>& v) {
  if (isOctahedral(format)) return encodeOctahedral<D>(d, format, v, nullptr);
  return encodeComponents(d, format, Vec4<D>{v.x, v.y, v.z, hn::Zero(d)});
}

template <class D>
DERMIS_INLINE Encoded<D> encodeTangent(D d, VertexFormat format, const Vec3<D>& v, Vec<D> hand) {
  if (isOctahedral(format)) return encodeOctahedral<D>(d, format, v, &hand);
  return encodeComponents(d, format, Vec4<D>{v.x, v.y, v.z, hand});
}

/// Calls `copy` with the size of a format as a constant.
template <class Copy>
DERMIS_INLINE void bySize(std::uint32_t bytes, const Copy& copy) {
  switch (bytes) {
    case 2:
      return copy(std::integral_constant<std::size_t, 2>());
    case 3:
      return copy(std::integral_constant<std::size_t, 3>());
    case 4:
      return copy(std::integral_constant<std::size_t, 4>());
    case 6:
      return copy(std::integral_constant<std::size_t, 6>());
    case 8:
      return copy(std::integral_constant<std::size_t, 8>());
    case 12:
      return copy(std::integral_constant<std::size_t, 12>());
    default:
      return copy(std::integral_constant<std::size_t, 16>());
  }
}

/// Copies an attribute of vertices `first` to `end`. The addresses are those of vertex 0.
DERMIS_INLINE void copyLanes(std::byte* to, std::size_t toStride, const std::byte* from,
                             std::size_t fromStride, std::uint32_t bytes, std::size_t first,
                             std::size_t end) {
  bySize(bytes, [&](auto size) {
    for (std::size_t lane = first; lane < end; ++lane)
      std::memcpy(to + lane * toStride, from + lane * fromStride, size());
  });
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
