#include "program.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <new>

namespace dermis::samples {

std::optional<ExitStatus> parseOptions(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {
    app.exit(success);  // --help, --version
    return ExitStatus::done;
  } catch (const CLI::ParseError& error) {
    return reportWrongUsage(error.what());
  }
  return std::nullopt;
}

int runProgram(const char* name, const std::function<ExitStatus()>& run) {
  setProgramName(name);
  ExitStatus status = ExitStatus::stopped;
  try {
    status = run();
  } catch (const std::bad_alloc&) {
    status = reportError(ExitStatus::stopped, "out of memory");
  } catch (const std::exception& error) {
    status = reportError(ExitStatus::stopped, error.what());
  }
  if (std::fflush(stdout) != 0 && status == ExitStatus::done)
    status = reportError(ExitStatus::stopped, "standard output cannot be written");
  return static_cast<int>(status);
}

}  // namespace dermis::samples
