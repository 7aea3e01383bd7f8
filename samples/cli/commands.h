// The subcommands. Each function adds one to the command line, and returns the function that runs
// it.
#pragma once

#include <CLI/CLI.hpp>

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

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

/// The help text of `--animation`.
inline constexpr const char* animationHelp =
    "A clip's number, name or FILE:NAME, or none for the rest pose [the first]";

/// Adds --clips.
inline void addClipFiles(CLI::App& command, std::vector<std::string>& files) {
  command
      .add_option("--clips", files,
                  "A .gltf or .glb file whose clips are added to the model's, matched by node "
                  "name; may be repeated")
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false);  // A model may follow.
}

/// Adds --rig.
inline void addRigFile(CLI::App& command, std::string& file) {
  command.add_option("--rig", file,
                     "A JSON file with drivers of joints and morph weights, or none [dermis_rig in "
                     "the extras of the model's skins]");
}

/// Reports wrong usage if an output would overwrite the model, a file of --clips or that of --rig.
inline ExitStatus checkInput(const std::string& model,
                             std::span<const samples::RequestedOutput> outputs,
                             const std::vector<std::string>& clips = {},
                             const std::string& rig = {}) {
  std::vector<std::filesystem::path> inputs{samples::pathOf(model)};
  if (!rig.empty()) inputs.push_back(samples::pathOf(rig));
  for (const std::string& file : clips) inputs.push_back(samples::pathOf(file));
  const Result<void> kept = samples::checkOutputFiles(outputs, inputs);
  return kept ? ExitStatus::done : reportWrongUsage(kept.error().message);
}

/// The same if it would overwrite a file that one of them names.
inline ExitStatus checkSideFiles(const gltf::Model& model,
                                 std::span<const samples::RequestedOutput> outputs) {
  const Result<void> kept = samples::checkOutputFiles(outputs, model.sideFiles);
  return kept ? ExitStatus::done : reportWrongUsage(kept.error().message);
}

using Run = std::function<ExitStatus()>;

Run addBench(CLI::App& app);
Run addCompare(CLI::App& app);
Run addDevices(CLI::App& app);
Run addDiagnose(CLI::App& app);
Run addInfo(CLI::App& app);
Run addRender(CLI::App& app);
Run addSkin(CLI::App& app);
Run addVerify(CLI::App& app);

}  // namespace dermis::cli
