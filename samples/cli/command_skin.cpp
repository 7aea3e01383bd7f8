#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "commands.h"
#include "dermis/mesh.h"
#include "kit/device.h"
#include "kit/file_name.h"
#include "kit/program.h"
#include "mesh_output.h"
#include "method_options.h"
#include "scene_skinner.h"
#include "skinned_scene.h"

namespace dermis::cli {
namespace {

struct SkinOptions {
  std::string model;
  std::string output;
  std::vector<std::string> clips;
  std::string rig;
  std::optional<std::string> animation;
  double time = 0;
  std::optional<std::uint32_t> frames;
  double framesPerSecond = 30;
  std::string method = std::string(methodName(Method::dualQuaternion));
  MethodShares shares;
  std::string device = "auto";
  bool strict = false;
};

OutputMesh assemble(const Scene& scene, std::vector<SkinnedPart> skinned) {
  OutputMesh mesh;
  mesh.materials = scene.model->materials;
  for (std::size_t index = 0; index < scene.parts.size(); ++index) {
    const ScenePart& from = scene.parts[index];
    OutputPart& part = mesh.parts.emplace_back();
    part.name = partName(*scene.model, from.source);
    part.primitive = from.primitive;
    part.positions = std::move(skinned[index].positions);
    part.normals = std::move(skinned[index].normals);
    if (!part.normals.empty()) {
      part.tangents = std::move(skinned[index].tangents);
    } else {
      // glTF 2.0, 3.7.2.1: if there are no normals, tangents are ignored and both are computed.
      MeshView posed;
      posed.vertexCount = static_cast<std::uint32_t>(part.positions.size() / 3);
      posed.positions = attributeView(part.positions.data(), posed.vertexCount, 3);
      part.normals = samples::must(smoothNormals(posed, from.primitive->triangles));
    }
  }
  return mesh;
}

ExitStatus checkUsage(const SkinOptions& options) {
  if (!outputFormat(options.output)) {
    return reportWrongUsage(
        fmt::format("-o OUT must end in .ply, .obj or .glb; it is '{}'", options.output));
  }
  if (!methodFromName(options.method)) {
    return reportWrongUsage(fmt::format("--method: there is no method '{}'; the methods are {}",
                                        options.method, methodNames("and")));
  }
  if (options.device == "cpu" && isForComparison(*methodFromName(options.method))) {
    return reportWrongUsage(fmt::format(
        "--method {} is for comparison; --device cpu does not have it, --device reference "
        "and Vulkan devices do",
        options.method));
  }
  if (const ExitStatus shares = checkShares(options.shares); shares != ExitStatus::done)
    return shares;
  if (!std::isfinite(options.time)) return reportWrongUsage("--time must be a number of seconds");
  if (!(options.framesPerSecond > 0) || !std::isfinite(options.framesPerSecond)) {
    return reportWrongUsage("--fps must be a number above 0");
  }
  if (samples::hasWrongPattern(options.output)) {
    return reportWrongUsage("-o OUT may have one placeholder for a number, from %01d to %09d");
  }
  const bool pattern = samples::frameName(options.output, 0).has_value();
  if (options.frames && *options.frames == 0)
    return reportWrongUsage("--frames must be at least 1");
  if (options.frames && !pattern) {
    return reportWrongUsage(
        "--frames needs a placeholder for the number in -o OUT, such as pose%04d.ply");
  }
  if (!options.frames && pattern) {
    return reportWrongUsage("-o OUT has a placeholder for a number, so --frames is required");
  }
  return ExitStatus::done;
}

ExitStatus writePoses(const SkinOptions& options, const Scene& scene, std::uint32_t clip,
                      const SkinParts& skinParts) {
  const OutputFormat format = *outputFormat(options.output);
  const std::uint32_t count = options.frames.value_or(1);
  samples::Progress progress("skinning", count);
  for (std::uint32_t frame = 0; frame < count; ++frame) {
    const double time = options.time + frame / options.framesPerSecond;
    Result<std::vector<SkinnedPart>> skinned = skinParts(scenePose(scene, clip, time));
    if (!skinned) return reportDeviceError(skinned.error());
    const OutputMesh mesh = assemble(scene, std::move(*skinned));
    if (const std::size_t bad = countNonFinite(mesh); bad != 0) {
      const std::string message = fmt::format(
          "{} vertices at {:.4g} s are not finite, because a joint matrix or a vertex of the file "
          "is not finite",
          bad, time);
      if (!holdsNonFinite(format))
        return reportError(ExitStatus::badInput, message + "; only a .ply can hold them");
      reportWarning(message);
    }
    const std::string name = samples::frameName(options.output, frame).value_or(options.output);
    if (Result<void> written = writeMesh(samples::pathOf(name), format, mesh); !written) {
      return reportError(ExitStatus::stopped, written.error().message);
    }
    progress.step();
  }
  return ExitStatus::done;
}

ExitStatus skin(const SkinOptions& options) {
  if (const ExitStatus usage = checkUsage(options); usage != ExitStatus::done) return usage;
  const samples::RequestedOutput output{"-o", options.output, options.frames.value_or(1)};
  if (const ExitStatus kept = checkInput(options.model, {&output, 1}, options.clips, options.rig);
      kept != ExitStatus::done)
    return kept;
  const Method method = *methodFromName(options.method);
  MeshPreparation preparation;
  preparation.strict = options.strict;
  preparation.clips = options.clips;
  preparation.rig = options.rig;
  preparation.centersOfRotation = needsCentersOfRotation(method);
  preparation.mostCenterTerms = mostCenterTermsAsked;
  preparation.dualQuaternionWeight = static_cast<float>(options.shares.dualQuaternionWeight);
  preparation.bulgeStrength = static_cast<float>(options.shares.bulgeStrength);
  const Result<Scene> scene = loadScene(samples::pathOf(options.model), preparation);
  if (!scene) return reportModelError(scene.error());
  if (const ExitStatus kept = checkSideFiles(*scene->model, {&output, 1}); kept != ExitStatus::done)
    return kept;
  for (const std::string& warning : scene->warnings) reportWarning(warning);
  for (const std::string& remark : scene->remarks) reportNote(remark);
  for (const std::string& note : scene->notes) reportNote(note);
  if (scene->parts.empty()) {
    return reportError(ExitStatus::badInput,
                       fmt::format("{} has no skinned mesh in its scene", options.model));
  }
  if (!allows(*scene, method)) {
    return reportError(
        ExitStatus::badInput,
        fmt::format("{}: {} needs centers of rotation, which would take too long to compute",
                    options.model, options.method));
  }
  const Result<std::uint32_t> clip = chooseClip(*scene, options.animation);
  if (!clip) return reportWrongUsage(clip.error().message);

  if (options.device == "reference")
    return writePoses(options, *scene, *clip, referenceSkinner(*scene, method));
  const bool tangents = holdsTangents(*outputFormat(options.output));
  if (options.device == "cpu") {
    samples::CpuTarget target;
    return writePoses(options, *scene, *clip, targetSkinner(*scene, method, tangents, target));
  }
  samples::DeviceOptions deviceOptions;
  deviceOptions.device = options.device;
  Result<samples::OpenDevice> open = samples::openDevice(deviceOptions);
  if (!open) return reportDeviceError(open.error());
  samples::VulkanTarget target(*open->device, open->context);
  return writePoses(options, *scene, *clip, targetSkinner(*scene, method, tangents, target));
}

}  // namespace

Run addSkin(CLI::App& app) {
  CLI::App* command = app.add_subcommand("skin", "Skin a model and write one pose, or many");
  const auto options = std::make_shared<SkinOptions>();
  command->add_option("MODEL", options->model, "A .gltf or .glb file")->required();
  command
      ->add_option("-o,--output", options->output,
                   "The file to write: .ply, .obj or .glb; with --frames, a name with %04d in it")
      ->required();
  addClipFiles(*command, options->clips);
  addRigFile(*command, options->rig);
  command->add_option("--animation", options->animation, animationHelp);
  command->add_option("--time", options->time, "Seconds into the clip, clamped to its length [0]");
  CLI::Option* frames =
      command->add_option("--frames", options->frames, "Number of poses to write, from --time on");
  command->add_option("--fps", options->framesPerSecond, "Poses per second [30]")->needs(frames);
  command->add_option("--method", options->method, methodNames("or") + " [dual_quaternion]");
  addShares(*command, options->shares);
  command->add_option(
      "--device", options->device,
      "auto, cpu (SIMD on the CPU), reference (slow, in double precision), a number "
      "from 'dermis devices', or part of a name");
  command->add_flag("--strict", options->strict, strictHelp);
  return [options] { return skin(*options); };
}

}  // namespace dermis::cli
