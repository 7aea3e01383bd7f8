#include "generated_parts.h"

#include <nlohmann/json.hpp>

#include <array>
#include <cctype>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "dermis/layout.h"
#include "dermis/plan.h"
#include "dermis/scene.h"
#include "run_command.h"
#include "scene/states.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

/// "samples/minimal/main.cpp [load]"
std::string code(const std::string& source) {
  const std::size_t bracket = source.find(" [");
  if (bracket == std::string::npos || source.back() != ']') return {};
  return region(readText(source.substr(0, bracket)),
                source.substr(bracket + 2, source.size() - bracket - 3));
}

/// A line of at most 110 characters if spaces allow it, continued below the descriptions.
std::string wrapped(const std::string& line) {
  constexpr std::size_t width = 110, indentation = 30;
  if (line.size() <= width) return line + '\n';
  const std::size_t space = line.rfind(' ', width);
  if (space == std::string::npos || space <= indentation) return line + '\n';
  const std::size_t indent = line.front() == ' ' ? indentation : 0;
  return line.substr(0, space) + '\n' + wrapped(std::string(indent, ' ') + line.substr(space + 1));
}

/// What it prints for --help, without the exit statuses, which are the same for all.
std::string help(const std::string& command) {
  std::istringstream words(command);
  std::vector<std::string> called;
  for (std::string word; words >> word;) called.push_back(word);
  if (called.empty() || called[0] != "dermis") return {};
  called[0] = dermisProgram;
  called.emplace_back("--help");
  const CommandResult result = runCommand(called);
  if (result.status != 0) return {};
  std::istringstream lines(result.output.substr(0, result.output.find("\nExit status:")));
  std::string printed;
  for (std::string line; std::getline(lines, line);) printed += wrapped(line);
  return printed;
}

/// What an engine has to know of sizes and limits.
std::string numbers() {
  const SceneDescription scene;
  const DeviceLimits limits;
  const std::pair<const char*, std::uint64_t> rows[] = {
      {"bytes of a `JointMatrix`", sizeof(JointMatrix)},
      {"maximum joints of a pose", maxPoseJoints},
      {"frames in flight, by default", scene.framesInFlight},
      {"storage buffers per stage, minimum", limits.maxStorageBuffersPerStage},
      {"storage buffers per stage for bounds and snorm16 positions", storageBuffersWanted},
      {"bytes of a vertex with float32x3 positions and normals",
       placeVertices({.normals = VertexFormat::float32x3}, 1)->attributes[0].stride}};
  std::string table = "| | |\n| --- | --- |\n";
  for (const auto& [what, number] : rows)
    table += "| " + std::string(what) + " | " + std::to_string(number) + " |\n";
  return table;
}

/// How many pipelines `Context::prepare` builds.
std::string pipelines() {
  std::string table = "| method | pipelines |\n| --- | --- |\n";
  for (const Method method : allMethods) {
    PipelineNeeds needs;
    needs.method = method;
    needs.layout.normals = VertexFormat::float32x3;
    const Result<std::vector<PipelineId>> all = pipelines(needs, DeviceLimits(), {});
    table += "| `" + std::string(methodName(method)) + "` | " +
             std::to_string(all ? all->size() : 0) + " |\n";
  }
  return table;
}

/// What decides whether a frame skins an instance: the tables of the library.
std::string views() {
  constexpr std::array names{"leaving", "shown", "hidden", "returning"};
  std::string table = "| view | hide | show | a frame is executed |\n| --- | --- | --- | --- |\n";
  for (std::size_t view = 0; view < viewAfter.size(); ++view) {
    table += std::string("| ") + names[view];
    for (const View next : viewAfter[view])
      table += std::string(" | ") + names[static_cast<std::size_t>(next)];
    table += " |\n";
  }
  return table;
}

std::string actionTable() {
  constexpr std::array names{"leave", "settle", "skin on the beat", "skin", "restart"};
  std::string table =
      "| view | nothing | stale | urgent | restart |\n| --- | --- | --- | --- | --- |\n";
  constexpr std::array views{"leaving", "shown", "hidden", "returning"};
  for (std::size_t view = 0; view < actions.size(); ++view) {
    table += std::string("| ") + views[view];
    for (const Action action : actions[view])
      table += std::string(" | ") + names[static_cast<std::size_t>(action)];
    table += " |\n";
  }
  return table;
}

std::string rounded(double value, int digits) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.*f", digits, value);
  return text;
}

/// What `dermis compare` finds with the reference: no time, no device.
std::string shapes() {
  const std::filesystem::path json =
      std::filesystem::temp_directory_path() / "dermis_documentation_shapes.json";
  const CommandResult result =
      runCommand({dermisProgram, "compare", std::string(sampleModels) + "/figure.glb", "--device",
                  "reference", "--json", json.string()});
  if (result.status != 0) return {};
  nlohmann::json report;
  std::ifstream(json) >> report;
  std::filesystem::remove(json);
  std::string table =
      "| method | twist: radius | twist: volume | bend: section | bend: volume | bend: reach |\n"
      "| --- | --- | --- | --- | --- | --- |\n";
  for (const nlohmann::json& method : report.at("methods")) {
    const nlohmann::json &twist = method.at("twist"), &bend = method.at("bend");
    table += "| `" + method.at("method").get<std::string>() + "` | " +
             rounded(twist.at("radius"), 2) + " | " + rounded(twist.at("volume"), 2) + " | " +
             rounded(bend.at("section"), 2) + " | " + rounded(bend.at("volume"), 2) + " | " +
             rounded(bend.at("reach"), 2) + " |\n";
  }
  return table;
}

/// Those that the viewer's help shows.
std::string viewerKeys() {
  const std::string keys = readText("samples/showcase/viewer/interface.cpp");
  const std::regex key(R"re(KeyHelp\{"([^"]+)", "([^"]+)"\})re");
  std::string table = "| key | |\n| --- | --- |\n";
  for (auto found = std::sregex_iterator(keys.begin(), keys.end(), key);
       found != std::sregex_iterator(); ++found)
    table += "| " + (*found)[1].str() + " | " + (*found)[2].str() + " |\n";
  return table;
}

std::string trust() {
  const CommandResult result = runCommand({std::string(sourceFolder) + "/tests/trust.sh"});
  return result.status == 0 ? result.output : std::string();
}

}  // namespace

std::string generate(const HeldPart& part) {
  if (part.kind == "code") return code(part.source);
  if (part.kind == "help") return help(part.source);
  if (part.source == "pipelines") return pipelines();
  if (part.source == "numbers") return numbers();
  if (part.source == "shapes") return shapes();
  if (part.source == "viewer keys") return viewerKeys();
  if (part.source == "trust") return trust();
  if (part.source == "views") return views();
  if (part.source == "actions") return actionTable();
  return {};
}

std::string withoutLayout(const std::string& help) {
  std::string plain;
  for (const char letter : help) {
    const auto byte = static_cast<unsigned char>(letter);
    if (std::isspace(byte) == 0) plain += static_cast<char>(std::tolower(byte));
  }
  return plain;
}

}  // namespace dermis::test
