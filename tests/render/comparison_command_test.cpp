// `dermis compare -o`: what it writes, and what it says.

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "dermis_command.h"
#include "pictures.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

const std::string bar = std::string(sampleModels) + "/bar.glb";

CommandResult compare(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {"compare", "--repetitions", "1", "--instances", "1"});
  return dermis(arguments);
}

TEST(ComparisonCommandTest, WritesAPictureBesidesTheTable) {
  REQUIRE_DEVICE();
  const std::string out = outFile("bar.png");
  const CommandResult result = compare({"--time", "1", "-o", out, "--width", "500", "--methods",
                                        "linear,dual_quaternion_iterative", bar});
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(result.errors.empty()) << result.errors;
  // All methods, whatever the columns are.
  for (const char* word : {"instructions", "bulge_controlled", "1.000 s"})
    EXPECT_NE(result.output.find(word), std::string::npos) << result.output;
  const auto picture = readPng(out);
  ASSERT_TRUE(picture);
  EXPECT_EQ(picture->width, 500u);
  EXPECT_GT(picture->height, 500u);
}

TEST(ComparisonCommandTest, NeedsNoModel) {
  REQUIRE_DEVICE();
  const std::string out = outFile("built-in.png");
  const CommandResult result = compare({"-o", out, "--width", "480", "--methods", "linear"});
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.output.find("the built-in arm"), std::string::npos) << result.output;
  EXPECT_TRUE(readPng(out));
}

TEST(ComparisonCommandTest, WhatIsWrongHasItsStatus) {
  const std::vector<std::vector<std::string>> wrong{
      {bar, "-o", "a.jpg"},
      {bar, "-o", "a.mp4"},
      {bar, "-o", "a%02d.png"},
      {bar, "-o", "a.png", "--device", "cpu"},
      {bar, "-o", "a.png", "--width", "100"},
      {bar, "-o", "a.png", "--width", "100000"},
      {bar, "-o", "a.png", "--width", "500"},  // too many columns for it
      {bar, "-o", "a.png", "--methods", "magic"},
      {bar, "-o", "a.png", "--methods", "linear,linear"},
      {bar, "--methods", "linear"},
      {bar, "--width", "800"},
      {"-o", "a.png", "--time", "1"},
      {"-o", "a.png", "--animation", "bend"},
      {"--json", outFile("a.json")},
  };
  for (const std::vector<std::string>& arguments : wrong) {
    SCOPED_TRACE(::testing::PrintToString(arguments));
    const CommandResult result = compare(arguments);
    EXPECT_EQ(result.status, 2);
    expectOneErrorLine(result);
    EXPECT_FALSE(std::filesystem::exists("a.png"));
  }
}

TEST(ComparisonCommandTest, AFileThatCannotBeWrittenEndsWithFive) {
  REQUIRE_DEVICE();
  const CommandResult result =
      compare({"-o", "/nonexistent/folder/a.png", "--width", "480", "--methods", "linear"});
  EXPECT_EQ(result.status, 5);
  expectOneErrorLine(result);
}

}  // namespace
}  // namespace dermis::test
