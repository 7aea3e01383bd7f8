#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>

#include "commands.h"
#include "dermis/verify.h"
#include "kit/file_name.h"
#include "kit/text.h"
#include "skinned_scene.h"

namespace dermis::cli {
namespace {

struct DiagnoseOptions {
  std::string model;
  std::vector<std::string> clips;
  std::optional<std::string> pose;
  std::optional<std::string> animation;
  std::optional<double> time;
  bool strict = false;
};

/// The numbers of a line. Fails with `invalidData` if it has anything else.
Result<std::vector<float>> numbersIn(std::string_view line) {
  constexpr std::string_view blank = " \t\r,";
  std::vector<float> numbers;
  line = line.substr(0, line.find('#'));
  for (std::size_t begin = line.find_first_not_of(blank); begin != std::string_view::npos;
       begin = line.find_first_not_of(blank, begin)) {
    const std::size_t end = std::min(line.find_first_of(blank, begin), line.size());
    const std::string word(line.substr(begin, end - begin));
    char* last = nullptr;
    numbers.push_back(std::strtof(word.c_str(), &last));
    if (last != word.c_str() + word.size())
      return Error{ErrorCode::invalidData,
                   fmt::format("{} is not a number", samples::inQuotes(word))};
    begin = end;
  }
  return numbers;
}

/// Fails with `ioError` or `invalidData`.
Result<std::vector<JointMatrix>> readPose(const std::string& name) {
  std::ifstream file(samples::pathOf(name));
  if (!file)
    return Error{ErrorCode::ioError, fmt::format("{} cannot be read", samples::inQuotes(name))};
  std::vector<JointMatrix> pose;
  std::string line;
  for (std::size_t number = 1; std::getline(file, line); ++number) {
    const auto fault = [&](const std::string& what) {
      return Error{ErrorCode::invalidData,
                   fmt::format("{}, line {}: {}", samples::inQuotes(name), number, what)};
    };
    const Result<std::vector<float>> numbers = numbersIn(line);
    if (!numbers) return fault(numbers.error().message);
    if (numbers->empty()) continue;
    if (numbers->size() != 12) {
      return fault(fmt::format("a joint matrix has 12 numbers, row by row; this line has {}",
                               numbers->size()));
    }
    if (pose.size() == maxPoseJoints) return fault("there are too many joints");
    JointMatrix& matrix = pose.emplace_back();
    for (std::size_t i = 0; i < 12; ++i) matrix.m[i / 4][i % 4] = (*numbers)[i];
  }
  return pose;
}

glm::dmat4 matrixOf(const Transform& rows) {
  glm::dmat4 matrix(1);
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column)
      matrix[static_cast<int>(column)][static_cast<int>(row)] = rows[row][column];
  }
  return matrix;
}

/// The transforms of all nodes relative to their parents.
std::vector<JointMatrix> localTransforms(const gltf::Model& model, std::uint32_t clip,
                                         double time) {
  const std::vector<Transform> globals = gltf::nodeGlobals(model, clip, time);
  std::vector<JointMatrix> locals;
  for (std::size_t node = 0; node < globals.size(); ++node) {
    glm::dmat4 local = matrixOf(globals[node]);
    if (const std::uint32_t parent = model.nodes[node].parent; parent != noIndex) {
      const glm::dmat4 above = matrixOf(globals[parent]);
      // Below a scale of 0 any transform gives the same.
      local = glm::determinant(above) != 0 ? glm::inverse(above) * local : glm::dmat4(1);
    }
    locals.push_back(toJointMatrix(glm::mat4(local)));
  }
  return locals;
}

/// What a model says of its skeletons.
struct ModelSkeleton {
  std::vector<std::uint32_t> parents;  ///< by node
  std::vector<JointMatrix> locals;     ///< by node; empty if not known
};

Result<Diagnosis> diagnosePart(const Scene& scene, const ScenePart& part,
                               const ModelSkeleton& skeleton, std::span<const JointMatrix> pose) {
  const gltf::Skin& skin = scene.model->skins[part.source.skin];
  std::vector<std::string_view> names;
  for (const std::uint32_t joint : skin.joints) names.push_back(scene.model->nodes[joint].name);
  PoseInput input;
  input.jointMatrices = pose;
  input.triangles = part.primitive->triangles.values();
  input.inverseBindMatrices = skin.inverseBindMatrices;
  input.jointNames = names;
  input.jointNodes = skin.joints;
  input.parents = skeleton.parents;
  input.localTransforms = skeleton.locals;
  return diagnose(part.mesh->view(), input);
}

void print(const ScenePart& part, const Diagnosis& diagnosis) {
  fmt::print("{}  {}: {}\n", diagnosis.plausible() ? "plausible" : "WRONG",
             samples::oneLine(part.name),
             diagnosis.plausible() ? fmt::format("mean stretch {:.3f}", diagnosis.stretch)
                                   : diagnosis.message);
  for (const auto& [mistake, what] : diagnosis.notTested) fmt::print("  not tested: {}\n", what);
}

ExitStatus run(const DiagnoseOptions& options) {
  if (options.time && !std::isfinite(*options.time))
    return reportWrongUsage("--time must be a number of seconds");
  const Result<Scene> scene =
      loadScene(samples::pathOf(options.model),
                {.strict = options.strict, .clips = options.clips, .rig = "none"});
  if (!scene) return reportModelError(scene.error());
  const Result<std::uint32_t> clip = chooseClip(*scene, options.animation);
  if (!clip) return reportWrongUsage(clip.error().message);
  std::vector<JointMatrix> given;
  if (options.pose) {
    Result<std::vector<JointMatrix>> read = readPose(*options.pose);
    if (!read) return reportError(ExitStatus::badInput, read.error().message);
    given = std::move(*read);
  }
  const double time = options.time.value_or(0);
  const ScenePose own = scenePose(*scene, *clip, time);
  ModelSkeleton skeleton;
  for (const gltf::Node& node : scene->model->nodes) skeleton.parents.push_back(node.parent);
  // A pose of a file is at an unknown time, unless the user names it.
  if (!options.pose || options.animation || options.time)
    skeleton.locals = localTransforms(*scene->model, *clip, time);

  std::size_t diagnosed = 0, wrong = 0;
  for (const ScenePart& part : scene->parts) {
    if (part.mesh == nullptr) continue;
    const std::vector<JointMatrix>& pose = options.pose ? given : own.pose(part);
    if (pose.size() != scene->model->skins[part.source.skin].joints.size()) continue;
    const Result<Diagnosis> diagnosis = diagnosePart(*scene, part, skeleton, pose);
    if (!diagnosis) return reportError(ExitStatus::badInput, diagnosis.error().message);
    print(part, *diagnosis);
    ++diagnosed;
    if (!diagnosis->plausible()) ++wrong;
  }
  if (diagnosed != 0) return wrong == 0 ? ExitStatus::done : ExitStatus::verificationFailed;
  if (!options.pose) {
    return reportError(ExitStatus::badInput,
                       fmt::format("{} has no skinned mesh in its scene", options.model));
  }
  return reportError(ExitStatus::badInput,
                     fmt::format("{} has {} joint matrices; no skin of {} has as many joints",
                                 samples::inQuotes(*options.pose), given.size(), options.model));
}

}  // namespace

Run addDiagnose(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "diagnose", "Find out whether a pose is plausible, and which mistake makes it wrong");
  const auto options = std::make_shared<DiagnoseOptions>();
  command->add_option("MODEL", options->model, "A .gltf or .glb file")->required();
  command->add_option("--pose", options->pose,
                      "A text file of joint matrices: 12 numbers, row by row, on a line for each "
                      "joint; # begins a comment [the model's own pose]");
  addClipFiles(*command, options->clips);
  command->add_option("--animation", options->animation, animationHelp);
  command->add_option("--time", options->time, "Seconds into the clip, clamped to its length [0]");
  command->add_flag("--strict", options->strict, strictHelp);
  return [options] { return run(*options); };
}

}  // namespace dermis::cli
