#include "kit/method_rotation.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <set>
#include <tuple>

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

}  // namespace dermis::samples
