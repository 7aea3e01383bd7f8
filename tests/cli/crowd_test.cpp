// The crowd sample: small crowds in every way that it can be told to skin them, with the validation
// layer on. It compares every vertex itself, and tests/layer shows that it finds wrong ones.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "dermis_command.h"
#include "pictures.h"
#include "test_data.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using Arguments = std::vector<std::string>;

CommandResult crowd(Arguments arguments, const std::vector<std::string>& environment = {}) {
  arguments.insert(arguments.begin(), dermisCrowdProgram);
  return runCommand(arguments, environment);
}

/// The report of 12 figures in 40 frames, each compared. Figures come, go, fade to other clips,
/// jump and leave the view.
nlohmann::json reportOf(const Arguments& added, const std::vector<std::string>& environment = {}) {
  const std::string json = outFile("crowd.json");
  Arguments arguments{"--figures", "12", "--frames", "40", "--check-every", "1", "--json", json};
  arguments.insert(arguments.end(), added.begin(), added.end());
  const CommandResult result = crowd(arguments, environment);
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_TRUE(result.errors.empty()) << result.errors;
  std::ifstream file(json);
  nlohmann::json report = nlohmann::json::parse(file, nullptr, false);
  if (result.status != 0 || report.is_discarded()) return {};

  const nlohmann::json &check = report["check"], &totals = report["totals"];
  EXPECT_EQ(check["frames"], 40);
  EXPECT_GT(check["instances"], 100);
  EXPECT_EQ(check["failures"], 0);
  EXPECT_GT(check["poses"], 50);
  EXPECT_LT(check["worstPose"], 1);
  EXPECT_EQ(report["frames"], 40);
  EXPECT_EQ(report["rows"].size(), 2u) << "every 20th frame";
  EXPECT_GT(totals["skinned"], 0);
  EXPECT_GT(totals["withinInterval"], 0);
  EXPECT_EQ(totals["instances"].get<int>(), totals["skinned"].get<int>() +
                                                totals["outOfView"].get<int>() +
                                                totals["withinInterval"].get<int>());
  return report;
}

/// A figure without room comes when others have gone.
void expectRefusals(const nlohmann::json& report, int mebibytes) {
  EXPECT_GT(report["totals"]["refusals"], 0) << "the budget is too large";
  const nlohmann::json& outputs = report["memory"]["outputs"];
  EXPECT_EQ(outputs["capacity"], mebibytes << 20);
  EXPECT_LE(outputs["used"], outputs["capacity"]);
}

TEST(CrowdTest, EveryVertexIsRightIfTheCpuCulls) {
  REQUIRE_DEVICE();
  // Room for 11 figures.
  const nlohmann::json report = reportOf({"--validate", "--output-budget", "3"});
  ASSERT_TRUE(report.is_object());
  EXPECT_GT(report["totals"]["outOfView"], 0);
  EXPECT_GT(report["totals"]["fading"], 20);
  expectRefusals(report, 3);
}

TEST(CrowdTest, EveryVertexIsRightIfTheGpuCulls) {
  REQUIRE_DEVICE();
  const nlohmann::json report = reportOf({"--validate", "--gpu-culling"});
  ASSERT_TRUE(report.is_object());
  EXPECT_GT(report["totals"]["outOfView"], 0);
  EXPECT_GT(report["totals"]["fading"], 20);
  EXPECT_EQ(report["totals"]["refusals"], 0) << "without a budget there is room for all";
}

TEST(CrowdTest, EveryVertexIsRightWithOneFrameInFlight) {
  REQUIRE_DEVICE();
  // Room for three figures.
  const nlohmann::json report =
      reportOf({"--validate", "--gpu-culling", "--frames-in-flight", "1", "--output-budget", "1"});
  ASSERT_TRUE(report.is_object());
  expectRefusals(report, 1);
}

TEST(CrowdTest, EveryVertexIsRightWithoutVulkan) {
  const nlohmann::json report =
      reportOf({"--device", "cpu", "--output-budget", "3"},
               {"VK_DRIVER_FILES=/nonexistent.json", "VK_ICD_FILENAMES=/nonexistent.json"});
  ASSERT_TRUE(report.is_object());
  EXPECT_GT(report["totals"]["outOfView"], 0);
  EXPECT_GT(report["totals"]["fading"], 20);
  expectRefusals(report, 3);
}

// By one indirect draw and by many commands. The model has texture coordinates, which the
// shader finds by the first vertex of each figure.
TEST(CrowdTest, APictureIsDrawnByOneCommand) {
  REQUIRE_DEVICE();
  const std::optional<std::filesystem::path> data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  const std::string model = (*data / "models/CesiumMan/glTF-Binary/CesiumMan.glb").string();
  std::vector<samples::render::Picture> pictures;
  for (const bool isSingle : {false, true}) {
    const std::string file = outFile("crowd.png");
    Arguments arguments{"--model",   model, "--figures",     "30",        "--frames", "33",
                        "--picture", file,  "--gpu-culling", "--validate"};
    if (isSingle) arguments.emplace_back("--single-draws");
    const CommandResult result = crowd(arguments);
    ASSERT_EQ(result.status, 0) << result.errors;
    pictures.push_back(readPng(file).value());
  }
  EXPECT_EQ(pictures[0].pixels, pictures[1].pixels);
  expectAsReference("crowd_draws", pictures[0]);
}

TEST(CrowdTest, NothingIsComparedWithoutVerification) {
  const std::string json = outFile("crowd.json");
  const CommandResult result =
      crowd({"--device", "cpu", "--figures", "2", "--frames", "21", "--no-verify", "--json", json});
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(result.output.find("checked"), std::string::npos) << result.output;
  std::ifstream file(json);
  const nlohmann::json report = nlohmann::json::parse(file);
  EXPECT_TRUE(report["check"].is_null());
  EXPECT_EQ(report["rows"].size(), 2u) << "the 20th frame and the last";
}

TEST(CrowdTest, EndsAsTheDermisCommandDoes) {
  const std::string broken = outFile("broken.glb"), model = outFile("model.glb");
  std::ofstream(broken) << "no model";
  std::filesystem::copy_file(std::string(sampleModels) + "/bar.glb", model,
                             std::filesystem::copy_options::overwrite_existing);
  const std::string needsVulkan = " needs a Vulkan device";
  struct Case {
    Arguments arguments;
    int status;
    std::string message;
  };
  const std::vector<Case> cases{
      {{"--figures", "0"}, 2, "--figures"},
      {{"--frames-in-flight", "0"}, 2, "--frames-in-flight"},
      {{"--check-every", "0"}, 2, "--check-every"},
      {{"--device", "cpu", "--gpu-culling"}, 2, "--gpu-culling" + needsVulkan},
      {{"--device", "cpu", "--frames-in-flight", "2"}, 2, "--frames-in-flight" + needsVulkan},
      {{"--device", "cpu", "--validate"}, 2, "--validate" + needsVulkan},
      {{"--device", "cpu", "--picture", "a.png"}, 2, "--picture" + needsVulkan},
      {{"--model", model, "--json", model},
       2,
       "--json " + model + " would overwrite an input file"},
      {{"--model", broken}, 3, "broken.glb"},
      {{"--device", "no such device"}, 4, "no such device"},
  };
  for (const Case& each : cases) {
    SCOPED_TRACE(::testing::PrintToString(each.arguments));
    const CommandResult result = crowd(each.arguments);
    EXPECT_EQ(result.status, each.status) << result.errors;
    EXPECT_TRUE(result.errors.starts_with("dermis_crowd: error: ")) << result.errors;
    EXPECT_NE(result.errors.find(each.message), std::string::npos) << result.errors;
    EXPECT_EQ(std::ranges::count(result.errors, '\n'), 1) << result.errors;
    EXPECT_TRUE(result.output.empty()) << result.output;
  }
}

TEST(CrowdTest, AReportThatCannotBeWrittenIsAnError) {
  const CommandResult result = crowd(
      {"--device", "cpu", "--figures", "1", "--frames", "1", "--json", "/no/such/report.json"});
  EXPECT_EQ(result.status, 5);
  EXPECT_EQ(result.errors,
            "dermis_crowd: error: /no/such/report.json cannot be written: No such file or "
            "directory\n");
}

}  // namespace
}  // namespace dermis::test
