// The subcommands. Each adds itself to the command line; what it returns is the exit status of the
// program.
#pragma once

#include <CLI/CLI.hpp>

#include <functional>

#include "program/exit_status.h"

namespace dermis::cli {

using samples::ExitStatus;
using samples::reportDeviceError;
using samples::reportError;
using samples::reportModelError;
using samples::reportNote;
using samples::reportWarning;

using Run = std::function<ExitStatus()>;

Run addCompare(CLI::App& app);
Run addDevices(CLI::App& app);
Run addInfo(CLI::App& app);
Run addRender(CLI::App& app);
Run addSkin(CLI::App& app);
Run addVerify(CLI::App& app);

}  // namespace dermis::cli
