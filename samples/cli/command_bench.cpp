#include <fmt/format.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "byte_model.h"
#include "commands.h"
#include "kit/batch_runner.h"
#include "kit/bench/start_up.h"
#include "kit/driver_version.h"
#include "kit/file_name.h"
#include "kit/open_device.h"
#include "kit/output_file.h"
#include "kit/progress.h"
#include "kit/render/picture_writer.h"
#include "throughput_report.h"

namespace dermis::cli {
namespace {

constexpr std::uint32_t mostRounds = 10'000, mostInstances = 100'000;
/// Size of the built-in figure, used if there is no model.
constexpr std::uint32_t figureVertices = 10'000;

struct BenchOptions {
  std::string model;
  std::string output;
  std::string json;
  std::string device = "auto";
  std::uint32_t instances = 1000;
  std::uint32_t rounds = 10;
  bool onPaper = false;
};

ExitStatus checkUsage(const BenchOptions& options) {
  if (options.rounds == 0 || options.rounds > mostRounds)
    return reportWrongUsage(fmt::format("--rounds must be from 1 to {}", mostRounds));
  if (options.instances == 0 || options.instances > mostInstances)
    return reportWrongUsage(fmt::format("--instances must be from 1 to {}", mostInstances));
  if (options.device == "reference")
    return reportWrongUsage("--device reference cannot be timed: it is not optimized for speed");
  if (options.output.empty()) return ExitStatus::done;
  if (samples::pictureKind(options.output) != samples::PictureKind::png)
    return reportWrongUsage(fmt::format("-o OUT must end in .png; it is '{}'", options.output));
  if (samples::hasWrongPattern(options.output) || samples::frameName(options.output, 0))
    return reportWrongUsage("-o OUT has a placeholder for a number, but there is only one picture");
  return ExitStatus::done;
}

ExitStatus write(const BenchOptions& options, const ThroughputTitle& title,
                 const std::vector<samples::ThroughputRow>& rows) {
  if (!options.json.empty()) {
    if (Result<void> written = writeJsonThroughput(samples::pathOf(options.json), title, rows);
        !written)
      return reportError(ExitStatus::stopped, written.error().message);
  }
  if (options.output.empty()) return ExitStatus::done;
  Result<samples::render::Font> font = samples::render::Font::load();
  if (!font) reportNote(font.error().message + ": the picture has no text");
  const Result<std::vector<std::byte>> file =
      samples::render::encodePng(drawThroughput(title, rows, font ? &*font : nullptr));
  if (!file) return reportError(ExitStatus::stopped, file.error().message);
  if (Result<void> written = samples::writeFile(samples::pathOf(options.output), *file); !written)
    return reportError(ExitStatus::stopped, written.error().message);
  return ExitStatus::done;
}

ExitStatus bench(const BenchOptions& options) {
  if (options.onPaper) {
    return printByteModels() ? ExitStatus::done
                             : reportError(ExitStatus::stopped,
                                           "SPIRV-Tools cannot read a kernel, or the command was "
                                           "built without them");
  }
  if (const ExitStatus usage = checkUsage(options); usage != ExitStatus::done) return usage;
  const std::array<samples::RequestedOutput, 2> outputs{
      {{"-o", options.output}, {"--json", options.json}}};
  if (const ExitStatus kept = checkInput(options.model, outputs); kept != ExitStatus::done)
    return kept;
  const Result<samples::Crowd> crowd =
      options.model.empty() ? samples::longFigure(figureVertices, options.instances)
                            : samples::loadCrowd(samples::pathOf(options.model), options.instances);
  if (!crowd) return reportModelError(crowd.error());

  ThroughputTitle title;
  title.model = crowd->name;
  title.vertices = crowd->vertexCount();
  title.joints = crowd->jointCount();
  title.instances = options.instances;
  title.rounds = options.rounds;
  std::optional<samples::OpenDevice> open;
  if (!samples::needsNoVulkan(options.device)) {
    samples::DeviceOptions deviceOptions;
    deviceOptions.device = options.device;
    Result<samples::OpenDevice> opened = samples::openDevice(deviceOptions);
    if (!opened) return reportDeviceError(opened.error());
    open.emplace(std::move(*opened));
    title.device = open->device->info().name;
    title.driver = samples::driverVersion(*open->device);
  }
  samples::OpenDevice* const device = open ? &*open : nullptr;
  if (device != nullptr) {
    // Measured first, before anything is compiled.
    const Result<samples::StartUp> startUp = samples::measureStartUp(*device, *crowd);
    if (!startUp) return reportDeviceError(startUp.error());
    title.startUp = *startUp;
  }
  Result<std::unique_ptr<samples::Throughput>> throughput = [&] {
    samples::Progress progress("preparing", samples::Throughput::rowCount(device, *crowd));
    return samples::Throughput::create(device, *crowd, [&progress] { progress.step(); });
  }();
  if (!throughput) {
    return throughput.error().code == ErrorCode::invalidData
               ? reportError(ExitStatus::verificationFailed, throughput.error().message)
               : reportDeviceError(throughput.error());
  }
  {
    samples::Progress progress("rounds", options.rounds);
    for (std::uint32_t round = 0; round < options.rounds; ++round) {
      if (Result<void> done = (*throughput)->runRound(); !done)
        return reportDeviceError(done.error());
      progress.step();
    }
  }
  printThroughput(title, (*throughput)->rows());
  return write(options, title, (*throughput)->rows());
}

}  // namespace

Run addBench(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "bench",
      "Measure how many vertices per second are skinned: by method, format and number of "
      "instances, on a device and on the CPU, compared with plain kernels");
  const auto options = std::make_shared<BenchOptions>();
  command->add_option("MODEL", options->model,
                      "A .gltf or .glb file; its first skin is used [a figure of 10,000 vertices, "
                      "60 joints and four influences per vertex]");
  command->add_option("--json", options->json, "Write the results to a file as JSON");
  command->add_option("-o,--output", options->output, "Draw the results as a bar chart: OUT.png");
  command->add_option(
      "--device", options->device,
      "auto, cpu (the CPU only), a number from 'dermis devices', or part of a name");
  command->add_option(
      "--instances", options->instances,
      fmt::format("Number of instances, each with its own pose [{}]", options->instances));
  command->add_option(
      "--rounds", options->rounds,
      fmt::format("Number of rounds; each measures every row once, and the best time of a row "
                  "counts [{}]",
                  options->rounds));
  command->add_flag("--on-paper", options->onPaper,
                    "Measure nothing; estimate bytes per vertex, speed and the limiting resource "
                    "for typical GPUs");
  return [options] { return bench(*options); };
}

}  // namespace dermis::cli
