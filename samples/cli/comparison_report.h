// What `compare` found, for people and for programs.
#pragma once

#include <filesystem>
#include <string>

#include "comparison.h"

namespace dermis::cli {

/// What was compared where.
struct ComparisonTitle {
  std::string device;  ///< its name, or "reference"
  std::string driver;  ///< empty for the reference
  std::string model;
  std::string pose;  ///< "rest pose", "clip 0 'walk' at 0.341 s"
};

/// A table on standard output, after lines that say how to read it.
void printComparison(const ComparisonTitle& title, const MethodComparison& comparison);

/// Fails with `ioError`.
Result<void> writeJsonComparison(const std::filesystem::path& path, const ComparisonTitle& title,
                                 const MethodComparison& comparison);

}  // namespace dermis::cli
