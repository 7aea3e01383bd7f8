// Chooses what is verified with what, because all combinations take too long.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "dermis/layout.h"
#include "kit/verification_product.h"

namespace dermis::samples {

/// Returns the methods to verify with each output: at least one. Together, every method is combined
/// with every value of every parameter: the format of each attribute, arrangement, gap, motion,
/// bounds and tuning. Deterministic.
std::vector<std::vector<Method>> shareOutMethods(std::span<const OutputCase> outputs,
                                                 std::span<const Method> methods = allMethods);

/// The values of an output case's parameters. Different values of a parameter have different
/// numbers.
std::vector<std::uint32_t> parameterValues(const OutputCase& output);

/// Pairwise testing. For parameters with these numbers of values: combinations in which every two
/// values of two parameters occur together at least once, if that is possible. A combination has
/// the index of a value for each parameter. `isPossible` tells whether a combination can be
/// completed in which some indices are `notChosen`. Deterministic.
std::vector<std::vector<std::uint32_t>> pairwiseCombinations(
    std::span<const std::uint32_t> valueCounts,
    const std::function<bool(std::span<const std::uint32_t>)>& isPossible);
inline constexpr std::uint32_t notChosen = 0xffffffffu;

}  // namespace dermis::samples
