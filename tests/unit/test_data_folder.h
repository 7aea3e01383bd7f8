// Where the models and golden poses stand that are not part of the repository.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>

#include "test_paths.h"

namespace dermis::test {

struct TestData {
  std::optional<std::filesystem::path> folder;  ///< holds models/ and golden/; or nothing
  bool isPromised = false;  ///< somebody named the folder, or it is there, though not whole
  std::string absence;      ///< why there is none
};

/// What there is: in `named` where that is not empty, otherwise in `beside`.
inline TestData findTestData(const std::string& named, const std::filesystem::path& beside) {
  const std::filesystem::path folder = named.empty() ? beside : std::filesystem::path(named);
  std::error_code error;
  TestData data;
  data.isPromised = !named.empty() || std::filesystem::exists(folder, error);
  for (const char* part : {"models", "golden/manifest.jsonl"}) {
    if (std::filesystem::exists(folder / part, error)) continue;
    data.absence = "no test data: " + folder.string() + " has no " + part +
                   "; DERMIS_TEST_DATA names the folder that holds models/ and golden/";
    return data;
  }
  data.folder = folder;
  return data;
}

/// In DERMIS_TEST_DATA where that is set, otherwise in `shared` beside the repository.
inline TestData findTestData() {
  const char* set = std::getenv("DERMIS_TEST_DATA");
  return findTestData(set != nullptr ? set : "",
                      std::filesystem::path(sourceFolder) / ".." / "shared");
}

}  // namespace dermis::test
