// The first stage: sums over the influences of a vertex.
#pragma once

#include <cstdint>
#include <type_traits>

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

/// Calls `sum` with the number of influences: a compile-time constant up to 4, or 0 for more.
template <class Sum>
DERMIS_INLINE void byInfluences([[maybe_unused]] std::uint32_t influences, const Sum& sum) {
#ifdef DERMIS_CPU_STAGES_ONLY
  influences = 0;
#endif
  switch (influences) {
    case 1:
      return sum(std::integral_constant<int, 1>());
    case 2:
      return sum(std::integral_constant<int, 2>());
    case 3:
      return sum(std::integral_constant<int, 3>());
    case 4:
      return sum(std::integral_constant<int, 4>());
    default:
      return sum(std::integral_constant<int, 0>());
  }
}

/// Σ w e of one vertex, over as many floats of each entry as there are lanes, from influence
/// `begin` on. An entry has 8 · `units` floats. If `influences` is 0, `count` is the number of
/// influences.
template <int influences, std::size_t begin, class D>
DERMIS_INLINE Vec<D> sumVertex(D d, const float* HWY_RESTRICT entries, std::size_t units,
                               const std::uint16_t* HWY_RESTRICT numbers,
                               const float* HWY_RESTRICT weights, std::size_t count) {
  if (influences != 0) count = influences;
  Vec<D> sum = hn::Zero(d);
  for (std::size_t i = begin; i < count; ++i) {
    const Vec<D> part = hn::Mul(hn::Set(d, weights[i]), hn::Load(d, entries + numbers[i] * units));
    sum = i == begin ? part : hn::Add(sum, part);
  }
  return sum;
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

/// Σ w e of four vertices of each instance, over K quads. sums[k] gets the components of quad k, a
/// vertex in each lane of a block. If there are `pivots`, entries are differences to the pivot's,
/// which is added; the first influence, the pivot itself, has none.
template <int influences, std::size_t K, bool hasPivots, class D>
DERMIS_INLINE void sumFour(D d, const float* const* quads, const float* const* pivots,
                           const std::uint16_t* HWY_RESTRICT numbers,
                           const std::uint16_t* HWY_RESTRICT joints,
                           const float* HWY_RESTRICT weights, std::size_t count,
                           Vec<D> sums[K][4]) {
  if (influences != 0) count = influences;
  constexpr std::size_t begin = hasPivots ? 1 : 0;
  for (std::size_t vertex = 0; vertex < 4; ++vertex) {
    const std::size_t first = vertex * count;
    Vec<D> sum[K];
    for (std::size_t k = 0; k < K; ++k) sum[k] = hn::Zero(d);
    for (std::size_t i = begin; i < count; ++i) {
      const std::size_t entry = std::size_t{numbers[first + i]} * blocksOf<D> / 2;
      const Vec<D> w = hn::Set(d, weights[first + i]);
      for (std::size_t k = 0; k < K; ++k) {
        const Vec<D> part = hn::Mul(w, hn::Load(d, quads[k] + entry));
        sum[k] = i == begin ? part : hn::Add(sum[k], part);
      }
    }
    if constexpr (hasPivots) {
      const std::size_t entry = std::size_t{joints[first]} * blocksOf<D> / 2;
      for (std::size_t k = 0; k < K; ++k) sum[k] = hn::Add(hn::Load(d, pivots[k] + entry), sum[k]);
    }
    for (std::size_t k = 0; k < K; ++k) sums[k][vertex] = sum[k];
  }
  for (std::size_t k = 0; k < K; ++k) transpose4(d, sums[k][0], sums[k][1], sums[k][2], sums[k][3]);
}

/// Σ w e of each vertex, over the first K quads of each entry, plus the pivot's entry if there are
/// `pivots`. Writes 4 K vectors for each unit.
template <bool isLone, std::size_t K, bool hasPivots, class D, std::size_t size>
HWY_NOINLINE HWY_ATTR void sumUnits(D d, const float* const* quads, const float* const* pivots,
                                    const std::uint16_t* numbers, const Slots& slots,
                                    std::size_t units, Vec<D> (*to)[size]) {
  byInfluences(slots.influences, [&](auto influences) HWY_ATTR {
    const std::size_t count = influences() != 0 ? influences() : slots.influences;
    const std::uint16_t* HWY_RESTRICT number = numbers;
    const std::uint16_t* HWY_RESTRICT joint = slots.joints;
    const float* HWY_RESTRICT weight = slots.weights;
    for (std::size_t unit = 0; unit < units; ++unit) {
      Vec<D>* const own = to[unit];
      if constexpr (!isLone) {
        Vec<D> sums[K][4];
        sumFour<influences(), K, hasPivots>(d, quads, pivots, number, joint, weight, count, sums);
        for (std::size_t k = 0; k < K; ++k) {
          for (std::size_t i = 0; i < 4; ++i) own[k * 4 + i] = sums[k][i];
        }
        number += 4 * count;
        joint += 4 * count;
        weight += 4 * count;
      } else {
#if HWY_MAX_BYTES >= 32
        if constexpr (K >= 2) {
          constexpr std::size_t begin = hasPivots ? 1 : 0;
          Vec<D> rows[8];
          for (std::size_t i = 0; i < 8; ++i) {
            rows[i] = sumVertex<influences(), begin>(d, quads[0], K == 3 ? 2 : 1,
                                                     number + i * count, weight + i * count, count);
            if (hasPivots) rows[i] = hn::Add(hn::LoadU(d, pivots[0] + joint[i * count]), rows[i]);
          }
          columnsOf(d, rows, own);
        }
        if constexpr (K != 2) {
          const Four four;
          Vec<Four> rows[8];
          for (std::size_t i = 0; i < 8; ++i) {
            rows[i] = sumVertex<influences(), 0>(four, quads[K - 1], K == 3 ? 2 : 1,
                                                 number + i * count, weight + i * count, count);
          }
          Vec<D>* const last = own + (K - 1) * 4;
          for (std::size_t i = 0; i < 4; ++i) last[i] = hn::Combine(d, rows[i + 4], rows[i]);
          transpose4(d, last[0], last[1], last[2], last[3]);
        }
        number += 8 * count;
        joint += 8 * count;
        weight += 8 * count;
#endif
      }
    }
  });
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
