// Pairwise testing: chooses a few of many combinations so that every pair of values occurs in at
// least one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace dermis::samples {

/// For parameters with these numbers of values: combinations in which every two values of two
/// parameters occur together at least once. A combination has the index of a value for each
/// parameter. Deterministic.
std::vector<std::vector<std::uint32_t>> pairwiseCombinations(
    std::span<const std::uint32_t> valueCounts);

}  // namespace dermis::samples
