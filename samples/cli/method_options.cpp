#include "method_options.h"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "dermis/layout.h"

namespace dermis::cli {

void addShares(CLI::App& command, MethodShares& shares) {
  // An empty string would be parsed as 0.
  command
      .add_option("--dual-quaternion-weight", shares.dualQuaternionWeight,
                  fmt::format("For blended: from 0 (linear) to 1 (dual_quaternion) [{}]",
                              shares.dualQuaternionWeight))
      ->check(CLI::Number);
  command
      .add_option("--bulge-strength", shares.bulgeStrength,
                  fmt::format("For bulge_controlled: from 0 (bulges like dual_quaternion) to 1 "
                              "(bulges as little as center_of_rotation) [{}]",
                              shares.bulgeStrength))
      ->check(CLI::Number);
}

samples::ExitStatus checkShares(const MethodShares& shares) {
  const std::array<std::pair<const char*, double>, 2> options{
      {{"--dual-quaternion-weight", shares.dualQuaternionWeight},
       {"--bulge-strength", shares.bulgeStrength}}};
  for (const auto& [name, value] : options) {
    // Also refuses NaN.
    if (!(value >= 0 && value <= 1))
      return samples::reportWrongUsage(fmt::format("{} must be from 0 to 1", name));
  }
  return samples::ExitStatus::done;
}

std::string methodNames(const std::string& lastWord) {
  std::string names;
  for (const Method method : allMethods) {
    if (!names.empty()) names += method == allMethods.back() ? " " + lastWord + " " : ", ";
    names += methodName(method);
  }
  return names;
}

}  // namespace dermis::cli
