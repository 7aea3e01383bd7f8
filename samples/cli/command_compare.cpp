#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "commands.h"
#include "comparison_report.h"
#include "driver_version.h"
#include "open_device.h"
#include "progress.h"

namespace dermis::cli {
namespace {

constexpr std::uint32_t mostRepetitions = 10'000;

struct CompareOptions {
  std::string model;
  std::optional<std::string> animation;
  double time = 0;
  std::string device = "auto";
  std::string json;
  std::uint32_t repetitions = 15;
  std::optional<std::uint32_t> instances;
  MethodShares shares;
  bool strict = false;
};

ExitStatus checkUsage(const CompareOptions& options) {
  if (!std::isfinite(options.time))
    return reportError(ExitStatus::wrongUsage, "--time must be a number of seconds");
  if (options.repetitions == 0 || options.repetitions > mostRepetitions) {
    return reportError(ExitStatus::wrongUsage,
                       fmt::format("--repetitions must be from 1 to {}", mostRepetitions));
  }
  if (options.instances && *options.instances == 0)
    return reportError(ExitStatus::wrongUsage, "--instances must be at least 1");
  return checkShares(options.shares);
}

std::string poseName(const gltf::Model& model, std::uint32_t clip, double time) {
  if (clip == gltf::none) return "rest pose";
  return fmt::format("clip {} '{}' at {:.3f} s", clip, model.clips[clip].name,
                     std::clamp(time, 0.0, model.clips[clip].duration));
}

/// A scene with something to skin. What is wrong with it has been reported where there is none.
std::optional<Scene> loadSkinnedScene(const CompareOptions& options, ExitStatus& status) {
  MeshPreparation preparation;
  preparation.strict = options.strict;
  preparation.centersOfRotation = true;
  preparation.dualQuaternionWeight = static_cast<float>(options.shares.dualQuaternionWeight);
  preparation.bulgeStrength = static_cast<float>(options.shares.bulgeStrength);
  Result<Scene> scene = loadScene(options.model, preparation);
  if (!scene) {
    status = reportModelError(scene.error());
    return std::nullopt;
  }
  for (const std::string& warning : scene->warnings) reportWarning(warning);
  for (const ScenePart& part : scene->parts) {
    if (part.mesh != nullptr) return std::move(*scene);
  }
  status = reportError(
      ExitStatus::badInput,
      fmt::format("{} has no skinned mesh with joints and weights in its scene", options.model));
  return std::nullopt;
}

ExitStatus compare(const CompareOptions& options) {
  if (const ExitStatus usage = checkUsage(options); usage != ExitStatus::done) return usage;
  ExitStatus status = ExitStatus::done;
  const std::optional<Scene> scene = loadSkinnedScene(options, status);
  if (!scene) return status;
  const Result<std::uint32_t> clip = chooseClip(*scene->model, options.animation);
  if (!clip) return reportError(ExitStatus::wrongUsage, clip.error().message);

  ComparisonTitle title{
      options.device, {}, options.model, poseName(*scene->model, *clip, options.time)};
  std::optional<samples::OpenDevice> open;
  if (options.device != "cpu") {
    samples::DeviceOptions deviceOptions;
    deviceOptions.device = options.device;
    Result<samples::OpenDevice> opened = samples::openDevice(deviceOptions);
    if (!opened) return reportDeviceError(opened.error());
    open.emplace(std::move(*opened));
    title.device = open->device->info().name;
    title.driver = samples::driverVersion(*open->device);
  }

  const ComparisonOptions comparisonOptions{options.instances, options.repetitions, options.shares};
  Result<MethodComparison> comparison = [&] {
    samples::Progress progress("comparing", comparisonSteps(comparisonOptions, open.has_value()));
    return compareMethods(*scene, scenePose(*scene, *clip, options.time), open ? &*open : nullptr,
                          comparisonOptions, [&progress] { progress.step(); });
  }();
  if (!comparison) {
    return comparison.error().code == ErrorCode::invalidArgument
               ? reportError(ExitStatus::wrongUsage, comparison.error().message)
               : reportDeviceError(comparison.error());
  }
  printComparison(title, *comparison);
  if (!options.json.empty()) {
    if (Result<void> written = writeJsonComparison(options.json, title, *comparison); !written)
      return reportError(ExitStatus::stopped, written.error().message);
  }
  return ExitStatus::done;
}

}  // namespace

Run addCompare(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "compare",
      "What each method costs on the device, and what it does to a twist, a bend and a "
      "model");
  const auto options = std::make_shared<CompareOptions>();
  command->add_option("MODEL", options->model, "A .gltf or .glb file")->required();
  command->add_option("--animation", options->animation,
                      "A clip's number or name, or none for the rest pose [the first]");
  command->add_option("--time", options->time, "Seconds into the clip, clamped to it [0]");
  command->add_option("--device", options->device,
                      "auto, cpu (nothing is timed), a number of 'dermis devices', or part of a "
                      "name");
  command->add_option("--json", options->json, "Write the same numbers to a file");
  command->add_option("--repetitions", options->repetitions,
                      fmt::format("Runs of each method [{}]", options->repetitions));
  command->add_option("--instances", options->instances,
                      "How often a run skins the model [as often as makes some million vertices]");
  addShares(*command, options->shares);
  command->add_flag("--strict", options->strict, "Refuse a mesh that would have to be repaired");
  return [options] { return compare(*options); };
}

}  // namespace dermis::cli
