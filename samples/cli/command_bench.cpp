#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "byte_model.h"
#include "commands.h"
#include "dermis/vulkan/scene_recorder.h"
#include "kit/batch_runner.h"
#include "kit/bench/crowd.h"
#include "kit/bench/throughput.h"
#include "kit/device.h"
#include "kit/file_name.h"
#include "kit/output_file.h"
#include "kit/program.h"
#include "kit/render/picture.h"
#include "kit/text.h"
#include "picture_sheet.h"

namespace dermis::cli {
namespace {

/// Time from `Context::create` to the end of the first frame, for one instance skinned by dual
/// quaternions. Most of it is spent in the driver's compiler, unless the driver finds the pipelines
/// in its own cache.
struct StartUp {
  double seconds = 0;
  double secondsWithoutScale = 0;  ///< with `JointPromise::scaleIgnored`
  double secondsRigid = 0;         ///< with `JointPromise::rigid`
};

/// Returns seconds. The device exists already, as in an engine.
Result<double> skinFirstFrame(samples::Device& device, const samples::Crowd& crowd,
                              JointPromise promise) {
  const auto start = std::chrono::steady_clock::now();
  Result<vulkan::Context> context = vulkan::Context::create(device.description());
  if (!context) return context.error();
  Result<vulkan::SceneRecorder> recorder = vulkan::SceneRecorder::create(*context);
  if (!recorder) return recorder.error();

  const Result<MeshHandle> mesh = recorder->scene().addMesh(*crowd.mesh);
  if (!mesh) return mesh.error();
  const Result<PoseHandle> pose =
      recorder->scene().addPose(crowd.jointCount(), {.promise = promise});
  if (!pose) return pose.error();
  InstanceDescription instance;
  instance.mesh = *mesh;
  instance.pose = *pose;
  instance.layout = {.positions = VertexFormat::float32x3, .normals = VertexFormat::float32x3};
  if (Result<void> prepared = recorder->prepare(instance); !prepared) return prepared.error();
  if (const auto added = recorder->scene().addInstance(instance); !added) return added.error();
  if (Result<void> begun = recorder->scene().beginFrame(1, 0); !begun) return begun.error();
  const Result<std::span<JointMatrix>> matrices = recorder->scene().writePose(*pose);
  if (!matrices) return matrices.error();
  std::ranges::copy(crowd.poses.front(), matrices->begin());

  const Result<void> done =
      device.run([&](VkCommandBuffer commandBuffer) { return recorder->record(commandBuffer); });
  if (!done) return done.error();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Fails if the device does.
Result<StartUp> measureStartUp(samples::OpenDevice& open, const samples::Crowd& crowd) {
  const Result<double> usual = skinFirstFrame(*open.device, crowd, JointPromise::scaling);
  if (!usual) return usual.error();
  const Result<double> withoutScale =
      skinFirstFrame(*open.device, crowd, JointPromise::scaleIgnored);
  if (!withoutScale) return withoutScale.error();
  const Result<double> rigid = skinFirstFrame(*open.device, crowd, JointPromise::rigid);
  if (!rigid) return rigid.error();
  return StartUp{*usual, *withoutScale, *rigid};
}

struct ThroughputTitle {
  std::string device, driver;  ///< empty: only the CPU was measured
  std::string model;
  std::uint32_t vertices = 0, joints = 0, instances = 0, rounds = 0;
  std::optional<StartUp> startUp;  ///< of the device
};

using samples::ThroughputRow;
using samples::ThroughputSection;
using Json = nlohmann::ordered_json;

constexpr std::uint32_t pictureWidth = 1100;
constexpr float nameRoom = 430, valueRoom = 130, barHeight = 18;

constexpr std::array<std::string_view, samples::throughputSectionCount> sectionTitles{
    "Plain kernels, and one that only copies", "Methods", "Formats and extras", "Instances",
    "On the CPU, by threads"};

std::string_view titleOf(ThroughputSection section) {
  return sectionTitles[static_cast<std::size_t>(section)];
}

const ThroughputRow* find(std::span<const ThroughputRow> rows, std::string_view name) {
  const auto row = std::ranges::find(rows, name, &ThroughputRow::name);
  return row == rows.end() ? nullptr : &*row;
}

/// The baseline of a row: the plain linear kernel for linear blending, otherwise the plain dual
/// quaternion kernel.
const ThroughputRow* baselineOf(const ThroughputRow& row, std::span<const ThroughputRow> rows) {
  const bool isLinear = row.name.find("/linear") != std::string::npos;
  return find(rows, isLinear ? "gpu/plain/linear" : "gpu/plain/dual_quaternion");
}

std::string whatWasMeasured(const ThroughputTitle& title) {
  return fmt::format("{}: {} vertices, {} joints; {} instances; best of {} rounds", title.model,
                     title.vertices, title.joints, title.instances, title.rounds);
}

std::string whereItWasMeasured(const ThroughputTitle& title) {
  if (title.device.empty()) return "the CPU";
  return title.driver.empty() ? title.device : title.device + ", driver " + title.driver;
}

/// The color of the row's section.
SheetColor colorOf(ThroughputSection section) {
  constexpr std::array<SheetColor, samples::throughputSectionCount> colors{
      {{148, 156, 168}, {43, 108, 176}, {44, 139, 118}, {124, 92, 176}, {196, 116, 44}}};
  return colors[static_cast<std::size_t>(section)];
}

/// Prints a line for each row.
void printThroughput(const ThroughputTitle& title, std::span<const ThroughputRow> rows) {
  fmt::print("device   {}\n", samples::oneLine(whereItWasMeasured(title)));
  fmt::print("model    {}\n", samples::oneLine(whatWasMeasured(title)));
  if (title.startUp) {
    fmt::print(
        "start    {:.0f} ms from Context::create to the first frame, {:.0f} ms if scale is "
        "ignored, {:.0f} ms if joints are rigid\n",
        title.startUp->seconds * 1e3, title.startUp->secondsWithoutScale * 1e3,
        title.startUp->secondsRigid * 1e3);
  }
  const ThroughputRow* last = nullptr;
  for (const ThroughputRow& row : rows) {
    if (last == nullptr || last->section != row.section) {
      fmt::print("\n{:<52} {:>10} {:>16} {:>8}\n", titleOf(row.section), "instances",
                 "M vertices/s", "x plain");
    }
    const ThroughputRow* baseline = baselineOf(row, rows);
    const std::string ratio = baseline == nullptr
                                  ? "-"
                                  : fmt::format("{:.2f}", row.millionVerticesPerSecond /
                                                              baseline->millionVerticesPerSecond);
    fmt::print("{:<52} {:>10} {:>16.1f} {:>8}\n", row.name, row.instances,
               row.millionVerticesPerSecond, ratio);
    last = &row;
  }
}

/// Fails with `ioError`.
Result<void> writeJsonThroughput(const std::filesystem::path& path, const ThroughputTitle& title,
                                 std::span<const ThroughputRow> rows) {
  Json json;
  json["device"] = title.device;
  json["driver"] = title.driver;
  json["model"] = title.model;
  json["vertices"] = title.vertices;
  json["joints"] = title.joints;
  json["instances"] = title.instances;
  json["rounds"] = title.rounds;
  if (title.startUp) {
    json["start_up"] = {{"seconds", title.startUp->seconds},
                        {"seconds_without_scale", title.startUp->secondsWithoutScale},
                        {"seconds_rigid", title.startUp->secondsRigid}};
  }
  json["rows"] = Json::array();
  for (const ThroughputRow& row : rows) {
    json["rows"].push_back({{"name", row.name},
                            {"instances", row.instances},
                            {"best_seconds", row.bestSeconds},
                            {"million_vertices_per_second", row.millionVerticesPerSecond}});
  }
  return samples::writeFile(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

/// Draws a bar for each row, in sections. If `font` is null, there is no text.
samples::render::Picture drawThroughput(const ThroughputTitle& title,
                                        std::span<const ThroughputRow> rows,
                                        const samples::render::Font* font) {
  Sheet sheet(pictureWidth, 1, font);
  const Sheet::Style heading{26, sheetInk}, usual{19, sheetInk}, pale{17, sheetPaleInk};
  sheet.advance(18);
  sheet.left("Million vertices a second", heading);
  sheet.advance(34);
  for (const std::string& line : {whereItWasMeasured(title), whatWasMeasured(title)}) {
    sheet.left(line, pale);
    sheet.advance(24);
  }
  double most = 0;
  for (const ThroughputRow& row : rows) most = std::max(most, row.millionVerticesPerSecond);
  const float room = sheet.innerWidth() - nameRoom - valueRoom;
  const ThroughputRow* last = nullptr;
  for (const ThroughputRow& row : rows) {
    if (last == nullptr || last->section != row.section) {
      sheet.advance(14);
      sheet.rule();
      sheet.advance(12);
      sheet.left(titleOf(row.section), usual);
      sheet.advance(30);
    }
    sheet.left(row.name, pale, 0, nameRoom - 10);
    const float length =
        std::max(static_cast<float>(row.millionVerticesPerSecond / most) * room, 1.0f);
    const SheetColor color = colorOf(row.section);
    sheet.gradient({color, color}, nameRoom, length, barHeight);
    sheet.left(fmt::format("{:.1f}", row.millionVerticesPerSecond), pale, nameRoom + length + 10);
    sheet.advance(25);
    last = &row;
  }
  sheet.advance(16);
  return sheet.take();
}

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
  if (samples::render::pictureKind(options.output) != samples::render::PictureKind::png)
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
  if (!crowd->clips) reportNote("rows of clips are left out: " + crowd->clips.error().message);

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
    const Result<StartUp> startUp = measureStartUp(*device, *crowd);
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
