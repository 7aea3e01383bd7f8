// How large Dermis may be: caps.tsv. What grows has to make room, or to raise its row with a
// reason.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "dermis/plan.h"
#include "dermis/vulkan/context.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using Counts = std::map<std::string, std::uint64_t>;

/// Calls `visit` with each line of the sources in a folder.
template <typename Visit>
std::uint64_t visitFiles(const char* folder, const Visit& visit) {
  static const std::set<std::string> sources{".cpp", ".h", ".in", ".glsl", ".comp"};
  std::uint64_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(
           std::filesystem::path(sourceFolder) / folder)) {
    const std::filesystem::path& path = entry.path();
    if (!sources.contains(path.extension().string()) && path.filename() != "CMakeLists.txt")
      continue;
    ++files;
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) visit(line);
  }
  return files;
}

/// The modules of all pipelines that a device of some kind can need.
std::set<std::string> allModules() {
  std::set<std::string> modules;
  for (const Method method : allMethods) {
    for (int kind = 0; kind < 32; ++kind) {
      DeviceLimits limits;
      limits.maxStorageBuffersPerStage = kind % 2 != 0 ? storageBuffersWanted : 4;
      limits.texelBuffers = kind / 2 % 2 != 0;
      limits.stagedStores = kind / 4 % 2 != 0;
      PipelineNeeds needs;
      needs.method = method;
      needs.layout.normals = VertexFormat::octahedral16x2;  // vertices of 16 bytes may be staged
      needs.layout.motion = kind / 8 % 2 != 0;
      needs.culledOnGpu = needs.figures = needs.morphsOnGpu = needs.rigs = kind / 16 != 0;
      for (const PipelineId id : *pipelines(needs, limits, {}))
        modules.insert(vulkan::pipelineDescription(id)->module);
      needs.bounds = true;
      if (limits.maxStorageBuffersPerStage < storageBuffersWanted) continue;
      for (const PipelineId id : *pipelines(needs, limits, {}))
        modules.insert(vulkan::pipelineDescription(id)->module);
    }
  }
  return modules;
}

Counts counted() {
  Counts counts;
  const std::regex type("(struct|class|enum class) .*[{].*|using [A-Z][A-Za-z0-9]* =.*");
  counts["public headers"] = visitFiles("engine/include", [&](const std::string& line) {
    ++counts["lines of public headers"];
    if (std::regex_match(line, type) && line.find("using Vk") == std::string::npos)
      ++counts["public types"];
  });
  for (const std::string& module : allModules()) {
    const bool isForComparison = module.find("comparison") != std::string::npos ||
                                 module.find("logarithms") != std::string::npos;
    ++counts[isForComparison                              ? "modules for comparison"
             : module.find("texels") != std::string::npos ? "modules for CPU devices"
                                                          : "modules for every day"];
  }
  for (const char* folder : {"engine", "shaders"})
    visitFiles(folder, [&](const std::string&) { ++counts["lines of engine and shaders"]; });
  return counts;
}

TEST(CapsTest, NothingIsLargerThanItMayBe) {
  const Counts counts = counted();
  std::ifstream table(std::filesystem::path(sourceFolder) / "tests/documentation/caps.tsv");
  std::string line;
  std::getline(table, line);
  std::size_t rows = 0;
  while (std::getline(table, line)) {
    std::istringstream columns(line);
    std::string what;
    std::uint64_t most = 0;
    std::getline(columns, what, '\t');
    columns >> most;
    ASSERT_TRUE(counts.contains(what)) << what;
    EXPECT_LE(counts.at(what), most) << what;
    EXPECT_GE(counts.at(what), most - most / 20) << what << " may be less: lower the row";
    ++rows;
  }
  EXPECT_EQ(rows, counts.size());
}

}  // namespace
}  // namespace dermis::test
