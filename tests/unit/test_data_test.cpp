// Whether a test that has no data is skipped or fails.

#include "test_data.h"

#include <gtest/gtest-spi.h>

#include <cstdlib>
#include <fstream>
#include <string>

namespace dermis::test {
namespace {

namespace fs = std::filesystem;

/// Sets CI, or takes it away, until the test ends.
class TestDataTest : public ::testing::Test {
 protected:
  TestDataTest() {
    const char* set = std::getenv("CI");
    if (set != nullptr) before_ = set;
    folder_ =
        fs::path(::testing::TempDir()) /
        ("data_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
  }
  ~TestDataTest() override {
    if (before_) {
      setenv("CI", before_->c_str(), 1);
    } else {
      unsetenv("CI");
    }
    fs::remove_all(folder_);
  }

  static TestData inContinuousIntegration(TestData data) {
    setenv("CI", "1", 1);
    return data;
  }
  void makeModels() const { fs::create_directories(folder_ / "models"); }
  void makeGolden() const {
    fs::create_directories(folder_ / "golden");
    std::ofstream(folder_ / "golden" / "manifest.jsonl");
  }

  fs::path folder_;
  const fs::path nowhere_ = "/nonexistent";

 private:
  std::optional<std::string> before_;
};

TEST_F(TestDataTest, AWholeFolderIsUsed) {
  makeModels();
  makeGolden();
  for (const TestData& data :
       {findTestData("", folder_), findTestData(folder_.string(), nowhere_)}) {
    EXPECT_EQ(testDataFolder(inContinuousIntegration(data)), folder_);
  }
}

TEST_F(TestDataTest, WhatNobodyPromisedIsNotMissed) {
  EXPECT_EQ(testDataFolder(inContinuousIntegration(findTestData("", nowhere_))), std::nullopt);
}

TEST_F(TestDataTest, OutsideContinuousIntegrationNothingIsMissed) {
  makeModels();
  unsetenv("CI");
  EXPECT_EQ(testDataFolder(findTestData("", folder_)), std::nullopt);
  EXPECT_EQ(testDataFolder(findTestData(nowhere_.string(), folder_)), std::nullopt);
}

TEST_F(TestDataTest, AFolderThatWasNamedMustBeWhole) {
  static TestData data;
  data = inContinuousIntegration(findTestData(nowhere_.string(), folder_));
  EXPECT_NONFATAL_FAILURE(testDataFolder(data), "/nonexistent has no models");
}

TEST_F(TestDataTest, AFolderThatIsThereMustBeWhole) {
  static TestData data;
  makeModels();
  data = inContinuousIntegration(findTestData("", folder_));
  EXPECT_NONFATAL_FAILURE(testDataFolder(data), "has no golden/manifest.jsonl");
  fs::remove_all(folder_);
  makeGolden();
  data = findTestData("", folder_);
  EXPECT_NONFATAL_FAILURE(testDataFolder(data), "has no models");
}

}  // namespace
}  // namespace dermis::test
