// The dermis command: skins glTF models, and proves on a device that every vertex is right.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <new>
#include <string_view>
#include <utility>

#include "commands.h"
#include "dermis/version.h"

namespace {

using dermis::cli::ExitStatus;
using dermis::cli::reportError;

ExitStatus run(int argc, char** argv) {
  CLI::App app("Skins characters with dual quaternions in Vulkan compute shaders.", "dermis");
  app.require_subcommand(1);
  app.set_version_flag("--version", fmt::format("dermis {}.{}.{}", DERMIS_VERSION_MAJOR,
                                                DERMIS_VERSION_MINOR, DERMIS_VERSION_PATCH));
  app.footer(
      "Exit status: 0 done, 1 verification failed, 2 wrong usage, 3 bad input, 4 no usable "
      "device,\n"
      "5 anything else that stopped it.");
  const std::array<std::pair<const char*, dermis::cli::Run>, 6> commands{{
      {"devices", dermis::cli::addDevices(app)},
      {"info", dermis::cli::addInfo(app)},
      {"skin", dermis::cli::addSkin(app)},
      {"render", dermis::cli::addRender(app)},
      {"verify", dermis::cli::addVerify(app)},
      {"compare", dermis::cli::addCompare(app)},
  }};
  if (argc > 1 && argv[1][0] != '-' &&
      std::none_of(commands.begin(), commands.end(), [&](const auto& command) {
        return std::string_view(command.first) == argv[1];
      })) {
    return reportError(ExitStatus::wrongUsage,
                       fmt::format("there is no command '{}' (dermis --help tells more)", argv[1]));
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {
    app.exit(success);  // --help, --version
    return ExitStatus::done;
  } catch (const CLI::ParseError& error) {
    return reportError(ExitStatus::wrongUsage,
                       fmt::format("{} (dermis --help tells more)", error.what()));
  }
  for (const auto& [name, command] : commands) {
    if (app.got_subcommand(name)) return command();
  }
  return ExitStatus::wrongUsage;
}

}  // namespace

int main(int argc, char** argv) {
  ExitStatus status = ExitStatus::stopped;
  try {
    status = run(argc, argv);
  } catch (const std::bad_alloc&) {
    status = reportError(ExitStatus::stopped, "out of memory");
  } catch (const std::exception& error) {
    status = reportError(ExitStatus::stopped, error.what());
  }
  if (std::fflush(stdout) != 0 && status == ExitStatus::done) {
    status = reportError(ExitStatus::stopped, "standard output cannot be written");
  }
  return static_cast<int>(status);
}
