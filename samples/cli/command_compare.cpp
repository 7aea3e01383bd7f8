#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "commands.h"
#include "comparison.h"
#include "comparison_picture.h"
#include "kit/batch_runner.h"
#include "kit/device.h"
#include "kit/file_name.h"
#include "kit/output_file.h"
#include "kit/program.h"
#include "kit/render/picture.h"
#include "kit/text.h"
#include "skinned_scene.h"

namespace dermis::cli {
namespace {

/// What was compared, and on which device.
struct ComparisonTitle {
  std::string device;  ///< its name, or "reference"
  std::string driver;  ///< empty for the reference
  std::string model;
  std::string pose;  ///< "rest pose", "clip 0 'walk' at 0.341 s"
};

using Json = nlohmann::ordered_json;

/// A number, or a dash if there is none.
template <typename Value>
std::string cell(const std::optional<Value>& value, fmt::format_string<const Value&> format) {
  return value ? fmt::format(format, *value) : "-";
}

std::string percent(const std::optional<double>& share) {
  return share ? fmt::format("{:.3f} %", *share * 100) : "-";
}

std::string counted(std::uint32_t count, const char* what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

/// "3 joints and 2 morph weights"
std::string drivenBy(const ComparedRigs& rigs) {
  return fmt::format("{} and {}", counted(rigs.drivenJoints, "joint"),
                     counted(rigs.drivenWeights, "morph weight"));
}

std::string_view clockName(Clock clock) {
  switch (clock) {
    case Clock::timestamps:
      return "the device's timestamps";
    case Clock::submission:
      return "from submission to the end of waiting: the device has no timestamps";
    case Clock::oneThread:
      return "one thread of the CPU";
    case Clock::none:
      break;
  }
  return "";
}

std::string_view sourceName(InstructionSource source) {
  return source == InstructionSource::driver ? "driver" : "SPIR-V";
}

void printTitle(const ComparisonTitle& title, const MethodComparison& comparison) {
  fmt::print("device   {}\n",
             samples::oneLine(title.driver.empty() ? title.device
                                                   : title.device + ", driver " + title.driver));
  fmt::print("model    {}, {}\n", samples::oneLine(title.model), samples::oneLine(title.pose));
  fmt::print("         {} vertices, {} joints{}\n", comparison.vertices, comparison.joints,
             comparison.scales ? ", some of which scale or shear" : "");
  if (const ComparedRigs& rigs = comparison.rigs; rigs.drivenJoints + rigs.drivenWeights != 0) {
    fmt::print("rig      drives {}\n", drivenBy(rigs));
    if (rigs.secondsPerPose) {
      fmt::print("         a pose takes {:.2f} µs on one thread of the CPU\n",
                 *rigs.secondsPerPose * 1e6);
    }
  }
  if (comparison.clock == Clock::none) {
    fmt::print("timed    nothing: the reference is not optimized for speed\n");
    return;
  }
  fmt::print("timed    {} instances, {} vertices per run, positions and normals as float32\n",
             comparison.instances, comparison.instances * comparison.vertices);
  fmt::print("         medians of {} runs; methods take turns; {}\n", comparison.repetitions,
             clockName(comparison.clock));
  fmt::print("         linear takes {:.3f} ms\n",
             comparison.methods.front().seconds.value_or(0) * 1e3);
}

void printExplanation(const MethodComparison& comparison) {
  const bool byDriver = comparison.instructionSource == InstructionSource::driver;
  fmt::print(
      "\n"
      "time          relative to linear; smaller is faster\n"
      "instructions  of the skin kernel; loop bodies are counted once; {}\n"
      "joint bytes   that the skin kernel reads for each joint of a palette\n"
      "twist         a tube of two joints, twisted by {}°: smallest radius, and volume of the\n"
      "              blend zone, relative to bind pose\n"
      "bend          the tube, bent by {}°: smallest cross-section area and volume, relative to\n"
      "              bind pose\n"
      "reach         largest distance of a vertex of the bent tube from the bones, in tube\n"
      "              radii; 1 means no bulge\n"
      "difference    from dual_quaternion, on the model in this pose: largest and rms distance,\n"
      "              in % of the diagonal of the model's box\n\n",
      byDriver ? "machine instructions, counted by the driver"
               : "SPIR-V that computes or accesses memory",
      tubeTwistDegrees, tubeBendDegrees);
}

void printTable(const MethodComparison& comparison) {
  fmt::print("{:25} {:>6} {:>12} {:>6} {:>15} {:>22} {:>21}\n", "", "", "instructions", "joint",
             "twist", "bend", "difference");
  fmt::print("{:25} {:>6} {:>12} {:>6} {:>7} {:>7} {:>8} {:>7} {:>5} {:>11} {:>9}\n", "method",
             "time", fmt::format("({})", sourceName(comparison.instructionSource)), "bytes",
             "radius", "volume", "section", "volume", "reach", "largest", "rms");
  for (const ComparedMethod& compared : comparison.methods) {
    const TubeShape &twisted = compared.tube.twisted, &bent = compared.tube.bent;
    fmt::print(
        "{:25} {:>6} {:>12} {:>6} {:>7.3f} {:>7.3f} {:>8.3f} {:>7.3f} {:>5.2f} {:>11} {:>9}\n",
        methodName(compared.method), cell(compared.time, "{:.2f}"),
        cell(compared.instructions, "{}"), compared.bytesPerJoint, twisted.leastRadius,
        twisted.volume, bent.leastSection, bent.volume, bent.reach,
        percent(compared.largestDifference), percent(compared.rootMeanSquareDifference));
  }
  const CurvedComparison& curved = comparison.curved;
  const TubeShape &twisted = curved.tube.twisted, &bent = curved.tube.bent;
  fmt::print("{:25} {:>6} {:>12} {:>6} {:>7.3f} {:>7.3f} {:>8.3f} {:>7.3f} {:>5.2f} {:>11} {:>9}\n",
             "curved", "-", "-", 32, twisted.leastRadius, twisted.volume, bent.leastSection,
             bent.volume, bent.reach, "-", "-");
  if (!curved.secondsPerPose) return;
  fmt::print(
      "\ncurved is dual_quaternion on the tube bound to a chain of {} segments. On one thread of\n"
      "the CPU its joints take {:.0f} ns a pose, and skinning {:.2f} ns a vertex; without the "
      "chain\n"
      "{:.2f}\n",
      tubeSegments, *curved.secondsPerPose * 1e9, *curved.secondsPerVertex * 1e9,
      *curved.secondsPerStraight * 1e9);
}

template <typename Value>
Json optionalNumber(const std::optional<Value>& value) {
  return value ? Json(*value) : Json();
}

void describe(const TubeComparison& tube, Json& json) {
  const TubeShape &twisted = tube.twisted, &bent = tube.bent;
  json["twist"] = {
      {"degrees", tubeTwistDegrees}, {"radius", twisted.leastRadius}, {"volume", twisted.volume}};
  json["bend"] = {{"degrees", tubeBendDegrees},
                  {"section", bent.leastSection},
                  {"volume", bent.volume},
                  {"reach", bent.reach}};
}

Json describe(const ComparedMethod& compared) {
  Json json;
  json["method"] = methodName(compared.method);
  json["time"] = optionalNumber(compared.time);
  json["seconds"] = optionalNumber(compared.seconds);
  json["instructions"] = optionalNumber(compared.instructions);
  json["bytesPerJoint"] = compared.bytesPerJoint;
  describe(compared.tube, json);
  json["difference"] = {{"largest", optionalNumber(compared.largestDifference)},
                        {"rootMeanSquare", optionalNumber(compared.rootMeanSquareDifference)}};
  return json;
}

/// Prints lines that explain the comparison, and a table.
void printComparison(const ComparisonTitle& title, const MethodComparison& comparison) {
  printTitle(title, comparison);
  printExplanation(comparison);
  printTable(comparison);
}

/// Fails with `ioError`.
Result<void> writeJsonComparison(const std::filesystem::path& path, const ComparisonTitle& title,
                                 const MethodComparison& comparison) {
  Json json;
  json["device"] = title.device;
  json["driver"] = title.driver;
  json["model"] = title.model;
  json["pose"] = title.pose;
  json["vertices"] = comparison.vertices;
  json["joints"] = comparison.joints;
  json["scales"] = comparison.scales;
  json["instances"] = comparison.instances;
  json["repetitions"] = comparison.repetitions;
  json["clock"] = comparison.clock == Clock::timestamps   ? Json("timestamps")
                  : comparison.clock == Clock::submission ? Json("submission")
                  : comparison.clock == Clock::oneThread  ? Json("oneThread")
                                                          : Json();
  json["instructionsOf"] = sourceName(comparison.instructionSource);
  json["methods"] = Json::array();
  for (const ComparedMethod& compared : comparison.methods)
    json["methods"].push_back(describe(compared));
  const ComparedRigs& rigs = comparison.rigs;
  json["rigs"] = {{"drivenJoints", rigs.drivenJoints},
                  {"drivenWeights", rigs.drivenWeights},
                  {"secondsPerPose", optionalNumber(rigs.secondsPerPose)}};
  const CurvedComparison& curved = comparison.curved;
  Json& ofCurved = json["curved"];
  ofCurved["segments"] = tubeSegments;
  describe(curved.tube, ofCurved);
  ofCurved["secondsPerPose"] = optionalNumber(curved.secondsPerPose);
  ofCurved["secondsPerVertex"] = optionalNumber(curved.secondsPerVertex);
  ofCurved["secondsPerVertexWithoutChain"] = optionalNumber(curved.secondsPerStraight);
  // Names come from a file: invalid UTF-8 in them is replaced.
  const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  return samples::writeFile(path, text);
}

/// The subject: a model in a pose, or the built-in arm.
struct ComparisonSubject {
  std::optional<BuiltInScenes> builtIn;  ///< if a picture is drawn, unless the model has a rig
  std::optional<Scene> model;            ///< empty: the built-in arm
  std::optional<Scene> withoutRig;       ///< the model, if it has one and a picture is drawn
  std::string name;                      ///< of the model, as requested
  std::string poseName;                  ///< "rest pose", "clip 0 'walk' at 0.341 s"
  ScenePose pose, poseWithoutRig;

  const Scene& scene() const { return model ? *model : builtIn->arm; }
};

/// The methods that are compared by default. With all nine, the pictures would be too small.
constexpr std::array usualMethods{Method::linear,         Method::quaternionTranslation,
                                  Method::logMatrix,      Method::sphericalBlend,
                                  Method::dualQuaternion, Method::centerOfRotation};

/// Formats with three digits and no exponent.
std::string nanoseconds(double value) {
  return fmt::format("{:.{}f} ns per vertex", value, value < 10 ? 2 : value < 100 ? 1 : 0);
}

std::vector<std::string> costOf(const MethodComparison& comparison, Method method) {
  const auto compared = std::ranges::find(comparison.methods, method, &ComparedMethod::method);
  if (compared == comparison.methods.end() || !compared->time) return {};
  const double vertices =
      static_cast<double>(comparison.vertices) * static_cast<double>(comparison.instances);
  return {fmt::format("{:.2f} × linear's time", *compared->time),
          nanoseconds(*compared->seconds / vertices * 1e9)};
}

bool allows(const ComparisonSubject& subject, Method method) {
  return allows(subject.scene(), method) &&
         (!subject.withoutRig || allows(*subject.withoutRig, method));
}

/// The default columns of a picture: those of the usual methods that the subject allows.
std::vector<Method> usualColumns(const ComparisonSubject& subject) {
  std::vector<Method> columns;
  std::ranges::copy_if(usualMethods, std::back_inserter(columns),
                       [&subject](Method method) { return allows(subject, method); });
  return columns;
}

ComparisonStrip stripOf(const ComparisonSubject& subject, const Scene& scene,
                        const ScenePose& pose) {
  ComparisonStrip strip;
  strip.scene = &scene;
  strip.pose = pose;
  strip.title = samples::oneLine(std::filesystem::path(subject.name).filename().string());
  strip.remark = samples::oneLine(subject.poseName);
  return strip;
}

/// Describes the picture of a subject: built-in scenes first, then the model with the cost of
/// skinning it, and the heat map; or a model without and with its rig. Refers to the subject.
ComparisonSheet describeSheet(const ComparisonSubject& subject, const std::vector<Method>& columns,
                              const ComparisonTitle& title, const MethodComparison& comparison) {
  ComparisonSheet sheet;
  for (const Method method : columns) sheet.columns.push_back({method, costOf(comparison, method)});
  if (subject.withoutRig) {
    sheet.strips = {stripOf(subject, *subject.withoutRig, subject.poseWithoutRig),
                    stripOf(subject, *subject.model, subject.pose)};
    sheet.strips[0].title += " without its rig";
    sheet.strips[1].title += " with its rig";
    sheet.strips[1].remark = "drives " + drivenBy(comparison.rigs);
    if (const auto& seconds = comparison.rigs.secondsPerPose)
      sheet.strips[1].remark += fmt::format("; {:.2f} µs per pose", *seconds * 1e6);
  } else {
    sheet.strips = builtInStrips(*subject.builtIn);
    if (subject.model) sheet.strips.push_back(stripOf(subject, *subject.model, subject.pose));
    sheet.strips.back().remark += "; skinning time";
    sheet.strips.back().hasHeatMap = true;
  }
  sheet.strips.back().showsCost = true;
  sheet.footer = samples::oneLine(fmt::format(
      "Time: median of {}, {} of {} vertices, {}", counted(comparison.repetitions, "run"),
      counted(comparison.instances, "instance"), comparison.vertices, title.device));
  return sheet;
}

constexpr std::uint32_t mostRepetitions = 10'000;
constexpr std::uint32_t leastWidth = 480, largestWidth = 4096;
/// Narrower columns have no space for the names of the methods.
constexpr std::uint32_t leastColumnWidth = 110;

struct CompareOptions {
  std::string model;  ///< empty: the built-in arm
  std::string output;
  std::vector<std::string> methods;
  std::uint32_t width = 1800;
  std::vector<std::string> clips;
  std::string rig;
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
  if (options.model.empty() &&
      (options.animation || options.time != 0 || !options.clips.empty() || !options.rig.empty()))
    return reportWrongUsage("--clips, --rig, --animation and --time need a MODEL");
  if (options.output.empty()) return ExitStatus::done;
  if (samples::render::pictureKind(options.output) != samples::render::PictureKind::png)
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
  if (clip == noIndex) return "rest pose";
  const std::string& name = model.clips[clip].name;
  return fmt::format("clip {}{} at {:.3f} s", clip,
                     name.empty() ? "" : " " + samples::inQuotes(name),
                     std::clamp(time, 0.0, model.clips[clip].duration));
}

MeshPreparation preparationFor(const CompareOptions& options) {
  MeshPreparation preparation;
  preparation.strict = options.strict;
  preparation.clips = options.clips;
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
  MeshPreparation preparation = preparationFor(options);
  preparation.rig = options.rig;
  Result<Scene> scene = loadScene(samples::pathOf(options.model), preparation);
  if (!scene) return reportModelError(scene.error());
  for (const std::string& warning : scene->warnings) reportWarning(warning);
  for (const std::string& note : scene->notes) reportNote(note);
  if (std::ranges::none_of(scene->parts,
                           [](const ScenePart& part) { return part.mesh != nullptr; })) {
    return reportError(
        ExitStatus::badInput,
        fmt::format("{} has no skinned mesh with joints and weights in its scene", options.model));
  }
  const Result<std::uint32_t> clip = chooseClip(*scene, options.animation);
  if (!clip) return reportWrongUsage(clip.error().message);
  if (!scene->rigs.empty() && !options.output.empty()) {
    preparation.rig = "none";
    Result<Scene> without = loadScene(samples::pathOf(options.model), preparation);
    if (!without) return reportModelError(without.error());
    subject.poseWithoutRig = scenePose(*without, *clip, options.time);
    subject.withoutRig.emplace(std::move(*without));
  }
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
  if (options.output.empty() || subject.withoutRig) return ExitStatus::done;
  Result<BuiltInScenes> builtIn = loadBuiltInScenes(preparationFor(options));
  if (!builtIn) return reportModelError(builtIn.error());
  subject.builtIn.emplace(std::move(*builtIn));
  if (subject.model) return ExitStatus::done;
  const Scene& arm = subject.builtIn->arm;
  subject.name = "the built-in arm";
  subject.poseName = poseName(*arm.model, 0, middleOfClip(arm));
  subject.pose = scenePose(arm, 0, middleOfClip(arm));
  return ExitStatus::done;
}

/// The methods for the columns of the picture, in order.
Result<std::vector<Method>> chooseColumns(const CompareOptions& options,
                                          const ComparisonSubject& subject) {
  std::vector<Method> columns;
  for (const std::string& name : options.methods) {
    columns.push_back(*methodFromName(name));
    if (allows(subject, columns.back())) continue;
    return Error{
        ErrorCode::invalidArgument,
        fmt::format("{}: {} needs centers of rotation, which would take too long to compute",
                    options.model, name)};
  }
  return columns.empty() ? usualColumns(subject) : columns;
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
  if (const ExitStatus kept = checkInput(options.model, outputs, options.clips, options.rig);
      kept != ExitStatus::done)
    return kept;
  ComparisonSubject subject;
  if (const ExitStatus loaded = loadSubject(options, subject); loaded != ExitStatus::done)
    return loaded;
  if (const ExitStatus kept = checkSideFiles(*subject.scene().model, outputs);
      kept != ExitStatus::done) {
    return kept;
  }
  const Result<std::vector<Method>> columns = chooseColumns(options, subject);
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
      "difference, or a model without and with its rig: OUT.png");
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
  addClipFiles(*command, options->clips);
  addRigFile(*command, options->rig);
  command->add_option("--animation", options->animation, animationHelp);
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
