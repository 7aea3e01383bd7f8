// What `verify` found, for people and for CI.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "verification.h"

namespace dermis::cli {

struct ModelVerification {
  std::string model;
  std::string error;  ///< why it could not be verified, or empty
  std::vector<VerifiedCase> cases;

  std::size_t failures() const;
};

/// A line for each model and method on standard output, then a line for each failure.
void printReport(const std::vector<ModelVerification>& models);

/// Fail with `ioError`.
Result<void> writeJsonReport(const std::filesystem::path& path, const std::string& device,
                             const std::vector<ModelVerification>& models);
Result<void> writeJunitReport(const std::filesystem::path& path,
                              const std::vector<ModelVerification>& models);

}  // namespace dermis::cli
