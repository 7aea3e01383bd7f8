// Sums over the influences of a vertex, which stay in registers.
#pragma once

#include <cstdint>

#include "cpu/tile_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// The influence slots of a tile's vertices.
struct Slots {
  const std::uint16_t* joints;
  const std::uint16_t* pairs;
  const float* weights;
  std::uint32_t influences;
};

// In the functions below, if entries have `pivots`, they are differences to the pivot's, which is
// added; the first influence, the pivot itself, has none. Four influences, the usual number, take
// no loop.

template <std::size_t N, class D>
DERMIS_INLINE void addEntry(D d, const float* entry, float weight, Vec<D> sum[N]) {
  const Vec<D> w = hn::Set(d, weight);
  for (std::size_t k = 0; k < N; ++k)
    sum[k] = hn::Add(sum[k], hn::Mul(w, hn::Load(d, entry + k * hn::MaxLanes(d))));
}

/// Σ w e of unit `unit` of a company: the first N numbers of entries of 8 or, if N > 8, 16.
template <std::size_t N, bool hasPivots, class D>
DERMIS_INLINE void sumCompany(D d, const float* entries, const float* pivots,
                              const std::uint16_t* HWY_RESTRICT numbers, const Slots& slots,
                              std::size_t unit, Vec<D>* sums) {
  constexpr std::size_t lanes = hn::MaxLanes(d), stride = (N > 8 ? 2 : 1) * lanes;
  constexpr std::size_t begin = hasPivots ? 1 : 0;
  const std::size_t count = slots.influences;
  const float* const HWY_RESTRICT weights = slots.weights + unit * count;
  const std::uint16_t* const HWY_RESTRICT own = numbers + unit * count;
  Vec<D> sum[N];
  if (begin < count) {
    const float* const entry = entries + own[begin] * stride;
    const Vec<D> w = hn::Set(d, weights[begin]);
    for (std::size_t k = 0; k < N; ++k) sum[k] = hn::Mul(w, hn::Load(d, entry + k * lanes));
  } else {
    for (Vec<D>& value : sum) value = hn::Zero(d);
  }
#ifndef DERMIS_CPU_SMALL
  if (count == 4) {
    addEntry<N>(d, entries + own[begin + 1] * stride, weights[begin + 1], sum);
    addEntry<N>(d, entries + own[begin + 2] * stride, weights[begin + 2], sum);
    if constexpr (!hasPivots) addEntry<N>(d, entries + own[3] * stride, weights[3], sum);
  } else
#endif
  {
    for (std::size_t i = begin + 1; i < count; ++i)
      addEntry<N>(d, entries + own[i] * stride, weights[i], sum);
  }
  for (std::size_t k = 0; k < N; ++k) {
    if constexpr (hasPivots) {
      const float* const pivot = pivots + slots.joints[unit * count] * lanes;
      sum[k] = hn::Add(hn::Load(d, pivot + k * lanes), sum[k]);
    }
    sums[k] = sum[k];
  }
}

#if HWY_MAX_BYTES >= 32
/// Transposes the lower and the upper halves of eight rows of eight floats.
DERMIS_INLINE void columnsOf(Eight d, const Vec<Eight> rows[8], Vec<Eight> columns[8]) {
  for (std::size_t i = 0; i < 4; ++i) {
    columns[i] = hn::ConcatLowerLower(d, rows[i + 4], rows[i]);
    columns[i + 4] = hn::ConcatUpperUpper(d, rows[i + 4], rows[i]);
  }
  transpose4(d, columns[0], columns[1], columns[2], columns[3]);
  transpose4(d, columns[4], columns[5], columns[6], columns[7]);
}
#endif

/// Σ w e of a vertex of a lone instance: as many numbers of an entry as D has lanes.
template <std::size_t influences, std::size_t units, bool hasPivots, class D>
DERMIS_INLINE Vec<D> sumVertex(D d, const float* entries, const float* pivots,
                               const std::uint16_t* numbers, const Slots& slots,
                               std::size_t vertex) {
  constexpr std::size_t begin = hasPivots ? 1 : 0;
  const std::size_t count = influences != 0 ? influences : slots.influences;
  const std::size_t first = vertex * count;
  Vec<D> sum = hn::Zero(d);
  for (std::size_t i = begin; i < count; ++i) {
    const Vec<D> part = hn::Mul(hn::Set(d, slots.weights[first + i]),
                                hn::Load(d, entries + numbers[first + i] * units));
    sum = i == begin ? part : hn::Add(sum, part);
  }
  if constexpr (hasPivots) sum = hn::Add(hn::Load(d, pivots + slots.joints[first]), sum);
  return sum;
}

/// As `sumCompany`, of as many vertices of a lone instance as there are lanes. Writes the numbers
/// of whole quads.
template <std::size_t influences, std::size_t N, bool hasPivots, class D>
DERMIS_INLINE void sumLone(D d, const float* entries, const float* pivots,
                           const std::uint16_t* numbers, const Slots& slots, std::size_t unit,
                           Vec<D>* sums) {
  constexpr std::size_t lanes = hn::MaxLanes(d), units = N > 8 ? 2 : 1;
  const std::size_t first = unit * lanes;
  const Four four;
#if HWY_MAX_BYTES >= 32
  constexpr std::size_t wide = (N + 3) / 8 * 8;
  for (std::size_t k = 0; k < wide; k += 8) {
    Vec<D> rows[8];
    for (std::size_t i = 0; i < 8; ++i) {
      rows[i] = sumVertex<influences, units, hasPivots>(d, entries + k, pivots, numbers, slots,
                                                        first + i);
    }
    columnsOf(d, rows, sums + k);
  }
  if constexpr (wide < N) {
    Vec<Four> rows[8];
    for (std::size_t i = 0; i < 8; ++i) {
      rows[i] = sumVertex<influences, units, hasPivots>(four, entries + wide, pivots, numbers,
                                                        slots, first + i);
    }
    Vec<D>* const own = sums + wide;
    for (std::size_t i = 0; i < 4; ++i) own[i] = hn::Combine(d, rows[i + 4], rows[i]);
    transpose4(d, own[0], own[1], own[2], own[3]);
  }
#else
  for (std::size_t k = 0; k < N; k += 4) {
    Vec<D>* const own = sums + k;
    const float* const pivot = hasPivots ? pivots + k : nullptr;
    for (std::size_t i = 0; i < 4; ++i) {
      own[i] = sumVertex<influences, units, hasPivots>(four, entries + k, pivot, numbers, slots,
                                                       first + i);
    }
    transpose4(d, own[0], own[1], own[2], own[3]);
  }
#endif
}

/// The sums of a unit of either. `influences`: of a lone instance, if it is a constant, or 0.
template <bool isLone, std::size_t influences, std::size_t N, bool hasPivots, class D>
DERMIS_INLINE void sumUnit(D d, const float* entries, const float* pivots,
                           const std::uint16_t* numbers, const Slots& slots, std::size_t unit,
                           Vec<D>* sums) {
  if constexpr (isLone) {
    sumLone<influences, N, hasPivots>(d, entries, pivots, numbers, slots, unit, sums);
  } else {
    sumCompany<N, hasPivots>(d, entries, pivots, numbers, slots, unit, sums);
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
