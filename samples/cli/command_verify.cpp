#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "clip_verification.h"
#include "commands.h"
#include "kit/device.h"
#include "kit/output_file.h"
#include "kit/program.h"
#include "kit/text.h"
#include "rig_verification.h"
#include "verification.h"

namespace dermis::cli {
namespace {

struct ModelVerification {
  std::string model;
  std::string error;  ///< why the model could not be verified, or empty
  std::vector<VerifiedCase> cases;

  std::size_t failures() const;
};

using Json = nlohmann::ordered_json;

/// Converts text for XML 1.0: escapes markup, and replaces control characters and everything that
/// is not ASCII, since names come from files.
std::string xmlText(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c >= 0x20 && c < 0x7f ? c : '?';
    }
  }
  return escaped;
}

struct Summary {
  std::set<std::string> poses, variants;
  std::uint64_t vertices = 0, onlyUnitNormals = 0, onlyUnitTangents = 0;
  Exemptions exempt;
  double worstPosition = 0, worstNormal = 0, worstTangent = 0;
  std::size_t failures = 0;
};

/// Lists vertices that were not compared with a bound, if there are any.
std::string exceptions(const Summary& summary) {
  std::string text;
  if (summary.exempt.onlyFinite != 0)
    text += fmt::format(", {} only required to be finite", summary.exempt.onlyFinite);
  if (summary.exempt.skipped != 0)
    text += fmt::format(", {} skipped: a joint is not finite", summary.exempt.skipped);
  if (summary.exempt.outOfRange != 0)
    text += fmt::format(", {} outside the range of the contract", summary.exempt.outOfRange);
  if (summary.onlyUnitNormals != 0)
    text += fmt::format(", {} normals only required to have unit length", summary.onlyUnitNormals);
  if (summary.onlyUnitTangents != 0)
    text +=
        fmt::format(", {} tangents only required to have unit length", summary.onlyUnitTangents);
  return text;
}

Json describe(const VerifiedCase& verified) {
  const Comparison& comparison = verified.comparison;
  Json json;
  json["mesh"] = verified.part;
  json["method"] = verified.method;
  json["pose"] = verified.pose;
  json["variant"] = verified.variant;
  json["passed"] = verified.passed();
  if (!verified.passed()) json["failure"] = verified.failure();
  json[verified.comparesVertices()      ? "vertices"
       : verified.method == clipsMethod ? "points"
                                        : "elements"] = comparison.compared;
  json["onlyFinite"] = comparison.exempt.onlyFinite;
  json["skipped"] = comparison.exempt.skipped;
  json["outOfRange"] = comparison.exempt.outOfRange;
  json["onlyUnitNormals"] = comparison.onlyUnitNormals;
  json["onlyUnitTangents"] = comparison.onlyUnitTangents;
  json["failures"] = comparison.failures;
  json["worstPositionOfBound"] = comparison.worstPosition;
  json["worstNormalOfBound"] = comparison.worstNormal;
  json["largestPositionError"] = comparison.largestPositionError;
  json["worstTangentOfBound"] = comparison.worstTangent;
  if (verified.status) json["nonRigidJoints"] = verified.status->nonRigidJoints;
  return json;
}

std::size_t ModelVerification::failures() const {
  return static_cast<std::size_t>(std::count_if(
      cases.begin(), cases.end(), [](const VerifiedCase& verified) { return !verified.passed(); }));
}

/// Prints a line for each model and method, then a line for each failure.
void printReport(const std::vector<ModelVerification>& models) {
  for (const ModelVerification& model : models) {
    if (!model.error.empty()) continue;  // already reported on standard error
    std::map<std::string, Summary> byMethod;
    for (const VerifiedCase& verified : model.cases) {
      Summary& summary = byMethod[verified.method];
      summary.poses.insert(verified.pose);
      summary.variants.insert(verified.variant);
      summary.vertices += verified.comparison.compared;
      summary.exempt.onlyFinite += verified.comparison.exempt.onlyFinite;
      summary.exempt.skipped += verified.comparison.exempt.skipped;
      summary.exempt.outOfRange += verified.comparison.exempt.outOfRange;
      summary.onlyUnitNormals += verified.comparison.onlyUnitNormals;
      summary.onlyUnitTangents += verified.comparison.onlyUnitTangents;
      summary.worstPosition = std::max(summary.worstPosition, verified.comparison.worstPosition);
      summary.worstNormal = std::max(summary.worstNormal, verified.comparison.worstNormal);
      summary.worstTangent = std::max(summary.worstTangent, verified.comparison.worstTangent);
      if (!verified.passed()) ++summary.failures;
    }
    for (const auto& [method, summary] : byMethod) {
      if (method == clipsMethod) {
        fmt::print(
            "{}  {}  {}: {} plays, {} points and morph weights compared{}; worst {:.2f} of "
            "its bound\n",
            summary.failures == 0 ? "passed" : "FAILED", samples::oneLine(model.model), method,
            summary.poses.size(), summary.vertices, exceptions(summary), summary.worstPosition);
        continue;
      }
      if (method == rigMethod) {
        fmt::print(
            "{}  {}  {}: {} poses, {} driven joints and morph weights compared{}; worst {:.2f} of "
            "its bound\n",
            summary.failures == 0 ? "passed" : "FAILED", samples::oneLine(model.model), method,
            summary.poses.size(), summary.vertices, exceptions(summary), summary.worstPosition);
        continue;
      }
      fmt::print(
          "{}  {}  {}: {} poses, {} variants, {} vertices compared{}; worst position {:.2f} of its "
          "bound, normal {:.2f}{}\n",
          summary.failures == 0 ? "passed" : "FAILED", samples::oneLine(model.model), method,
          summary.poses.size(), summary.variants.size(), summary.vertices, exceptions(summary),
          summary.worstPosition, summary.worstNormal,
          summary.worstTangent > 0 ? fmt::format(", tangent {:.2f}", summary.worstTangent) : "");
    }
    for (const VerifiedCase& verified : model.cases) {
      if (!verified.passed()) {
        fmt::print("  {}\n", samples::oneLine(fmt::format("{}, {}, {}, {}: {}", verified.part,
                                                          verified.method, verified.pose,
                                                          verified.variant, verified.failure())));
      }
    }
  }
}

/// Both fail with `ioError`.
Result<void> writeJsonReport(const std::filesystem::path& path, const std::string& device,
                             const std::vector<ModelVerification>& models) {
  Json json;
  json["device"] = device;
  json["passed"] = std::all_of(models.begin(), models.end(), [](const ModelVerification& model) {
    return model.error.empty() && model.failures() == 0;
  });
  json["models"] = Json::array();
  for (const ModelVerification& model : models) {
    Json entry;
    entry["model"] = model.model;
    if (!model.error.empty()) entry["error"] = model.error;
    entry["failures"] = model.failures();
    entry["cases"] = Json::array();
    for (const VerifiedCase& verified : model.cases) entry["cases"].push_back(describe(verified));
    json["models"].push_back(std::move(entry));
  }
  return samples::writeFile(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

Result<void> writeJunitReport(const std::filesystem::path& path,
                              const std::vector<ModelVerification>& models) {
  std::string suites;
  std::size_t tests = 0, failures = 0, errors = 0;
  for (const ModelVerification& model : models) {
    const std::size_t modelErrors = model.error.empty() ? 0 : 1;
    suites += fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\">\n",
                          xmlText(model.model), model.cases.size() + modelErrors, model.failures(),
                          modelErrors);
    if (modelErrors != 0) {
      suites += fmt::format(
          "    <testcase classname=\"dermis.verify\" name=\"load\"><error "
          "message=\"{}\"/></testcase>\n",
          xmlText(model.error));
    }
    for (const VerifiedCase& verified : model.cases) {
      suites += fmt::format("    <testcase classname=\"dermis.verify.{}\" name=\"{}, {}, {}\"",
                            xmlText(verified.method), xmlText(verified.part),
                            xmlText(verified.pose), xmlText(verified.variant));
      suites += verified.passed() ? std::string("/>\n")
                                  : fmt::format("><failure message=\"{}\"/></testcase>\n",
                                                xmlText(verified.failure()));
    }
    suites += "  </testsuite>\n";
    tests += model.cases.size() + modelErrors;
    failures += model.failures();
    errors += modelErrors;
  }
  return samples::writeFile(
      path,
      fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"dermis verify\" "
                  "tests=\"{}\" failures=\"{}\" errors=\"{}\">\n{}</testsuites>\n",
                  tests, failures, errors, suites));
}

struct VerifyOptions {
  std::vector<std::string> models;
  std::string rig;
  std::string device = "auto";
  std::string json;
  std::string junit;
  std::optional<std::uint32_t> threads;
  bool random = false;
  bool quick = false;
  bool strict = false;

  samples::Coverage coverage() const {
    return quick ? samples::Coverage::quick : samples::Coverage::full;
  }
};

using Cases = Result<std::vector<VerifiedCase>>;

bool isSkinned(const Scene& scene) {
  return std::ranges::any_of(scene.parts,
                             [](const ScenePart& part) { return part.mesh != nullptr; });
}

/// Verifies models. An error in one model does not affect the others.
class Verifier {
 public:
  /// `reports` must not overwrite a file of a model.
  Verifier(samples::TargetPool& pool, const VerifyOptions& options,
           std::span<const samples::RequestedOutput> reports)
      : pool_(pool), reports_(reports), coverage_(options.coverage()) {
    preparation_.strict = options.strict;
    preparation_.rig = options.rig;
    preparation_.centersOfRotation = true;
  }

  void verifyRandom() {
    const std::vector<samples::RandomCase> cases = samples::randomCases(pool_.first(), coverage_);
    samples::Progress progress("random meshes", cases.size());
    add("random meshes", verifyRandomMeshes(pool_, cases, [&progress] { progress.step(); }));
  }

  void verify(const std::string& model) {
    try {
      verifyModel(model);
    } catch (const std::bad_alloc&) {
      refuse(model, ExitStatus::stopped, fmt::format("{}: there is not enough memory", model));
    }
  }

  const std::vector<ModelVerification>& models() const { return models_; }
  /// Which report would overwrite a file of a model; empty if none would.
  const std::string& overwrites() const { return overwrites_; }
  /// The worst status of all models.
  ExitStatus status() const { return status_; }

 private:
  void verifyModel(const std::string& model) {
    const Result<Scene> scene = loadScene(samples::pathOf(model), preparation_);
    if (!scene) return refuse(model, ExitStatus::badInput, scene.error().message);
    if (const Result<void> kept = samples::checkOutputFiles(reports_, scene->model->sideFiles);
        !kept) {
      overwrites_ = kept.error().message;
      return;
    }
    for (const std::string& warning : scene->warnings) reportWarning(warning);
    if (!isSkinned(*scene)) {
      return refuse(
          model, ExitStatus::badInput,
          fmt::format("{}: its scene has no skinned mesh with joints and weights", model));
    }
    const std::vector<PoseToVerify> poses = posesToVerify(*scene->model);
    const SceneCases cases = casesOf(*scene, pool_.first(), poses.size(), coverage_);
    samples::Progress progress(model, cases.batches.size());
    Cases verified = verifyScene(pool_, *scene, poses, cases, [&progress] { progress.step(); });
    if (verified) verified = with(verifyRigs(pool_.first(), *scene, poses), std::move(*verified));
    if (verified) verified = withClips(*scene, std::move(*verified));
    add(model, std::move(verified));
  }

  static Cases with(Cases others, std::vector<VerifiedCase> cases) {
    if (!others) return others;
    std::ranges::move(*others, std::back_inserter(cases));
    return cases;
  }

  Cases withClips(const Scene& scene, std::vector<VerifiedCase> cases) {
    std::vector<std::string> warnings;
    Cases ofClips = verifyClips(pool_, scene, coverage_, warnings);
    for (const std::string& warning : warnings) reportWarning(warning);
    return with(std::move(ofClips), std::move(cases));
  }

  void add(const std::string& model, Cases cases) {
    if (!cases) {
      const Error& error = cases.error();
      return refuse(model, statusOf(error), fmt::format("{}: {}", model, error.message));
    }
    models_.push_back({model, {}, std::move(*cases)});
    if (models_.back().failures() != 0) worsen(ExitStatus::verificationFailed);
  }

  /// Bad input if a mesh or pose cannot be verified, unless the device is at fault.
  static ExitStatus statusOf(const Error& error) {
    return error.code == ErrorCode::invalidMesh || error.code == ErrorCode::invalidArgument ||
                   error.code == ErrorCode::limitExceeded
               ? ExitStatus::badInput
               : samples::deviceErrorStatus(error);
  }

  void refuse(const std::string& model, ExitStatus status, std::string why) {
    worsen(reportError(status, why));
    models_.push_back({model, std::move(why), {}});
  }

  void worsen(ExitStatus status) { status_ = std::max(status_, status); }

  samples::TargetPool& pool_;
  std::span<const samples::RequestedOutput> reports_;
  samples::Coverage coverage_;
  std::string overwrites_;
  MeshPreparation preparation_;
  std::vector<ModelVerification> models_;
  ExitStatus status_ = ExitStatus::done;
};

/// Writes each requested report, even if another one fails.
ExitStatus writeReports(const VerifyOptions& options, const std::string& device,
                        const std::vector<ModelVerification>& models) {
  ExitStatus status = ExitStatus::done;
  const auto keep = [&status](const Result<void>& written) {
    if (!written) status = reportError(ExitStatus::stopped, written.error().message);
  };
  if (!options.json.empty()) keep(writeJsonReport(samples::pathOf(options.json), device, models));
  if (!options.junit.empty()) keep(writeJunitReport(samples::pathOf(options.junit), models));
  return status;
}

/// The methods that the target does not have.
std::string missingMethods(const samples::BatchTarget& target) {
  std::string methods;
  for (const Method method : allMethods) {
    if (std::ranges::count(target.methods(), method) != 0) continue;
    methods += (methods.empty() ? "" : ", ") + std::string(methodName(method));
  }
  return methods;
}

ExitStatus verifyOn(samples::TargetPool pool, const VerifyOptions& options,
                    std::span<const samples::RequestedOutput> outputFiles) {
  Verifier verifier(pool, options, outputFiles);
  if (options.random || options.models.empty()) verifier.verifyRandom();
  for (const std::string& model : options.models) {
    verifier.verify(model);
    if (!verifier.overwrites().empty()) return reportWrongUsage(verifier.overwrites());
  }
  // Write files first: standard output may be closed.
  const samples::BatchTarget& target = pool.first();
  const ExitStatus written = writeReports(options, target.name(), verifier.models());
  fmt::print("device  {}\n", target.name());
  printReport(verifier.models());
  if (const std::string methods = missingMethods(target); !methods.empty())
    fmt::print("not verified (comparison methods need a Vulkan device): {}\n", methods);
  return written == ExitStatus::done ? verifier.status() : written;
}

/// A device and the target that skins on it.
struct DeviceWithTarget {
  explicit DeviceWithTarget(samples::OpenDevice opened)
      : open(std::move(opened)), target(*open.device, open.context) {}

  samples::OpenDevice open;
  samples::VulkanTarget target;
};

Result<std::shared_ptr<samples::BatchTarget>> openTarget(const std::string& name) {
  samples::DeviceOptions options;
  options.device = name;
  Result<samples::OpenDevice> open = samples::openDevice(options);
  if (!open) return open.error();
  const auto device = std::make_shared<DeviceWithTarget>(std::move(*open));
  return std::shared_ptr<samples::BatchTarget>(device, &device->target);
}

ExitStatus verify(const VerifyOptions& options) {
  if (options.device == "reference") {
    return reportWrongUsage(
        "--device reference would be compared with itself; use cpu or a Vulkan device");
  }
  if (options.threads == 0u) return reportWrongUsage("--threads must be at least 1");
  const std::array<samples::RequestedOutput, 2> outputFiles{
      {{"--json", options.json}, {"--junit", options.junit}}};
  std::vector<std::filesystem::path> inputs;
  for (const std::string& model : options.models) inputs.push_back(samples::pathOf(model));
  if (!options.rig.empty()) inputs.push_back(samples::pathOf(options.rig));
  if (const Result<void> kept = samples::checkOutputFiles(outputFiles, inputs); !kept)
    return reportWrongUsage(kept.error().message);
  const auto makeTarget = [&options]() -> Result<std::shared_ptr<samples::BatchTarget>> {
    if (options.device == "cpu")
      return std::shared_ptr<samples::BatchTarget>(std::make_shared<samples::CpuTarget>());
    return openTarget(options.device);
  };
  Result<std::shared_ptr<samples::BatchTarget>> first = makeTarget();
  if (!first) return reportDeviceError(first.error());
  const std::uint32_t threads =
      options.threads.value_or(std::max(std::thread::hardware_concurrency(), 1u));
  return verifyOn({std::move(*first), makeTarget, threads}, options, outputFiles);
}

}  // namespace

Run addVerify(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("verify",
                         "Skin on the device with every method, format and tuning (workgroup size, "
                         "instances per invocation), and compare with the reference");
  const auto options = std::make_shared<VerifyOptions>();
  command->add_option("MODEL", options->models, "One or more .gltf or .glb files [random meshes]");
  addRigFile(*command, options->rig);
  command->add_flag("--random", options->random,
                    "Also verify random meshes, with other input formats and unusual sizes");
  command->add_flag("--quick", options->quick,
                    "Verify a part: all methods, but fewer formats, numbers of influences and "
                    "sizes");
  command->add_option(
      "--device", options->device,
      "auto, cpu (SIMD on the CPU), a number from 'dermis devices', or part of a name");
  command->add_option("--json", options->json, "Write all cases with their errors as JSON");
  command->add_option("--junit", options->junit, "Write all cases as JUnit XML, for CI");
  command->add_option("--threads", options->threads,
                      "Number of threads, each with its own device [all cores]");
  command->add_flag("--strict", options->strict, strictHelp);
  return [options] { return verify(*options); };
}

}  // namespace dermis::cli
