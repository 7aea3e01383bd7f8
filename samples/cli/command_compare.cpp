#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "commands.h"
#include "comparison_subject.h"
#include "dermis/text.h"
#include "kit/batch_runner.h"
#include "kit/driver_version.h"
#include "kit/file_name.h"
#include "kit/open_device.h"
#include "kit/output_file.h"
#include "kit/progress.h"
#include "kit/render/picture_writer.h"

namespace dermis::cli {
namespace {

constexpr std::uint32_t mostRepetitions = 10'000;
constexpr std::uint32_t leastWidth = 480, largestWidth = 4096;
/// Narrower columns have no space for the names of the methods.
constexpr std::uint32_t leastColumnWidth = 110;

struct CompareOptions {
  std::string model;  ///< empty: the built-in arm
  std::string output;
  std::vector<std::string> methods;
  std::uint32_t width = 1800;
  std::optional<std::string> animation;
  double time = 0;
  std::string device = "auto";
  std::string json;
  std::uint32_t repetitions = 15;
  std::optional<std::uint32_t> instances;
  MethodShares shares;
  bool strict = false;
};

ExitStatus checkPicture(const CompareOptions& options) {
  if (options.model.empty() && options.output.empty())
    return reportWrongUsage("compare needs MODEL, or -o OUT.png to draw the built-in models");
  if (options.model.empty() && (options.animation || options.time != 0))
    return reportWrongUsage("--animation and --time need a MODEL");
  if (options.output.empty()) return ExitStatus::done;
  if (samples::pictureKind(options.output) != samples::PictureKind::png)
    return reportWrongUsage(fmt::format("-o OUT must end in .png; it is '{}'", options.output));
  if (samples::hasWrongPattern(options.output) || samples::frameName(options.output, 0))
    return reportWrongUsage("-o OUT has a placeholder for a number, but there is only one picture");
  if (samples::needsNoVulkan(options.device)) {
    return reportWrongUsage(fmt::format(
        "--device {} cannot draw; use a Vulkan device, such as lavapipe ('dermis devices')",
        options.device));
  }
  if (options.width < leastWidth || options.width > largestWidth)
    return reportWrongUsage(
        fmt::format("--width must be from {} to {} pixels", leastWidth, largestWidth));
  for (auto name = options.methods.begin(); name != options.methods.end(); ++name) {
    if (!methodFromName(*name))
      return reportWrongUsage(fmt::format("--methods: there is no method '{}'; the methods are {}",
                                          *name, methodNames("and")));
    if (std::find(options.methods.begin(), name, *name) != name)
      return reportWrongUsage(fmt::format("--methods names {} twice", *name));
  }
  return ExitStatus::done;
}

ExitStatus checkUsage(const CompareOptions& options) {
  if (!std::isfinite(options.time)) return reportWrongUsage("--time must be a number of seconds");
  if (options.repetitions == 0 || options.repetitions > mostRepetitions)
    return reportWrongUsage(fmt::format("--repetitions must be from 1 to {}", mostRepetitions));
  if (options.instances && *options.instances == 0)
    return reportWrongUsage("--instances must be at least 1");
  if (const ExitStatus picture = checkPicture(options); picture != ExitStatus::done) return picture;
  return checkShares(options.shares);
}

std::string poseName(const gltf::Model& model, std::uint32_t clip, double time) {
  if (clip == gltf::none) return "rest pose";
  const std::string& name = model.clips[clip].name;
  return fmt::format("clip {}{} at {:.3f} s", clip, name.empty() ? "" : " " + inQuotes(name),
                     std::clamp(time, 0.0, model.clips[clip].duration));
}

MeshPreparation preparationFor(const CompareOptions& options) {
  MeshPreparation preparation;
  preparation.strict = options.strict;
  preparation.images = !options.output.empty();
  preparation.centersOfRotation = true;
  const bool asked = std::ranges::any_of(options.methods, [](const std::string& name) {
    return needsCentersOfRotation(*methodFromName(name));
  });
  if (asked) preparation.mostCenterTerms = mostCenterTermsAsked;
  preparation.dualQuaternionWeight = static_cast<float>(options.shares.dualQuaternionWeight);
  preparation.bulgeStrength = static_cast<float>(options.shares.bulgeStrength);
  return preparation;
}

/// Loads the model. Fails if it has nothing to skin.
ExitStatus loadModel(const CompareOptions& options, ComparisonSubject& subject) {
  Result<Scene> scene = loadScene(samples::pathOf(options.model), preparationFor(options));
  if (!scene) return reportModelError(scene.error());
  for (const std::string& warning : scene->warnings) reportWarning(warning);
  if (std::ranges::none_of(scene->parts,
                           [](const ScenePart& part) { return part.mesh != nullptr; })) {
    return reportError(
        ExitStatus::badInput,
        fmt::format("{} has no skinned mesh with joints and weights in its scene", options.model));
  }
  const Result<std::uint32_t> clip = chooseClip(*scene->model, options.animation);
  if (!clip) return reportWrongUsage(clip.error().message);
  subject.name = options.model;
  subject.poseName = poseName(*scene->model, *clip, options.time);
  subject.pose = scenePose(*scene, *clip, options.time);
  subject.model.emplace(std::move(*scene));
  return ExitStatus::done;
}

ExitStatus loadSubject(const CompareOptions& options, ComparisonSubject& subject) {
  if (!options.model.empty()) {
    if (const ExitStatus loaded = loadModel(options, subject); loaded != ExitStatus::done)
      return loaded;
  }
  if (options.output.empty()) return ExitStatus::done;
  Result<BuiltInScenes> builtIn = loadBuiltInScenes(preparationFor(options));
  if (!builtIn) return reportModelError(builtIn.error());
  subject.builtIn.emplace(std::move(*builtIn));
  if (subject.model) return ExitStatus::done;
  const Scene& arm = subject.builtIn->arm;
  subject.name = "the built-in arm";
  subject.poseName = poseName(*arm.model, 0, builtInArmTime(arm));
  subject.pose = scenePose(arm, 0, builtInArmTime(arm));
  return ExitStatus::done;
}

/// The methods for the columns of the picture, in order.
Result<std::vector<Method>> chooseColumns(const CompareOptions& options, const Scene& scene) {
  std::vector<Method> columns;
  for (const std::string& name : options.methods) {
    columns.push_back(*methodFromName(name));
    if (allows(scene, columns.back())) continue;
    return Error{
        ErrorCode::invalidArgument,
        fmt::format("{}: {} needs centers of rotation, which would take too long to compute",
                    options.model, name)};
  }
  return columns.empty() ? usualColumns(scene) : columns;
}

ExitStatus writePicture(const CompareOptions& options, const ComparisonSubject& subject,
                        const std::vector<Method>& columns, const ComparisonTitle& title,
                        const MethodComparison& comparison, samples::OpenDevice& open) {
  ComparisonSheet sheet = describeSheet(subject, columns, title, comparison);
  sheet.width = options.width;
  Result<samples::render::Font> font = samples::render::Font::load();
  if (!font) reportNote(font.error().message + ": the picture has no text");
  std::vector<std::string> notes;
  const Result<samples::render::Picture> picture = [&] {
    samples::Progress progress("drawing", comparisonPictures(sheet));
    return drawComparison(open, sheet, font ? &*font : nullptr, notes,
                          [&progress] { progress.step(); });
  }();
  if (!picture) {
    return picture.error().code == ErrorCode::invalidData ? reportModelError(picture.error())
                                                          : reportDeviceError(picture.error());
  }
  for (const std::string& note : notes) reportNote(note);
  const Result<std::vector<std::byte>> file = samples::render::encodePng(*picture);
  if (!file) return reportError(ExitStatus::stopped, file.error().message);
  if (Result<void> written = samples::writeFile(samples::pathOf(options.output), *file); !written)
    return reportError(ExitStatus::stopped, written.error().message);
  return ExitStatus::done;
}

ExitStatus compare(const CompareOptions& options) {
  if (const ExitStatus usage = checkUsage(options); usage != ExitStatus::done) return usage;
  const std::array<samples::RequestedOutput, 2> outputs{
      {{"-o", options.output}, {"--json", options.json}}};
  if (const ExitStatus kept = checkInput(options.model, outputs); kept != ExitStatus::done)
    return kept;
  ComparisonSubject subject;
  if (const ExitStatus loaded = loadSubject(options, subject); loaded != ExitStatus::done)
    return loaded;
  if (const ExitStatus kept = checkSideFiles(*subject.scene().model, outputs);
      kept != ExitStatus::done) {
    return kept;
  }
  const Result<std::vector<Method>> columns = chooseColumns(options, subject.scene());
  if (!columns) return reportWrongUsage(columns.error().message);
  if (options.width < columns->size() * leastColumnWidth) {
    return reportWrongUsage(
        fmt::format("{} methods side by side need a --width of at least {} pixels", columns->size(),
                    columns->size() * leastColumnWidth));
  }

  ComparisonTitle title{options.device, {}, subject.name, subject.poseName};
  std::optional<samples::OpenDevice> open;
  if (!samples::needsNoVulkan(options.device)) {
    samples::DeviceOptions deviceOptions;
    deviceOptions.device = options.device;
    deviceOptions.graphics = !options.output.empty();
    Result<samples::OpenDevice> opened = samples::openDevice(deviceOptions);
    if (!opened) return reportDeviceError(opened.error());
    open.emplace(std::move(*opened));
    title.device = open->device->info().name;
    title.driver = samples::driverVersion(*open->device);
  }

  const ComparisonOptions comparisonOptions{options.instances, options.repetitions, options.shares};
  const ComparisonTimer timer{open ? &*open : nullptr, options.device == "cpu"};
  if (timer.isCpu) title.device = samples::CpuTarget().name();
  const Result<MethodComparison> comparison = [&] {
    samples::Progress progress("comparing", comparisonSteps(comparisonOptions, timer));
    return compareMethods(subject.scene(), subject.pose, timer, comparisonOptions,
                          [&progress] { progress.step(); });
  }();
  if (!comparison) {
    return comparison.error().code == ErrorCode::invalidArgument
               ? reportWrongUsage(comparison.error().message)
               : reportDeviceError(comparison.error());
  }
  if (!options.json.empty()) {
    if (Result<void> written =
            writeJsonComparison(samples::pathOf(options.json), title, *comparison);
        !written)
      return reportError(ExitStatus::stopped, written.error().message);
  }
  printComparison(title, *comparison);
  if (options.output.empty()) return ExitStatus::done;
  return writePicture(options, subject, *columns, title, *comparison, *open);
}

}  // namespace

Run addCompare(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "compare",
      "Time each method on the device, and show how it deforms a twisted tube, a bent tube and a "
      "model");
  const auto options = std::make_shared<CompareOptions>();
  command->add_option("MODEL", options->model, "A .gltf or .glb file [with -o: a built-in arm]");
  CLI::Option* output = command->add_option(
      "-o,--output", options->output,
      "Draw the methods side by side, with a twisted bar, a bent arm and a heat map of the "
      "difference: OUT.png");
  command
      ->add_option("--methods", options->methods,
                   "Methods for the columns of the picture, separated by commas [linear, "
                   "quaternion_translation, log_matrix, spherical_blend, dual_quaternion and, if "
                   "the model allows it, center_of_rotation]")
      ->delimiter(',')
      ->allow_extra_args(false)  // A model may follow.
      ->needs(output);
  command
      ->add_option("--width", options->width, fmt::format("Width in pixels [{}]", options->width))
      ->needs(output);
  command->add_option("--animation", options->animation,
                      "A clip's number or name, or none for the rest pose [the first]");
  command->add_option("--time", options->time, "Seconds into the clip, clamped to its length [0]");
  command->add_option("--device", options->device,
                      "auto, cpu (SIMD on one thread), reference (nothing is timed), a number from "
                      "'dermis devices', or part of a name");
  command->add_option("--json", options->json, "Write the results to a file as JSON");
  command->add_option("--repetitions", options->repetitions,
                      fmt::format("Runs of each method [{}]", options->repetitions));
  command->add_option("--instances", options->instances,
                      "Number of instances in a run [about 8 million vertices on a GPU, 1.5 "
                      "million on a CPU; fewer for small models and for models with many joints]");
  addShares(*command, options->shares);
  command->add_flag("--strict", options->strict, strictHelp);
  return [options] { return compare(*options); };
}

}  // namespace dermis::cli
