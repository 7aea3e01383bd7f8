#include "centers/pair_index.h"

#include <bit>

#include "strict_floating_point.h"

namespace dermis::centers {
namespace {

/// Number of entries processed at a time. It is fixed, and sums are in a fixed order, so the result
/// does not depend on the SIMD width of the machine.
constexpr std::size_t lanes = 8;

constexpr double sigma = 0.1;
constexpr double log2OfE = 1.4426950408889634;

/// 2^y for y from -1000 to 0, within 1e-14 of it. Not std::exp2, which differs between libraries
/// and takes one value at a time; compilers vectorize this function.
inline double exp2OfNegative(double y) {
  const auto whole = static_cast<std::int32_t>(y - 0.5);
  const double part = y - static_cast<double>(whole);
  // e^x, |x| <= ln 2 / 2, by its series; x^12 / 12! <= 6.3e-15 is left out.
  const double x = part * 0.69314718055994531;
  double power = 1.0 / 39916800;
  power = power * x + 1.0 / 3628800;
  power = power * x + 1.0 / 362880;
  power = power * x + 1.0 / 40320;
  power = power * x + 1.0 / 5040;
  power = power * x + 1.0 / 720;
  power = power * x + 1.0 / 120;
  power = power * x + 1.0 / 24;
  power = power * x + 1.0 / 6;
  power = power * x + 1.0 / 2;
  power = power * x + 1.0;
  power = power * x + 1.0;
  const auto exponent = static_cast<std::uint64_t>(static_cast<std::uint32_t>(whole + 1023));
  return power * std::bit_cast<double>(exponent << 52);
}

std::uint32_t keyOf(const Influence& low, const Influence& high) {
  return low.joint << 16 | high.joint;
}

/// Calls `visit` with each pair of a group's influences, the lower joint first.
template <typename Visit>
void forEachPair(const Group& group, const Visit& visit) {
  const std::span<const Influence> influences = group.influences;
  for (std::size_t high = 1; high < influences.size(); ++high) {
    for (std::size_t low = 0; low < high; ++low) visit(influences[low], influences[high]);
  }
}

}  // namespace

PairIndex::PairIndex(std::span<const Group> groups) {
  for (const Group& group : groups) {
    moments_.push_back(group.moment);
    forEachPair(group, [this](const Influence& low, const Influence& high) {
      ++ranges_[keyOf(low, high)].last;
    });
  }
  std::size_t entries = 0;
  for (auto& [key, range] : ranges_) {
    const std::size_t count = range.last;
    range = {entries, entries};
    entries += (count + lanes - 1) / lanes * lanes;
  }
  lowWeights_.resize(entries);
  highWeights_.resize(entries);
  groups_.resize(entries);
  for (std::uint32_t group = 0; group < groups.size(); ++group) {
    forEachPair(groups[group], [this, group](const Influence& low, const Influence& high) {
      const std::size_t entry = ranges_[keyOf(low, high)].last++;
      lowWeights_[entry] = low.weight;
      highWeights_[entry] = high.weight;
      groups_[entry] = group;
    });
  }
}

const PairIndex::Range* PairIndex::rangeOf(const Influence& first, const Influence& second) const {
  const auto found =
      ranges_.find(first.joint < second.joint ? keyOf(first, second) : keyOf(second, first));
  return found == ranges_.end() ? nullptr : &found->second;
}

std::size_t PairIndex::entryCount(const Influence& first, const Influence& second) const {
  const Range* range = rangeOf(first, second);
  return range == nullptr ? 0 : range->last - range->first;
}

void PairIndex::addSimilar(const Influence& first, const Influence& second, Moment& sum) const {
  const bool ordered = first.joint < second.joint;
  const Influence& low = ordered ? first : second;
  const Influence& high = ordered ? second : first;
  const Range* range = rangeOf(first, second);
  if (range == nullptr) return;

  for (std::size_t entry = range->first; entry < range->last; entry += lanes) {
    double similarity[lanes];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const double lowWeight = lowWeights_[entry + lane], highWeight = highWeights_[entry + lane];
      const double difference = low.weight * highWeight - high.weight * lowWeight;
      similarity[lane] = (low.weight * high.weight) * (lowWeight * highWeight) *
                         exp2OfNegative(difference * difference * (-log2OfE / (sigma * sigma)));
    }
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      sum.add(moments_[groups_[entry + lane]], similarity[lane]);
    }
  }
}

}  // namespace dermis::centers
