// The subcommands. Each function adds one to the command line, and returns the function that runs
// it.
#pragma once

#include <CLI/CLI.hpp>

#include <filesystem>
#include <functional>
#include <span>
#include <string>

#include "dermis/gltf.h"
#include "kit/file_name.h"
#include "kit/program.h"

namespace dermis::cli {

using samples::ExitStatus;
using samples::reportDeviceError;
using samples::reportError;
using samples::reportModelError;
using samples::reportNote;
using samples::reportWarning;
using samples::reportWrongUsage;

/// Reports wrong usage if an output would overwrite the model.
inline ExitStatus checkInput(const std::string& model,
                             std::span<const samples::RequestedOutput> outputs) {
  const std::filesystem::path input = samples::pathOf(model);
  const Result<void> kept = samples::checkOutputFiles(outputs, {&input, 1});
  return kept ? ExitStatus::done : reportWrongUsage(kept.error().message);
}

/// The same if it would overwrite a file that the model names.
inline ExitStatus checkSideFiles(const gltf::Model& model,
                                 std::span<const samples::RequestedOutput> outputs) {
  const Result<void> kept = samples::checkOutputFiles(outputs, model.sideFiles);
  return kept ? ExitStatus::done : reportWrongUsage(kept.error().message);
}

using Run = std::function<ExitStatus()>;

Run addBench(CLI::App& app);
Run addCompare(CLI::App& app);
Run addDevices(CLI::App& app);
Run addInfo(CLI::App& app);
Run addRender(CLI::App& app);
Run addSkin(CLI::App& app);
Run addVerify(CLI::App& app);

}  // namespace dermis::cli
