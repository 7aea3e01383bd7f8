// The models and golden poses that are not part of the repository, for tests that want them.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>

#include "test_data_folder.h"

namespace dermis::test {

/// The folder, if there is one. Otherwise the test fails, where this is continuous integration and
/// the data was promised; it is for the caller to skip the rest.
inline std::optional<std::filesystem::path> testDataFolder(const TestData& data = findTestData()) {
  const bool isContinuousIntegration = std::getenv("CI") != nullptr;
  if (!data.folder && data.isPromised && isContinuousIntegration) ADD_FAILURE() << data.absence;
  return data.folder;
}

/// The reason to give to GTEST_SKIP.
inline constexpr const char* noTestData =
    "no test data: set DERMIS_TEST_DATA to the folder that holds models/ and golden/";

}  // namespace dermis::test
