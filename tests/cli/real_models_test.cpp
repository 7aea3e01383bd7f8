// `dermis verify` on every real model, and without one. Too long for every change; tests/run.sh
// nightly runs it.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "dermis_command.h"
#include "test_data.h"

namespace dermis::test {
namespace {

TEST(RealModelsTest, AllVerify) {
  REQUIRE_DEVICE();
  const std::optional<std::filesystem::path> data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  std::vector<std::string> arguments{"verify"};
  for (const auto& entry : std::filesystem::recursive_directory_iterator(*data / "models")) {
    const std::string path = entry.path().string();
    if (!path.ends_with(".gltf") && !path.ends_with(".glb")) continue;
    if (path.find("/negative_") != std::string::npos) continue;
    // Only what has something to verify: `info` says so.
    const CommandResult info = dermis({"info", path, "--json"});
    ASSERT_EQ(info.status, 0) << path << ": " << info.errors;
    const nlohmann::json meshes = nlohmann::json::parse(info.output)["meshes"];
    if (std::any_of(meshes.begin(), meshes.end(),
                    [](const nlohmann::json& mesh) { return mesh["influencesUsed"] != 0; })) {
      arguments.push_back(path);
    }
  }
  EXPECT_GE(arguments.size(), 30u);
  const CommandResult result = dermis(arguments);
  EXPECT_EQ(result.status, 0) << result.output << result.errors;
}

TEST(RealModelsTest, WithoutAModelRandomMeshesVerify) {
  REQUIRE_DEVICE();
  const CommandResult result = dermis({"verify"});
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_TRUE(result.errors.empty()) << "no progress on a pipe: " << result.errors;
  EXPECT_NE(result.output.find("passed  random meshes"), std::string::npos) << result.output;
}

}  // namespace
}  // namespace dermis::test
