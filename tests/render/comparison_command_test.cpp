// `dermis compare -o`: what it writes, and what it says.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "dermis/layout.h"
#include "dermis_command.h"
#include "pictures.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

const std::string bar = std::string(sampleModels) + "/bar.glb";

CommandResult compare(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "compare");
  return dermis(arguments);
}

/// The figures of each method in a report, by its name.
std::map<std::string, nlohmann::json> methodsIn(const nlohmann::json& report) {
  std::map<std::string, nlohmann::json> methods;
  for (const nlohmann::json& method : report.at("methods")) methods[method.at("method")] = method;
  return methods;
}

/// The second word of each line that begins with the name of a method.
std::map<std::string, std::string> timesIn(const std::string& output) {
  std::map<std::string, std::string> times;
  std::istringstream lines(output);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string first, second;
    words >> first >> second;
    if (methodFromName(first)) times[first] = second;
  }
  return times;
}

// Each comparison on a device builds pipelines for all methods, so one has all that is asked of it:
// the table, the report and the picture.
TEST(ComparisonCommandTest, EveryMethodHasARowAndThePictureTheColumnsThatAreNamed) {
  REQUIRE_DEVICE();
  const std::string out = outFile("bar.png"), json = outFile("bar.json");
  const CommandResult result =
      compare({"--time", "1", "--instances", "7", "--repetitions", "3", "-o", out, "--json", json,
               "--width", "500", "--methods", "linear,dual_quaternion_iterative", bar});
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(result.errors.empty()) << "no progress on a pipe: " << result.errors;
  for (const char* word : {"instructions", "bulge_controlled", "1.000 s"})
    EXPECT_NE(result.output.find(word), std::string::npos) << result.output;
  std::map<std::string, std::string> times = timesIn(result.output);
  EXPECT_EQ(times.size(), allMethods.size()) << result.output;
  EXPECT_EQ(times["linear"], "1.00");

  const nlohmann::json report = nlohmann::json::parse(std::ifstream(json));
  EXPECT_EQ(report.at("instances"), 7);
  EXPECT_EQ(report.at("repetitions"), 3);
  EXPECT_EQ(report.at("joints"), 2);
  EXPECT_FALSE(report.at("scales").get<bool>());
  EXPECT_FALSE(report.at("driver").get<std::string>().empty());
  const std::map<std::string, nlohmann::json> methods = methodsIn(report);
  EXPECT_EQ(methods.at("linear").at("time"), 1.0);
  EXPECT_EQ(methods.at("linear").at("bytesPerJoint"), 48);
  EXPECT_EQ(methods.at("dual_quaternion").at("bytesPerJoint"), 32);
  EXPECT_EQ(methods.at("log_matrix").at("bytesPerJoint"), 48);
  EXPECT_EQ(methods.at("dual_quaternion").at("difference").at("largest"), 0.0);
  for (const auto& [name, method] : methods) {
    EXPECT_GT(method.at("seconds").get<double>(), 0) << name;
    EXPECT_GT(method.at("time").get<double>(), 0) << name;
    EXPECT_GT(method.at("instructions").get<int>(), 20) << name;
  }

  const auto picture = readPng(out);
  ASSERT_TRUE(picture);
  EXPECT_EQ(picture->width, 500u);
  EXPECT_GT(picture->height, 500u);
}

/// The rows of the pictures in a sheet, from the first one to behind the last one.
std::vector<std::array<std::uint32_t, 2>> stripsIn(const samples::render::Picture& sheet) {
  std::vector<std::array<std::uint32_t, 2>> strips;
  const auto isPaper = [&sheet](std::uint32_t row) {
    const std::uint8_t* const pixel = &sheet.pixels[(std::size_t{row} * sheet.width + 30) * 4];
    return std::equal(pixel, pixel + 4, sheet.pixels.begin());
  };
  for (std::uint32_t row = 0, first = 0; row < sheet.height; ++row) {
    if (!isPaper(row)) continue;
    if (row - first > 60) strips.push_back({first, row});
    first = row + 1;
  }
  return strips;
}

// The twist of the hand is at the wrist without the rig.
TEST(ComparisonCommandTest, AModelIsDrawnWithoutAndWithItsRig) {
  REQUIRE_DEVICE();
  const std::string out = outFile("rigged.png"), json = outFile("rigged.json");
  const CommandResult result =
      compare({std::string(sampleModels) + "/rigged_arm.glb", "--animation", "twist", "--time", "1",
               "--instances", "1", "--repetitions", "1", "-o", out, "--json", json, "--width",
               "480", "--methods", "linear"});
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(
      result.output.find("\nrig      drives 3 joints and 2 morph weights\n         a pose takes "),
      std::string::npos)
      << result.output;
  const nlohmann::json rigs = nlohmann::json::parse(std::ifstream(json)).at("rigs");
  EXPECT_EQ(rigs.at("drivenJoints"), 3);
  EXPECT_EQ(rigs.at("drivenWeights"), 2);
  EXPECT_GT(rigs.at("secondsPerPose").get<double>(), 0);

  const auto picture = readPng(out);
  ASSERT_TRUE(picture);
  const std::vector<std::array<std::uint32_t, 2>> strips = stripsIn(*picture);
  ASSERT_EQ(strips.size(), 2u);
  std::array<std::vector<std::uint8_t>, 2> rows;
  for (std::size_t strip = 0; strip < 2; ++strip) {
    const auto at = [&](std::uint32_t row) {
      return picture->pixels.begin() + std::ptrdiff_t{row} * picture->width * 4;
    };
    rows[strip].assign(at(strips[strip][0]), at(strips[strip][1]));
  }
  std::size_t differing = 0;
  for (std::size_t i = 0; i < std::min(rows[0].size(), rows[1].size()); i += 4)
    differing += std::abs(int{rows[0][i]} - int{rows[1][i]}) > 24 ? 1u : 0u;
  EXPECT_GT(differing, 200u);
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

// The table comes before the picture.
TEST(ComparisonCommandTest, NeedsNoModelAndEndsWithFiveIfTheFileCannotBeWritten) {
  REQUIRE_DEVICE();
  const CommandResult result =
      compare({"--repetitions", "1", "--instances", "1", "-o", "/nonexistent/folder/a.png",
               "--width", "480", "--methods", "linear"});
  EXPECT_EQ(result.status, 5);
  expectOneErrorLine(result);
  EXPECT_NE(result.errors.find("/nonexistent/folder/a.png"), std::string::npos) << result.errors;
  EXPECT_NE(result.output.find("the built-in arm"), std::string::npos) << result.output;
}

}  // namespace
}  // namespace dermis::test
