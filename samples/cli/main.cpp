// The dermis command: skins glTF models, and verifies every vertex on a device.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "commands.h"
#include "dermis/result.h"
#include "kit/program.h"

namespace {

using dermis::samples::ExitStatus;

ExitStatus run(int argc, char** argv) {
  CLI::App app("Skins characters with dual quaternions in Vulkan compute shaders.", "dermis");
  app.require_subcommand(1);
  app.set_version_flag("--version", fmt::format("dermis {}.{}.{}", DERMIS_VERSION_MAJOR,
                                                DERMIS_VERSION_MINOR, DERMIS_VERSION_PATCH));
  app.footer(dermis::samples::exitStatusHelp);
  const std::array<std::pair<const char*, dermis::cli::Run>, 8> commands{{
      {"devices", dermis::cli::addDevices(app)},
      {"info", dermis::cli::addInfo(app)},
      {"skin", dermis::cli::addSkin(app)},
      {"render", dermis::cli::addRender(app)},
      {"verify", dermis::cli::addVerify(app)},
      {"diagnose", dermis::cli::addDiagnose(app)},
      {"compare", dermis::cli::addCompare(app)},
      {"bench", dermis::cli::addBench(app)},
  }};
  if (argc > 1 && argv[1][0] != '-' &&
      std::none_of(commands.begin(), commands.end(), [&](const auto& command) {
        return std::string_view(command.first) == argv[1];
      })) {
    return dermis::samples::reportWrongUsage(fmt::format("there is no command '{}'", argv[1]));
  }
  if (const auto ended = dermis::samples::parseOptions(app, argc, argv)) return *ended;
  for (const auto& [name, command] : commands) {
    if (app.got_subcommand(name)) return command();
  }
  return ExitStatus::wrongUsage;
}

}  // namespace

int main(int argc, char** argv) {
  return dermis::samples::runProgram("dermis", argc, argv, run);
}
