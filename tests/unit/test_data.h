// Where the tests find the models and golden poses that are not part of the repository.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <system_error>

#include "test_paths.h"

namespace dermis::test {

/// The folder that holds `models/` and `golden/`: DERMIS_TEST_DATA where that is set, otherwise
/// `shared` beside the repository. Nothing where there is no such folder; a test then skips itself
/// with that as its reason.
inline std::optional<std::filesystem::path> testDataFolder() {
  const char* set = std::getenv("DERMIS_TEST_DATA");
  const bool named = set != nullptr && *set != '\0';
  const std::filesystem::path folder =
      named ? std::filesystem::path(set) : std::filesystem::path(sourceFolder) / ".." / "shared";
  std::error_code error;
  if (!std::filesystem::is_directory(folder / "models", error)) return std::nullopt;
  return folder;
}

/// The reason to give to GTEST_SKIP.
inline constexpr const char* noTestData =
    "no test data: set DERMIS_TEST_DATA to the folder that holds models/ and golden/";

}  // namespace dermis::test
