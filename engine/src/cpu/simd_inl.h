// Vectors of floats, and of three and four of them. See kernels_inl.h.
#pragma once

#include "hwy/highway.h"

// Where vectors are plain arrays, inlining everything costs a minute of compile time.
#ifdef DERMIS_CPU_SMALL
#define DERMIS_INLINE inline
#else
#define DERMIS_INLINE HWY_INLINE
#endif

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Four floats: one vertex of one instance, or one component of four vertices. Wider vectors
/// consist of such blocks.
using Four = hn::FixedTag<float, 4>;
#if HWY_MAX_BYTES >= 32
using Eight = hn::FixedTag<float, 8>;
/// Vertices processed at a time when one instance is skinned.
using Wide = Eight;
#else
using Wide = Four;
#endif
#if HWY_MAX_BYTES >= 64
using Sixteen = hn::FixedTag<float, 16>;
#endif

template <class D>
using Vec = hn::Vec<D>;

template <class D>
struct Vec3 {
  Vec<D> x, y, z;
};
template <class D>
struct Vec4 {
  Vec<D> x, y, z, w;
};

// Each operation rounds once on every target: no fused operations and no estimates.

template <class V>
DERMIS_INLINE V dot3(V ax, V ay, V az, V bx, V by, V bz) {
  return hn::Add(hn::Add(hn::Mul(ax, bx), hn::Mul(ay, by)), hn::Mul(az, bz));
}
template <class D>
DERMIS_INLINE Vec<D> dot3(const Vec3<D>& a, const Vec3<D>& b) {
  return dot3(a.x, a.y, a.z, b.x, b.y, b.z);
}
template <class D>
DERMIS_INLINE Vec3<D> cross3(const Vec3<D>& a, const Vec3<D>& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)),
          hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
template <class D>
DERMIS_INLINE Vec3<D> add3(const Vec3<D>& a, const Vec3<D>& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
template <class D>
DERMIS_INLINE Vec3<D> sub3(const Vec3<D>& a, const Vec3<D>& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
template <class D>
DERMIS_INLINE Vec3<D> scale3(const Vec3<D>& a, Vec<D> factor) {
  return {hn::Mul(a.x, factor), hn::Mul(a.y, factor), hn::Mul(a.z, factor)};
}
template <class M, class D>
DERMIS_INLINE Vec3<D> choose3(M mask, const Vec3<D>& yes, const Vec3<D>& no) {
  return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y),
          hn::IfThenElse(mask, yes.z, no.z)};
}
template <class D>
DERMIS_INLINE Vec<D> largest3(const Vec3<D>& a) {
  return hn::Max(hn::Abs(a.x), hn::Max(hn::Abs(a.y), hn::Abs(a.z)));
}

/// The power of two that scales a normal number to between a half and 4, and a subnormal one to at
/// least 2^-23, so that its square neither overflows nor underflows to 0.
template <class D>
DERMIS_INLINE Vec<D> powerScale(D d, Vec<D> largest) {
  const hn::RebindToUnsigned<D> du;
  const auto exponent = hn::ShiftRight<23>(hn::BitCast(du, largest));
  const auto scaled = hn::Sub(hn::Set(du, 253u), hn::Min(exponent, hn::Set(du, 252u)));
  return hn::BitCast(d, hn::ShiftLeft<23>(scaled));
}

/// `v` normalized, whatever its magnitude, times `side`, 1 or -1; or `fallback` if its length is 0.
/// A lane is scaled only if its square needs it, whatever the other lanes need: scaling may round a
/// tiny component.
template <class D>
DERMIS_INLINE Vec3<D> unitOr(D d, const Vec3<D>& v, const Vec3<D>& fallback, Vec<D> side) {
  const Vec<D> one = hn::Set(d, 1.0f);
  const Vec<D> given = dot3(v, v);
  const auto isModerate =
      hn::And(hn::Ge(given, hn::Set(d, 0x1p-60f)), hn::Le(given, hn::Set(d, 0x1p60f)));
  if (HWY_LIKELY(hn::AllTrue(d, isModerate))) return scale3(v, hn::Div(side, hn::Sqrt(given)));
  const Vec<D> factor = hn::IfThenElse(isModerate, one, powerScale(d, largest3(v)));
  const Vec3<D> scaled = scale3(v, factor);
  const Vec<D> square = dot3(scaled, scaled);
  const Vec<D> inverse = hn::Div(side, hn::Sqrt(square));
  return choose3(hn::Eq(square, hn::Zero(d)), fallback, scale3(scaled, inverse));
}
template <class D>
DERMIS_INLINE Vec3<D> unitOr(D d, const Vec3<D>& v, const Vec3<D>& fallback) {
  return unitOr(d, v, fallback, hn::Set(d, 1.0f));
}

/// The sign of `value` as 1 or -1; the sign of -0 is 1.
template <class D>
DERMIS_INLINE Vec<D> sideOf(D d, Vec<D> value) {
  return hn::IfThenElse(hn::Lt(value, hn::Zero(d)), hn::Set(d, -1.0f), hn::Set(d, 1.0f));
}

/// Transposes the 4×4 matrix in each block.
template <class D>
DERMIS_INLINE void transpose4(D d, Vec<D>& a, Vec<D>& b, Vec<D>& c, Vec<D>& e) {
  const hn::Repartition<double, D> dd;
  const auto lowAb = hn::BitCast(dd, hn::InterleaveLower(d, a, b));
  const auto highAb = hn::BitCast(dd, hn::InterleaveUpper(d, a, b));
  const auto lowCe = hn::BitCast(dd, hn::InterleaveLower(d, c, e));
  const auto highCe = hn::BitCast(dd, hn::InterleaveUpper(d, c, e));
  a = hn::BitCast(d, hn::InterleaveLower(dd, lowAb, lowCe));
  b = hn::BitCast(d, hn::InterleaveUpper(dd, lowAb, lowCe));
  c = hn::BitCast(d, hn::InterleaveLower(dd, highAb, highCe));
  e = hn::BitCast(d, hn::InterleaveUpper(dd, highAb, highCe));
}

/// Loads four floats for each lane, `stride` floats apart, as four vectors. Any alignment.
DERMIS_INLINE Vec4<Four> loadRows(Four d, const float* from, std::size_t stride) {
  Vec4<Four> rows{hn::LoadU(d, from), hn::LoadU(d, from + stride), hn::LoadU(d, from + 2 * stride),
                  hn::LoadU(d, from + 3 * stride)};
  transpose4(d, rows.x, rows.y, rows.z, rows.w);
  return rows;
}
#if HWY_MAX_BYTES >= 32
DERMIS_INLINE Vec4<Eight> loadRows(Eight d, const float* from, std::size_t stride) {
  const Four four;
  const float* const upper = from + 4 * stride;
  Vec4<Eight> rows{
      hn::Combine(d, hn::LoadU(four, upper), hn::LoadU(four, from)),
      hn::Combine(d, hn::LoadU(four, upper + stride), hn::LoadU(four, from + stride)),
      hn::Combine(d, hn::LoadU(four, upper + 2 * stride), hn::LoadU(four, from + 2 * stride)),
      hn::Combine(d, hn::LoadU(four, upper + 3 * stride), hn::LoadU(four, from + 3 * stride))};
  transpose4(d, rows.x, rows.y, rows.z, rows.w);
  return rows;
}
#endif

/// The inverse of `loadRows`.
DERMIS_INLINE void storeRows(Four d, Vec4<Four> rows, float* to, std::size_t stride) {
  transpose4(d, rows.x, rows.y, rows.z, rows.w);
  hn::StoreU(rows.x, d, to);
  hn::StoreU(rows.y, d, to + stride);
  hn::StoreU(rows.z, d, to + 2 * stride);
  hn::StoreU(rows.w, d, to + 3 * stride);
}
#if HWY_MAX_BYTES >= 32
DERMIS_INLINE void storeRows(Eight d, const Vec4<Eight>& rows, float* to, std::size_t stride) {
  const Four four;
  storeRows(four,
            Vec4<Four>{hn::LowerHalf(four, rows.x), hn::LowerHalf(four, rows.y),
                       hn::LowerHalf(four, rows.z), hn::LowerHalf(four, rows.w)},
            to, stride);
  storeRows(four,
            Vec4<Four>{hn::UpperHalf(four, rows.x), hn::UpperHalf(four, rows.y),
                       hn::UpperHalf(four, rows.z), hn::UpperHalf(four, rows.w)},
            to + 4 * stride, stride);
  static_cast<void>(d);
}
#endif

// Blocks of four floats, each at the address of its first lane plus `offset` floats.

DERMIS_INLINE Vec<Four> loadBlocks(Four d, const float* const* from, std::size_t offset) {
  return hn::LoadU(d, *from + offset);
}
DERMIS_INLINE void storeBlocks(Four d, Vec<Four> blocks, float* const* to, std::size_t offset) {
  hn::StoreU(blocks, d, *to + offset);
}
#if HWY_MAX_BYTES >= 32
template <class D>
DERMIS_INLINE Vec<D> loadBlocks(D d, const float* const* from, std::size_t offset) {
  const hn::Half<D> half;
  return hn::Combine(d, loadBlocks(half, from + hn::MaxLanes(half), offset),
                     loadBlocks(half, from, offset));
}
template <class D>
DERMIS_INLINE void storeBlocks(D, Vec<D> blocks, float* const* to, std::size_t offset) {
  const hn::Half<D> half;
  storeBlocks(half, hn::LowerHalf(half, blocks), to, offset);
  storeBlocks(half, hn::UpperHalf(half, blocks), to + hn::MaxLanes(half), offset);
}
#endif

/// As `loadRows`, but each lane has its own address, to which `offset` floats are added.
template <class D>
DERMIS_INLINE Vec4<D> gatherRows(D d, const float* const* from, std::size_t offset) {
  Vec4<D> rows{loadBlocks(d, from, offset), loadBlocks(d, from + 1, offset),
               loadBlocks(d, from + 2, offset), loadBlocks(d, from + 3, offset)};
  transpose4(d, rows.x, rows.y, rows.z, rows.w);
  return rows;
}
/// The inverse of `gatherRows`.
template <class D>
DERMIS_INLINE void scatterRows(D d, Vec4<D> rows, float* const* to, std::size_t offset) {
  transpose4(d, rows.x, rows.y, rows.z, rows.w);
  storeBlocks(d, rows.x, to, offset);
  storeBlocks(d, rows.y, to + 1, offset);
  storeBlocks(d, rows.z, to + 2, offset);
  storeBlocks(d, rows.w, to + 3, offset);
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
