// Options of the methods, for subcommands with --method or --methods.
#pragma once

#include <CLI/CLI.hpp>

#include <string>

#include "dermis/mesh.h"
#include "kit/program.h"

namespace dermis::cli {

/// Parameters of methods, the same for every vertex, from 0 to 1.
struct MethodShares {
  double dualQuaternionWeight = static_cast<double>(MeshView().dualQuaternionWeight);
  double bulgeStrength = static_cast<double>(MeshView().bulgeStrength);
};

/// Adds --dual-quaternion-weight and --bulge-strength.
void addShares(CLI::App& command, MethodShares& shares);

/// Reports wrong usage if a share is not from 0 to 1.
samples::ExitStatus checkShares(const MethodShares& shares);

/// "linear, dual_quaternion, … or bulge_controlled", with `lastWord` in place of "or".
std::string methodNames(const std::string& lastWord);

}  // namespace dermis::cli
