#include "kit/method_rotation.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <random>
#include <set>
#include <tuple>
#include <utility>

namespace dermis::samples {
namespace {

/// A method, a parameter and its value: a combination that an output covers.
using Meeting = std::tuple<Method, std::size_t, std::uint32_t>;

class MethodRotation {
 public:
  MethodRotation(std::span<const OutputCase> outputs, std::span<const Method> methods)
      : all_(methods), methods_(outputs.size()) {
    for (const OutputCase& output : outputs) values_.push_back(parameterValues(output));
  }

  std::vector<std::vector<Method>> shareOut() {
    for (std::size_t output = 0; output < values_.size(); ++output) add(output, mostWanted(output));
    while (addBest()) {
    }
    return methods_;
  }

 private:
  std::size_t newMeetings(std::size_t output, Method method) const {
    std::size_t count = 0;
    for (std::size_t parameter = 0; parameter < values_[output].size(); ++parameter) {
      if (!met_.contains({method, parameter, values_[output][parameter]})) ++count;
    }
    return count;
  }

  /// The method with the most new combinations; of several, the one that was used least.
  Method mostWanted(std::size_t output) const {
    const auto worth = [this, output](Method method) {
      return std::tuple(newMeetings(output, method),
                        -static_cast<std::ptrdiff_t>(uses_[static_cast<std::size_t>(method)]));
    };
    return *std::ranges::max_element(all_, {}, worth);
  }

  /// Adds the method that covers the most new combinations. Returns false if all are covered.
  bool addBest() {
    std::size_t most = 0, best = 0;
    Method bestMethod = Method::linear;
    for (std::size_t output = 0; output < values_.size(); ++output) {
      for (const Method method : all_) {
        if (const std::size_t count = newMeetings(output, method); count > most) {
          most = count;
          best = output;
          bestMethod = method;
        }
      }
    }
    if (most != 0) add(best, bestMethod);
    return most != 0;
  }

  void add(std::size_t output, Method method) {
    methods_[output].push_back(method);
    ++uses_[static_cast<std::size_t>(method)];
    for (std::size_t parameter = 0; parameter < values_[output].size(); ++parameter)
      met_.insert({method, parameter, values_[output][parameter]});
  }

  std::span<const Method> all_;
  std::vector<std::vector<std::uint32_t>> values_;  ///< by output
  std::vector<std::vector<Method>> methods_;        ///< by output
  std::array<std::size_t, allMethods.size()> uses_{};
  std::set<Meeting> met_;
};

}  // namespace

std::vector<std::uint32_t> parameterValues(const OutputCase& output) {
  const OutputLayout& layout = output.layout;
  return {static_cast<std::uint32_t>(layout.positions),
          static_cast<std::uint32_t>(layout.normals),
          static_cast<std::uint32_t>(layout.tangents),
          static_cast<std::uint32_t>(layout.arrangement),
          layout.gap,
          static_cast<std::uint32_t>(layout.motion),
          static_cast<std::uint32_t>(layout.bounds),
          output.tuning.workgroupSize * 16 + output.tuning.instancesPerInvocation};
}

std::vector<std::vector<Method>> shareOutMethods(std::span<const OutputCase> outputs,
                                                 std::span<const Method> methods) {
  return MethodRotation(outputs, methods).shareOut();
}

namespace {

using IsPossible = std::function<bool(std::span<const std::uint32_t>)>;

constexpr int candidates = 30;

/// The pairs that do not occur yet.
class OpenPairs {
 public:
  OpenPairs(std::span<const std::uint32_t> counts, const IsPossible& isPossible) : counts_(counts) {
    firsts_.resize(counts.size() * counts.size());
    for (std::size_t a = 0; a < counts.size(); ++a) {
      for (std::size_t b = a + 1; b < counts.size(); ++b) {
        firsts_[a * counts.size() + b] = open_.size();
        std::vector<std::uint32_t> pair(counts.size(), notChosen);
        for (pair[a] = 0; pair[a] < counts[a]; ++pair[a]) {
          for (pair[b] = 0; pair[b] < counts[b]; ++pair[b]) open_.push_back(isPossible(pair));
        }
      }
    }
    left_ = static_cast<std::size_t>(std::ranges::count(open_, true));
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
                       std::span<const std::uint32_t> counts, const IsPossible& isPossible,
                       std::mt19937& engine) {
  std::vector<std::size_t> order(counts.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[engine() % i]);
  std::uint32_t total = 0;
  for (const std::size_t parameter : order) {
    if (combination[parameter] != notChosen) continue;
    const std::uint32_t start = static_cast<std::uint32_t>(engine() % counts[parameter]);
    std::uint32_t best = notChosen, bestGain = 0;
    for (std::uint32_t i = 0; i < counts[parameter]; ++i) {
      const std::uint32_t value = (start + i) % counts[parameter];
      combination[parameter] = value;
      if (!isPossible(combination)) continue;
      const std::uint32_t gain = pairs.gain(combination, parameter, value);
      if (best == notChosen || gain > bestGain) {
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
    std::span<const std::uint32_t> valueCounts, const IsPossible& isPossible) {
  OpenPairs pairs(valueCounts, isPossible);
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
      const std::uint32_t gain = 1 + complete(combination, pairs, valueCounts, isPossible, engine);
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
