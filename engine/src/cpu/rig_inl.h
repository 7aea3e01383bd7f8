// Evaluates rigs by the arithmetic of core, for as many poses at a time as vectors have lanes. The
// bits are those of `evaluateRig`: each operation rounds once.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "cpu/simd_inl.h"
#include "cpu/task.h"
#include "rig/blob.h"
#include "strict_floating_point.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE::rigs {

#if HWY_MAX_BYTES >= 64
using Lanes = Sixteen;
#else
using Lanes = Wide;
#endif
inline constexpr std::size_t laneCount = hn::MaxLanes(Lanes());

/// A number of each pose.
struct Number {
  hn::Vec<Lanes> v;

  Number() = default;
  explicit DERMIS_INLINE Number(float all) : v(hn::Set(Lanes(), all)) {}
  explicit DERMIS_INLINE Number(hn::Vec<Lanes> vector) : v(vector) {}

  friend DERMIS_INLINE Number operator+(const Number& a, const Number& b) {
    return Number(hn::Add(a.v, b.v));
  }
  friend DERMIS_INLINE Number operator-(const Number& a, const Number& b) {
    return Number(hn::Sub(a.v, b.v));
  }
  friend DERMIS_INLINE Number operator*(const Number& a, const Number& b) {
    return Number(hn::Mul(a.v, b.v));
  }
  friend DERMIS_INLINE Number operator/(const Number& a, const Number& b) {
    return Number(hn::Div(a.v, b.v));
  }
  friend DERMIS_INLINE Number operator-(const Number& a) { return Number(hn::Neg(a.v)); }
  friend DERMIS_INLINE auto operator<(const Number& a, const Number& b) { return hn::Lt(a.v, b.v); }
  friend DERMIS_INLINE auto operator>(const Number& a, const Number& b) { return hn::Gt(a.v, b.v); }
};

DERMIS_INLINE Number squareRoot(const Number& square) {
  return Number(hn::Sqrt(square.v));
}
DERMIS_INLINE Number floorOf(const Number& number) {
  return Number(hn::Floor(number.v));
}
template <typename Mask>
DERMIS_INLINE Number select(Mask mask, const Number& a, const Number& b) {
  return Number(hn::IfThenElse(mask, a.v, b.v));
}
DERMIS_INLINE Number powerOfTwo(const Number& exponent) {
  const hn::RebindToSigned<Lanes> di;
  const auto biased = hn::Add(hn::ConvertTo(di, exponent.v), hn::Set(di, 127));
  return Number(hn::BitCast(Lanes(), hn::ShiftLeft<23>(biased)));
}

#include "rig/evaluate_inl.h"

/// Of as many poses as there are lanes.
struct PoseMemory {
  const float* written[laneCount];
  float* driven[laneCount];
  std::size_t writtenJoints;
  std::span<Number> weights;

  DERMIS_INLINE Transform<Number> joint(std::size_t number) const {
    const bool isWritten = number < writtenJoints;
    const float* const* const from = isWritten ? written : driven;
    const std::size_t offset = 12 * (isWritten ? number : number - writtenJoints);
    const Vec4<Lanes> a = gatherRows(Lanes(), from, offset),
                      b = gatherRows(Lanes(), from, offset + 4),
                      c = gatherRows(Lanes(), from, offset + 8);
    return {{{Number(a.x), Number(a.y), Number(a.z)},
             {Number(b.x), Number(b.y), Number(b.z)},
             {Number(c.x), Number(c.y), Number(c.z)}},
            {Number(a.w), Number(b.w), Number(c.w)}};
  }
  DERMIS_INLINE void setDriven(std::size_t number, const Transform<Number>& t) {
    const Linear<Number>& m = t.linear;
    const Lanes d;
    scatterRows(d, Vec4<Lanes>{m.r0.x.v, m.r0.y.v, m.r0.z.v, t.shift.x.v}, driven, 12 * number);
    scatterRows(d, Vec4<Lanes>{m.r1.x.v, m.r1.y.v, m.r1.z.v, t.shift.y.v}, driven, 12 * number + 4);
    scatterRows(d, Vec4<Lanes>{m.r2.x.v, m.r2.y.v, m.r2.z.v, t.shift.z.v}, driven, 12 * number + 8);
  }
  Number weight(std::size_t number) const { return weights[number]; }
  void setWeight(std::size_t number, const Number& value) { weights[number] = value; }
};

/// As `dispatchRigs`.
inline HWY_ATTR void evaluateRigs(const PackedRig& rig, std::span<const RigPose> poses,
                                  RigScratch& scratch) {
  const RigBlob blob(rig);
  const RigHeader& header = blob.header;
  const std::size_t given = header.givenWeights, all = given + header.drivenWeights;
  static_assert(sizeof(Quat<Number>) <= 4 * sizeof(CacheLine));
  auto* const numbersBegin = reinterpret_cast<Number*>(scratch.numbers.data());
  const std::span basis(numbersBegin, maxRigExamples);
  PoseMemory memory;
  memory.writtenJoints = header.writtenJoints;
  memory.weights = {numbersBegin + maxRigExamples, all};
  const std::span rotations(reinterpret_cast<Quat<Number>*>(memory.weights.data() + all),
                            header.mostInputs);
  HWY_ALIGN float numbers[laneCount];
  for (std::size_t first = 0; first < poses.size(); first += laneCount) {
    // Lanes without a pose compute the last one, too.
    const RigPose* lanes[laneCount];
    for (std::size_t lane = 0; lane < laneCount; ++lane) {
      lanes[lane] = &poses[std::min(first + lane, poses.size() - 1)];
      memory.written[lane] = numbersOf(lanes[lane]->written.data());
      memory.driven[lane] = numbersOf(lanes[lane]->driven.data());
    }
    for (std::size_t weight = 0; weight < given; ++weight) {
      for (std::size_t lane = 0; lane < laneCount; ++lane)
        numbers[lane] = lanes[lane]->givenWeights[weight];
      memory.weights[weight] = Number(hn::Load(Lanes(), numbers));
    }
    evaluateDrivers<Number>(blob, rotations, basis, memory);
    for (std::size_t weight = 0; weight < all; ++weight) {
      hn::Store(memory.weights[weight].v, Lanes(), numbers);
      for (std::size_t lane = 0; lane < laneCount; ++lane)
        lanes[lane]->weights[weight] = numbers[lane];
    }
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE::rigs
HWY_AFTER_NAMESPACE();
