#include <fmt/format.h>

#include <array>
#include <memory>

#include "commands.h"
#include "open_device.h"
#include "progress.h"
#include "verification_report.h"

namespace dermis::cli {
namespace {

struct VerifyOptions {
  std::vector<std::string> models;
  std::string device = "auto";
  std::string json;
  std::string junit;
  bool random = false;
  bool strict = false;
};

/// Fills `verification`; what it returns is a failure of the device.
Result<void> verifyModel(samples::Device& device, vulkan::Context& context, const Scene& scene,
                         std::span<const OutputToVerify> outputs, ModelVerification& verification) {
  const std::vector<PoseToVerify> poses = posesToVerify(*scene.model);
  samples::Progress progress(verification.model, poses.size());
  Result<std::vector<VerifiedCase>> cases =
      verifyScene(device, context, scene, poses, outputs, [&progress] { progress.step(); });
  if (!cases) return cases.error();
  verification.cases = std::move(*cases);
  return {};
}

Result<ModelVerification> verifyRandom(samples::Device& device, vulkan::Context& context) {
  ModelVerification verification{"random meshes", {}, {}};
  const std::vector<samples::RandomCase> cases = samples::randomCases(context.limits());
  samples::Progress progress(verification.model, cases.size());
  Result<std::vector<VerifiedCase>> verified =
      verifyRandomMeshes(device, context, cases, [&progress] { progress.step(); });
  if (!verified) return verified.error();
  verification.cases = std::move(*verified);
  return verification;
}

/// Why there is nothing to verify in a model, or empty.
std::string nothingToVerify(const Scene& scene) {
  for (const ScenePart& part : scene.parts) {
    if (part.mesh != nullptr) return {};
  }
  return "it has no skinned mesh with joints and weights in its scene";
}

ExitStatus writeReports(const VerifyOptions& options, const std::string& device,
                        const std::vector<ModelVerification>& models) {
  if (!options.json.empty()) {
    if (Result<void> written = writeJsonReport(options.json, device, models); !written) {
      return reportError(ExitStatus::stopped, written.error().message);
    }
  }
  if (!options.junit.empty()) {
    if (Result<void> written = writeJunitReport(options.junit, models); !written) {
      return reportError(ExitStatus::stopped, written.error().message);
    }
  }
  return ExitStatus::done;
}

ExitStatus verify(const VerifyOptions& options) {
  if (options.device == "cpu") {
    return reportWrongUsage(
        "--device cpu is the reference itself, and would be compared with itself; "
        "name a Vulkan device");
  }
  const std::array<samples::RequestedOutput, 2> outputFiles{
      {{"--json", options.json}, {"--junit", options.junit}}};
  for (const std::string& model : options.models) {
    if (const ExitStatus kept = checkInput(model, outputFiles); kept != ExitStatus::done)
      return kept;
  }
  samples::DeviceOptions deviceOptions;
  deviceOptions.device = options.device;
  Result<samples::OpenDevice> open = samples::openDevice(deviceOptions);
  if (!open) return reportDeviceError(open.error());

  ExitStatus status = ExitStatus::done;
  std::vector<ModelVerification> models;
  if (options.random || options.models.empty()) {
    Result<ModelVerification> verified = verifyRandom(*open->device, open->context);
    if (!verified) return reportDeviceError(verified.error());
    if (verified->failures() != 0) status = ExitStatus::verificationFailed;
    models.push_back(std::move(*verified));
  }
  const std::vector<OutputToVerify> outputs = outputsToVerify(open->context.limits());
  MeshPreparation preparation;
  preparation.strict = options.strict;
  preparation.centersOfRotation = true;
  for (const std::string& model : options.models) {
    models.push_back({model, {}, {}});
    Result<Scene> scene = loadScene(model, preparation);
    if (!scene) models.back().error = scene.error().message;
    if (scene) {
      for (const std::string& warning : scene->warnings) reportWarning(warning);
      if (const std::string nothing = nothingToVerify(*scene); !nothing.empty()) {
        models.back().error = fmt::format("{}: {}", model, nothing);
      }
    }
    if (!models.back().error.empty()) {
      status = reportError(ExitStatus::badInput, models.back().error);
      continue;
    }
    if (Result<void> verified =
            verifyModel(*open->device, open->context, *scene, outputs, models.back());
        !verified) {
      return reportDeviceError(verified.error());
    }
    if (models.back().failures() != 0 && status == ExitStatus::done)
      status = ExitStatus::verificationFailed;
  }
  // Files first: standard output may be closed.
  const ExitStatus written = writeReports(options, open->device->info().name, models);
  fmt::print("device  {}\n", open->device->info().name);
  printReport(models);
  return written == ExitStatus::done ? status : written;
}

}  // namespace

Run addVerify(CLI::App& app) {
  CLI::App* command = app.add_subcommand("verify",
                                         "Skin on the device with every method, format and way to "
                                         "cut up the work, and compare with the reference");
  const auto options = std::make_shared<VerifyOptions>();
  command->add_option("MODEL", options->models,
                      "A .gltf or .glb file, or several; none: random meshes");
  command->add_flag("--random", options->random,
                    "Verify random meshes too: methods x inputs x outputs, by pairs");
  command->add_option("--device", options->device,
                      "auto, a number of 'dermis devices', or part of a name");
  command->add_option("--json", options->json, "Write every case with its errors");
  command->add_option("--junit", options->junit, "Write the same as JUnit XML, for CI");
  command->add_flag("--strict", options->strict, "Refuse a mesh that would have to be repaired");
  return [options] { return verify(*options); };
}

}  // namespace dermis::cli
