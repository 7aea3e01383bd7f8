// Reports the results of `verify`, as text and for CI.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "verification.h"

namespace dermis::cli {

struct ModelVerification {
  std::string model;
  std::string error;  ///< why the model could not be verified, or empty
  std::vector<VerifiedCase> cases;

  std::size_t failures() const;
};

/// Prints a line for each model and method, then a line for each failure.
void printReport(const std::vector<ModelVerification>& models);

/// Both fail with `ioError`.
Result<void> writeJsonReport(const std::filesystem::path& path, const std::string& device,
                             const std::vector<ModelVerification>& models);
Result<void> writeJunitReport(const std::filesystem::path& path,
                              const std::vector<ModelVerification>& models);

}  // namespace dermis::cli
