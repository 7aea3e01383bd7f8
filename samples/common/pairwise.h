// Choosing few of many combinations so that every pair of values still stands together in one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace dermis::samples {

/// For parameters with so many values each: combinations, one value's number a parameter, in which
/// every two values of two parameters meet at least once. The same for the same arguments.
std::vector<std::vector<std::uint32_t>> pairwiseCombinations(
    std::span<const std::uint32_t> valueCounts);

}  // namespace dermis::samples
