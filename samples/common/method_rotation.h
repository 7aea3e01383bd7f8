// Chooses which methods are verified with which output, if all combinations would take too long.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dermis/method.h"
#include "verification_product.h"

namespace dermis::samples {

/// For each of these ways the methods to verify in it: one, or as many as it takes. Over all of
/// them every one of the methods meets every value of every parameter: the format of each
/// attribute, arrangement, gap, motion, bounds and tuning. The same for the same ways.
std::vector<std::vector<Method>> shareOutMethods(std::span<const OutputCase> outputs,
                                                 std::span<const Method> methods = allMethods);

/// The values of an output case's parameters, each a number that no other value of that parameter
/// has.
std::vector<std::uint32_t> parameterValues(const OutputCase& output);

}  // namespace dermis::samples
