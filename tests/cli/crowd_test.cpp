// The crowd sample: small crowds in every way that it can be told to skin them, with the validation
// layer on. It compares every vertex itself.

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dermis_command.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

CommandResult crowd(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), dermisCrowdProgram);
  return runCommand(arguments);
}

/// 12 figures, 40 frames, each compared, under the validation layer, and what is added to that.
CommandResult smallCrowd(const std::vector<std::string>& added) {
  std::vector<std::string> arguments{"--figures",     "12", "--frames",  "40",
                                     "--check-every", "1",  "--validate"};
  arguments.insert(arguments.end(), added.begin(), added.end());
  return crowd(arguments);
}

class CrowdTest : public ::testing::TestWithParam<std::vector<std::string>> {};

TEST_P(CrowdTest, EveryVertexIsRight) {
  REQUIRE_DEVICE();
  const CommandResult result = smallCrowd(GetParam());
  EXPECT_EQ(result.status, 0) << result.output << result.errors;
  EXPECT_TRUE(result.errors.empty()) << result.errors;
  EXPECT_NE(result.output.find("are inside their bounds"), std::string::npos) << result.output;
}

std::string nameOf(const ::testing::TestParamInfo<std::vector<std::string>>& parameters) {
  std::string name;
  for (const std::string& argument : parameters.param) name += argument;
  std::erase_if(name, [](unsigned char c) { return std::isalnum(c) == 0; });
  return name.empty() ? "asItComes" : name;
}

using Arguments = std::vector<std::string>;
// A budget of 1 MiB is room for three figures.
INSTANTIATE_TEST_SUITE_P(All, CrowdTest,
                         ::testing::Values(Arguments{}, Arguments{"--gpu-culling"},
                                           Arguments{"--frames-in-flight", "1"},
                                           Arguments{"--output-budget", "1"},
                                           Arguments{"--output-budget", "1", "--gpu-culling"}),
                         nameOf);

// Without Vulkan: there is no driver.
TEST(CpuCrowdTest, EveryVertexIsRight) {
  const std::vector<std::string> noDriver{"VK_DRIVER_FILES=/nonexistent.json",
                                          "VK_ICD_FILENAMES=/nonexistent.json"};
  const CommandResult result =
      runCommand({dermisCrowdProgram, "--figures", "12", "--frames", "40", "--check-every", "1",
                  "--device", "cpu", "--output-budget", "1"},
                 noDriver);
  EXPECT_EQ(result.status, 0) << result.output << result.errors;
  EXPECT_TRUE(result.errors.empty()) << result.errors;
  EXPECT_NE(result.output.find("checked   in 40 frames"), std::string::npos) << result.output;
  EXPECT_NE(result.output.find("refused"), std::string::npos) << "the budget is too large";
}

TEST(CpuCrowdTest, WhatNeedsVulkanIsRefused) {
  for (const std::vector<std::string>& added :
       std::initializer_list<std::vector<std::string>>{{"--film", outFile("cpu.png")},
                                                       {"--gpu-culling"},
                                                       {"--frames-in-flight", "2"},
                                                       {"--validate"}}) {
    std::vector<std::string> arguments{"--device", "cpu"};
    arguments.insert(arguments.end(), added.begin(), added.end());
    const CommandResult result = crowd(arguments);
    EXPECT_EQ(result.status, 2) << added.front();
    EXPECT_NE(result.errors.find(added.front() + " needs a Vulkan device"), std::string::npos)
        << result.errors;
  }
}

nlohmann::json readJson(const std::string& path) {
  std::ifstream file(path);
  return nlohmann::json::parse(file);
}

TEST(CrowdReportTest, FiguresWithoutRoomComeWhenOthersHaveGone) {
  REQUIRE_DEVICE();
  const std::string json = outFile("crowd.json");
  const CommandResult result = smallCrowd({"--output-budget", "1", "--json", json});
  ASSERT_EQ(result.status, 0) << result.errors;
  const nlohmann::json parsed = readJson(json);
  EXPECT_EQ(parsed["frames"].get<int>(), 40);
  EXPECT_EQ(parsed["rows"].size(), 2u);
  EXPECT_GT(parsed["check"]["instances"].get<int>(), 0);
  EXPECT_EQ(parsed["check"]["failures"].get<int>(), 0);
  EXPECT_GT(parsed["totals"]["refusals"].get<int>(), 0);
  const nlohmann::json& outputs = parsed["memory"]["outputs"];
  EXPECT_LE(outputs["used"].get<int>(), outputs["capacity"].get<int>());
  EXPECT_EQ(outputs["capacity"].get<int>(), 1 << 20);
}

TEST(CrowdReportTest, InstancesAreLeftOutByRateAndByView) {
  REQUIRE_DEVICE();
  const std::string json = outFile("crowd.json");
  ASSERT_EQ(crowd({"--figures", "12", "--frames", "50", "--no-verify", "--json", json}).status, 0);
  const nlohmann::json parsed = readJson(json);
  EXPECT_TRUE(parsed["check"].is_null());
  EXPECT_EQ(parsed["rows"].size(), 3u) << "the last of fewer frames";
  const nlohmann::json& totals = parsed["totals"];
  EXPECT_GT(totals["outOfView"].get<int>(), 0);
  EXPECT_GT(totals["withinInterval"].get<int>(), 0);
  EXPECT_EQ(totals["instances"].get<int>(), totals["skinned"].get<int>() +
                                                totals["outOfView"].get<int>() +
                                                totals["withinInterval"].get<int>());
}

TEST(CrowdCommandTest, EndsAsTheDermisCommandDoes) {
  const std::string broken = outFile("broken.glb");
  std::ofstream(broken) << "no model";
  const std::vector<std::pair<Arguments, int>> commands{{{"--figures", "0"}, 2},
                                                        {{"--frames", "many"}, 2},
                                                        {{"--frames-in-flight", "0"}, 2},
                                                        {{"--check-every", "0"}, 2},
                                                        {{"--output-budget", "-1"}, 2},
                                                        {{"--model", broken}, 3},
                                                        {{"--model", "/no/such/file.glb"}, 3},
                                                        {{"--device", "no such device"}, 4}};
  for (const auto& [arguments, status] : commands) {
    SCOPED_TRACE(::testing::PrintToString(arguments));
    const CommandResult result = crowd(arguments);
    EXPECT_EQ(result.status, status) << result.errors;
    EXPECT_TRUE(result.errors.starts_with("dermis_crowd: error: ")) << result.errors;
    EXPECT_EQ(std::ranges::count(result.errors, '\n'), 1) << result.errors;
    EXPECT_TRUE(result.output.empty());
  }
}

TEST(CrowdReportTest, AFullDiskLeavesTheReportThatStoodThere) {
  REQUIRE_DEVICE();
  const auto withoutDisk = [](const Arguments& arguments) {
    Arguments command{"/bin/sh",          "-c",        "ulimit -f 1; exec \"$0\" \"$@\" >/dev/null",
                      dermisCrowdProgram, "--figures", "2",
                      "--frames",         "2",         "--no-verify"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return runCommand(command);
  };
  if (withoutDisk({}).status != 0)
    GTEST_SKIP() << "this driver has its memory in files, which must not be larger either";
  const std::string json = outFile("report.json");
  std::ofstream(json) << "a good report";
  const CommandResult result = withoutDisk({"--json", json});
  EXPECT_EQ(result.status, 5);
  EXPECT_EQ(result.errors, "dermis_crowd: error: " + json + " cannot be written: File too large\n");
  std::ifstream file(json);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  EXPECT_EQ(text, "a good report");
}

TEST(CrowdReportTest, ItsModelIsNotOverwritten) {
  for (const char* option : {"--json", "--film"}) {
    const std::string model = outFile("model.png");
    std::ofstream(model) << "a model";
    const CommandResult result = runCommand({dermisCrowdProgram, "--model", model, option, model});
    EXPECT_EQ(result.status, 2);
    EXPECT_EQ(result.errors, "dermis_crowd: error: " + std::string(option) + " " + model +
                                 " would overwrite an input file (see dermis_crowd "
                                 "--help)\n");
  }
}

}  // namespace
}  // namespace dermis::test
