// Reports the results of `compare`, as text and as JSON.
#pragma once

#include <filesystem>
#include <string>

#include "comparison.h"

namespace dermis::cli {

/// What was compared, and on which device.
struct ComparisonTitle {
  std::string device;  ///< its name, or "reference"
  std::string driver;  ///< empty for the reference
  std::string model;
  std::string pose;  ///< "rest pose", "clip 0 'walk' at 0.341 s"
};

/// Prints lines that explain the comparison, and a table.
void printComparison(const ComparisonTitle& title, const MethodComparison& comparison);

/// Fails with `ioError`.
Result<void> writeJsonComparison(const std::filesystem::path& path, const ComparisonTitle& title,
                                 const MethodComparison& comparison);

}  // namespace dermis::cli
