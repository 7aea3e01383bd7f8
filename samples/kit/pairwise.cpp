#include "kit/pairwise.h"

#include <array>
#include <cstddef>
#include <random>
#include <utility>

namespace dermis::samples {
namespace {

constexpr std::uint32_t notChosen = 0xffffffffu;
constexpr int candidates = 30;

/// The pairs that do not occur yet.
class OpenPairs {
 public:
  explicit OpenPairs(std::span<const std::uint32_t> counts) : counts_(counts) {
    firsts_.resize(counts.size() * counts.size());
    for (std::size_t a = 0; a < counts.size(); ++a) {
      for (std::size_t b = a + 1; b < counts.size(); ++b) {
        firsts_[a * counts.size() + b] = open_.size();
        open_.resize(open_.size() + std::size_t{counts[a]} * counts[b], true);
      }
    }
    left_ = open_.size();
  }

  std::size_t left() const { return left_; }
  bool isOpen(std::size_t a, std::uint32_t valueA, std::size_t b, std::uint32_t valueB) const {
    return open_[place(a, valueA, b, valueB)];
  }
  void close(const std::vector<std::uint32_t>& combination) {
    for (std::size_t a = 0; a < counts_.size(); ++a) {
      for (std::size_t b = a + 1; b < counts_.size(); ++b) {
        const std::size_t pair = place(a, combination[a], b, combination[b]);
        if (open_[pair]) --left_;
        open_[pair] = false;
      }
    }
  }
  /// Number of open pairs that this value forms with the values that are already chosen.
  std::uint32_t gain(const std::vector<std::uint32_t>& chosen, std::size_t parameter,
                     std::uint32_t value) const {
    std::uint32_t count = 0;
    for (std::size_t other = 0; other < counts_.size(); ++other) {
      if (other == parameter || chosen[other] == notChosen) continue;
      if (isOpen(parameter, value, other, chosen[other])) ++count;
    }
    return count;
  }
  /// Parameter and value of both sides of some open pair.
  std::array<std::uint32_t, 4> anyOpen() const {
    for (std::uint32_t a = 0; a < counts_.size(); ++a) {
      for (std::uint32_t b = a + 1; b < counts_.size(); ++b) {
        for (std::uint32_t valueA = 0; valueA < counts_[a]; ++valueA) {
          for (std::uint32_t valueB = 0; valueB < counts_[b]; ++valueB) {
            if (isOpen(a, valueA, b, valueB)) return {a, valueA, b, valueB};
          }
        }
      }
    }
    return {};
  }

 private:
  std::size_t place(std::size_t a, std::uint32_t valueA, std::size_t b,
                    std::uint32_t valueB) const {
    if (a > b) return place(b, valueB, a, valueA);
    return firsts_[a * counts_.size() + b] + std::size_t{valueA} * counts_[b] + valueB;
  }

  std::span<const std::uint32_t> counts_;
  std::vector<std::size_t> firsts_;
  std::vector<bool> open_;
  std::size_t left_ = 0;
};

/// Fills in the parameters in a random order, each with a value that closes the most pairs.
std::uint32_t complete(std::vector<std::uint32_t>& combination, const OpenPairs& pairs,
                       std::span<const std::uint32_t> counts, std::mt19937& engine) {
  std::vector<std::size_t> order(counts.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[engine() % i]);
  std::uint32_t total = 0;
  for (const std::size_t parameter : order) {
    if (combination[parameter] != notChosen) continue;
    const std::uint32_t start = static_cast<std::uint32_t>(engine() % counts[parameter]);
    std::uint32_t best = start, bestGain = 0;
    for (std::uint32_t i = 0; i < counts[parameter]; ++i) {
      const std::uint32_t value = (start + i) % counts[parameter];
      const std::uint32_t gain = pairs.gain(combination, parameter, value);
      if (gain > bestGain) {
        best = value;
        bestGain = gain;
      }
    }
    combination[parameter] = best;
    total += bestGain;
  }
  return total;
}

}  // namespace

// Greedy, as in Cohen et al. 1997, "The AETG system": each candidate begins with a pair that does
// not occur yet, and the candidate with the most such pairs is chosen.
std::vector<std::vector<std::uint32_t>> pairwiseCombinations(
    std::span<const std::uint32_t> valueCounts) {
  OpenPairs pairs(valueCounts);
  std::mt19937 engine(1);
  std::vector<std::vector<std::uint32_t>> combinations;
  while (pairs.left() != 0) {
    const std::array<std::uint32_t, 4> open = pairs.anyOpen();
    std::vector<std::uint32_t> best;
    std::uint32_t bestGain = 0;
    for (int candidate = 0; candidate < candidates; ++candidate) {
      std::vector<std::uint32_t> combination(valueCounts.size(), notChosen);
      combination[open[0]] = open[1];
      combination[open[2]] = open[3];
      const std::uint32_t gain = 1 + complete(combination, pairs, valueCounts, engine);
      if (gain > bestGain) {
        best = combination;
        bestGain = gain;
      }
    }
    pairs.close(best);
    combinations.push_back(std::move(best));
  }
  return combinations;
}

}  // namespace dermis::samples
