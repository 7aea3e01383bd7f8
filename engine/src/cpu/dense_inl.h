// Stores vertices of a lone instance that have nothing between them and consist of words: four for
// each block of a vector.
#pragma once

#include <cstddef>

#include "cpu/simd_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// The 128-bit blocks i of the vectors hold four vertices. Stores them at `to[i]`.
template <std::size_t count>
DERMIS_INLINE void storeChunks(Four d, const Vec<Four> (&chunks)[count], float* const to[1]) {
  for (std::size_t k = 0; k < count; ++k) hn::StoreU(chunks[k], d, to[0] + k * 4);
}
#if HWY_MAX_BYTES >= 32
template <std::size_t count>
DERMIS_INLINE void storeChunks(Eight d, const Vec<Eight> (&chunks)[count], float* const to[2]) {
  for (std::size_t k = 0; k + 1 < count; k += 2) {
    hn::StoreU(hn::ConcatLowerLower(d, chunks[k + 1], chunks[k]), d, to[0] + k * 4);
    hn::StoreU(hn::ConcatUpperUpper(d, chunks[k + 1], chunks[k]), d, to[1] + k * 4);
  }
  if constexpr (count % 2 != 0) {
    const Four four;
    hn::StoreU(hn::LowerHalf(four, chunks[count - 1]), four, to[0] + (count - 1) * 4);
    hn::StoreU(hn::UpperHalf(four, chunks[count - 1]), four, to[1] + (count - 1) * 4);
  }
}
#endif

/// Stores the words of four vertices, each word in a lane of every block. Comments below show what
/// is in a block: two words of a vertex and its number.
template <std::size_t count, class D>
DERMIS_INLINE void storeDense(D d, const Vec<D> (&w)[count], float* const* to) {
  static_assert(count == 3 || count == 5 || count == 6 || count == 10);
  using Pairs = hn::Repartition<double, D>;  // two words are moved as one
  const Pairs dd;
  const auto lower = [&](std::size_t a, std::size_t b)
                         HWY_ATTR { return hn::BitCast(dd, hn::InterleaveLower(d, w[a], w[b])); };
  const auto upper = [&](std::size_t a, std::size_t b)
                         HWY_ATTR { return hn::BitCast(dd, hn::InterleaveUpper(d, w[a], w[b])); };
  const auto lows = [&](Vec<Pairs> a, Vec<Pairs> b)
                        HWY_ATTR { return hn::BitCast(d, hn::InterleaveLower(dd, a, b)); };
  const auto highs = [&](Vec<Pairs> a, Vec<Pairs> b)
                         HWY_ATTR { return hn::BitCast(d, hn::InterleaveUpper(dd, a, b)); };
  const auto lowHigh = [&](Vec<Pairs> a, Vec<Pairs> b)
                           HWY_ATTR { return hn::BitCast(d, hn::OddEven(b, a)); };
  const auto highLow = [&](Vec<Pairs> a, Vec<Pairs> b) HWY_ATTR {
    return hn::BitCast(d, hn::CombineShiftRightBytes<8>(dd, b, a));
  };
  Vec<D> chunks[count];
  if constexpr (count % 2 == 0) {
    constexpr std::size_t half = count / 2;
    for (const bool second : {false, true}) {  // vertices 0 and 1, then 2 and 3
      const auto pair = [&](std::size_t a)
                            HWY_ATTR { return second ? upper(a, a + 1) : lower(a, a + 1); };
      Vec<D>* const chunk = chunks + (second ? half : 0);
      const auto a = pair(0), b = pair(2), c = pair(4);
      chunk[0] = lows(a, b);
      if constexpr (count == 6) {
        chunk[1] = lowHigh(c, a);
        chunk[2] = highs(b, c);
      } else {
        const auto e = pair(6), f = pair(8);
        chunk[1] = lows(c, e);
        chunk[2] = lowHigh(f, a);
        chunk[3] = highs(b, c);
        chunk[4] = highs(e, f);
      }
    }
  } else if constexpr (count == 3) {
    const auto turned = hn::BitCast(dd, hn::OddEven(w[0], w[2]));  // third of 0, first of 1, …
    chunks[0] = lows(lower(0, 1), turned);
    chunks[1] = highLow(lower(1, 2), upper(0, 1));
    chunks[2] = highs(turned, upper(1, 2));
  } else {
    const auto turned = hn::BitCast(dd, hn::OddEven(w[0], w[4]));  // last of 0, first of 1, …
    chunks[0] = lows(lower(0, 1), lower(2, 3));
    chunks[1] = lowHigh(turned, lower(1, 2));
    chunks[2] = highLow(lower(3, 4), upper(0, 1));
    chunks[3] = lowHigh(upper(2, 3), turned);
    chunks[4] = highs(upper(1, 2), upper(3, 4));
  }
  storeChunks(d, chunks, to);
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
