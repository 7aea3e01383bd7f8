// The second stage: bounds and clamped vertices of the instances in a tile.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

#include "cpu/tile_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// The bounds, and the numbers of clamped vertices, of a company or a lone instance.
template <class D>
struct Findings {
  Vec<D> least[3], greatest[3];
  std::uint32_t clamped[hn::MaxLanes(D())] = {};

  explicit Findings(D d) {
    for (Vec<D>& value : least) value = hn::Set(d, std::numeric_limits<float>::infinity());
    for (Vec<D>& value : greatest) value = hn::Set(d, -std::numeric_limits<float>::infinity());
  }
};

template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void findBounds(D d, const Tile<D>& tile, std::size_t units,
                                      const VertexRange& range, Findings<D>& findings) {
  for (std::size_t unit = 0; unit < units; ++unit) {
    const bool whole = isWhole<isLone, D>(range, unit);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      // NaN leaves the bounds unchanged: both comparisons are false.
      const Vec<D> value = tile.slots[unit][axis];
      Vec<D>&least = findings.least[axis], &greatest = findings.greatest[axis];
      auto isLess = hn::Lt(value, least), isGreater = hn::Gt(value, greatest);
      if (!whole) {
        const auto wanted = lanesInRange<isLone>(d, range, unit);
        isLess = hn::And(wanted, isLess);
        isGreater = hn::And(wanted, isGreater);
      }
      least = hn::IfThenElse(isLess, value, least);
      greatest = hn::IfThenElse(isGreater, value, greatest);
    }
  }
}

/// Adds what was found of the instance in lanes `first` to `end` of all.
template <class D>
inline HWY_ATTR void addFindings(D d, const Findings<D>& findings, std::size_t first,
                                 std::size_t end, std::uint32_t clamped, InstanceResult& result) {
  const auto ordered = [](float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value == 0 ? 0.0f : value);
    return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
  };
  InstanceResult found;
  found.clampedVertices = clamped;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    HWY_ALIGN float lanes[2][hn::MaxLanes(d)];
    hn::Store(findings.least[axis], d, lanes[0]);
    hn::Store(findings.greatest[axis], d, lanes[1]);
    const float least = *std::min_element(lanes[0] + first, lanes[0] + end);
    const float greatest = *std::max_element(lanes[1] + first, lanes[1] + end);
    if (!(least <= greatest)) continue;
    found.orderedMin[axis] = ordered(least);
    found.orderedMax[axis] = ordered(greatest);
  }
  addResult(result, found);
}

/// Maps positions from the boxes of their instances to [-1, 1], and counts those outside.
template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void relateToBoxes(D d, const TaskInstance* const* instances,
                                         std::size_t units, const VertexRange& range, Tile<D>& tile,
                                         Findings<D>& findings) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  HWY_ALIGN float centers[3][lanes], inverses[3][lanes], counts[lanes];
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const TaskInstance& instance = *instances[isLone ? 0 : lane];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      centers[axis][lane] = instance.boxCenter[axis];
      inverses[axis][lane] = instance.boxInverse[axis];
    }
  }
  for (std::size_t unit = 0; unit < units; ++unit) {
    auto isOutside = hn::Ne(hn::Zero(d), hn::Zero(d));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Vec<D>& value = tile.slots[unit][axis];
      value = hn::Mul(hn::Sub(value, hn::Load(d, centers[axis])), hn::Load(d, inverses[axis]));
      // A vertex on a face of the engine's box may lie outside by a rounding error.
      isOutside = hn::Or(isOutside, hn::Gt(hn::Abs(value), hn::Set(d, 1.00001f)));
    }
    if (hn::AllFalse(d, isOutside)) continue;
    isOutside = hn::And(isOutside, lanesInRange<isLone>(d, range, unit));
    hn::Store(hn::IfThenElseZero(isOutside, hn::Set(d, 1.0f)), d, counts);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      if (counts[lane] != 0) ++findings.clamped[isLone ? 0 : lane];
    }
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
