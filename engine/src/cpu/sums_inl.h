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

  void advance(std::size_t vertices) {
    joints += vertices * influences;
    pairs += vertices * influences;
    weights += vertices * influences;
  }
};

/// An entry of `floats` numbers of a table, by a number of a slot.
template <std::size_t floats>
DERMIS_INLINE const float* entryOf(const float* entries, std::uint16_t number) {
  constexpr std::size_t scale = floats * sizeof(float) / indexScale;
  return reinterpret_cast<const float*>(reinterpret_cast<const std::byte*>(entries) +
                                        number * scale);
}

// In the functions below, if entries are `relative`, those of other joints are differences to the
// pivot's, the first influence, which is added with weight 1. Two by two, so that fewer additions
// wait for each other: (e₀ + w₁ e₁) + (w₂ e₂ + w₃ e₃) + …. Four influences, the usual number, take
// no loop.

/// Of N numbers, adds w e of one influence.
template <std::size_t N, class D>
DERMIS_INLINE void addOne(D d, const float* entry, Vec<D> w, Vec<D>* sum) {
  for (std::size_t k = 0; k < N; ++k)
    sum[k] = hn::Add(sum[k], hn::Mul(w, hn::Load(d, entry + k * hn::MaxLanes(d))));
}
/// Of two influences.
template <std::size_t N, class D>
DERMIS_INLINE void addTwo(D d, const float* entry, Vec<D> w, const float* other, Vec<D> v,
                          Vec<D>* sum) {
  for (std::size_t k = 0; k < N; ++k) {
    const std::size_t place = k * hn::MaxLanes(d);
    sum[k] = hn::Add(sum[k], hn::Add(hn::Mul(w, hn::Load(d, entry + place)),
                                     hn::Mul(v, hn::Load(d, other + place))));
  }
}

/// Σ w e of unit `unit` of a company: the first N numbers of entries of 8 or, if N > 8, 16.
template <std::size_t N, bool relative, class D>
DERMIS_INLINE void sumCompany(D d, const float* entries, const std::uint16_t* HWY_RESTRICT numbers,
                              const Slots& slots, std::size_t unit, Vec<D>* sums) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const std::size_t count = slots.influences;
  const float* const HWY_RESTRICT weights = slots.weights + unit * count;
  const std::uint16_t* const HWY_RESTRICT own = numbers + unit * count;
  const auto entry = [&](std::size_t i)
                         HWY_ATTR { return entryOf<(N > 8 ? 16 : 8) * lanes>(entries, own[i]); };
  const float* const first = entry(0);
  Vec<D> sum[N];
  for (std::size_t k = 0; k < N; ++k) {
    sum[k] = hn::Load(d, first + k * lanes);
    if (!relative) sum[k] = hn::Mul(hn::Set(d, weights[0]), sum[k]);
  }
  const auto one = [&](std::size_t i)
                       HWY_ATTR { addOne<N>(d, entry(i), hn::Set(d, weights[i]), sum); };
  const auto two = [&](std::size_t i) HWY_ATTR {
    addTwo<N>(d, entry(i), hn::Set(d, weights[i]), entry(i + 1), hn::Set(d, weights[i + 1]), sum);
  };
#ifndef DERMIS_CPU_SMALL
  if (count == 4) {
    one(1);
    two(2);
  } else
#endif
      if (count > 1) {
    one(1);
    std::size_t i = 2;
    for (; i + 1 < count; i += 2) two(i);
    if (i < count) one(i);
  }
  for (std::size_t k = 0; k < N; ++k) sums[k] = sum[k];
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
template <std::size_t influences, std::size_t units, bool relative, class D>
DERMIS_INLINE Vec<D> sumVertex(D d, const float* entries, const std::uint16_t* numbers,
                               const Slots& slots, std::size_t vertex) {
  const std::size_t count = influences != 0 ? influences : slots.influences;
  const std::size_t first = vertex * count;
  const auto term = [&](std::size_t i) HWY_ATTR {
    return hn::Mul(hn::Set(d, slots.weights[first + i]),
                   hn::Load(d, entryOf<8 * units>(entries, numbers[first + i])));
  };
  Vec<D> sum = relative ? hn::Load(d, entryOf<8 * units>(entries, numbers[first])) : term(0);
  if (count > 1) sum = hn::Add(sum, term(1));
  std::size_t i = 2;
  for (; i + 1 < count; i += 2) sum = hn::Add(sum, hn::Add(term(i), term(i + 1)));
  return i < count ? hn::Add(sum, term(i)) : sum;
}

/// As `sumCompany`, of as many vertices of a lone instance as there are lanes. Writes the numbers
/// of whole quads.
template <std::size_t influences, std::size_t N, bool relative, class D>
DERMIS_INLINE void sumLone(D d, const float* entries, const std::uint16_t* numbers,
                           const Slots& slots, std::size_t unit, Vec<D>* sums) {
  constexpr std::size_t lanes = hn::MaxLanes(d), units = N > 8 ? 2 : 1;
  const std::size_t first = unit * lanes;
  const Four four;
#if HWY_MAX_BYTES >= 32
  constexpr std::size_t wide = (N + 3) / 8 * 8;
  for (std::size_t k = 0; k < wide; k += 8) {
    Vec<D> rows[8];
    for (std::size_t i = 0; i < 8; ++i) {
      rows[i] = sumVertex<influences, units, relative>(d, entries + k, numbers, slots, first + i);
    }
    columnsOf(d, rows, sums + k);
  }
  if constexpr (wide < N) {
    Vec<Four> rows[8];
    for (std::size_t i = 0; i < 8; ++i) {
      rows[i] =
          sumVertex<influences, units, relative>(four, entries + wide, numbers, slots, first + i);
    }
    Vec<D>* const own = sums + wide;
    for (std::size_t i = 0; i < 4; ++i) own[i] = hn::Combine(d, rows[i + 4], rows[i]);
    transpose4(d, own[0], own[1], own[2], own[3]);
  }
#else
  for (std::size_t k = 0; k < N; k += 4) {
    Vec<D>* const own = sums + k;
    for (std::size_t i = 0; i < 4; ++i) {
      own[i] = sumVertex<influences, units, relative>(four, entries + k, numbers, slots, first + i);
    }
    transpose4(d, own[0], own[1], own[2], own[3]);
  }
#endif
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
