#include "verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <utility>

#include "kit/method_rotation.h"
#include "kit/text.h"

namespace dermis::cli {

samples::OutputCase divisionOutput(const samples::Division& division) {
  samples::OutputCase output;
  output.layout.tangents = VertexFormat::float32x4;
  output.tuning = division.tuning;
  return output;
}

SceneCases sceneCases(std::vector<Figure> figures, std::vector<samples::Division> divisions,
                      std::vector<OutputToVerify> outputs, std::size_t poseCount) {
  SceneCases cases{std::move(figures), std::move(divisions), std::move(outputs), {}};
  std::vector<std::size_t> all;
  for (std::size_t figure = 0; figure < cases.figures.size(); ++figure) all.push_back(figure);
  for (std::size_t pose = 0; pose < poseCount; ++pose) {
    for (std::size_t way = 0; way < cases.divisions.size(); ++way)
      cases.batches.push_back({pose, way, all});
    const std::size_t end = cases.outputs.size() * (pose + 1) / poseCount;
    for (std::size_t index = cases.outputs.size() * pose / poseCount; index < end; ++index) {
      SceneBatch& batch = cases.batches.emplace_back();
      batch.pose = pose;
      batch.way = cases.divisions.size() + index;
      std::ranges::copy_if(all, std::back_inserter(batch.figures), [&](std::size_t figure) {
        return std::ranges::count(cases.outputs[index].methods, cases.figures[figure].method) != 0;
      });
    }
  }
  return cases;
}

namespace {

std::vector<Figure> figuresOf(const Scene& scene, std::span<const Method> methods) {
  std::vector<Figure> figures;
  for (std::size_t part = 0; part < scene.parts.size(); ++part) {
    const PreparedMesh* mesh = scene.parts[part].mesh.get();
    if (mesh == nullptr) continue;
    for (const Method method : methods) {
      if (mesh->allows(method)) figures.push_back({part, method});
    }
  }
  return figures;
}

/// The expected result of every figure.
struct ReferencePose {
  ScenePose pose;
  std::vector<reference::SkinnedMesh> figures;
  std::vector<Exemptions> exemptions;  ///< by figure
};

bool isFinite(std::span<const JointMatrix> palette) {
  for (const JointMatrix& joint : palette) {
    for (const auto& row : joint.m) {
      for (const float value : row) {
        if (!std::isfinite(value)) return false;
      }
    }
  }
  return true;
}

/// If all joints of a pose are finite, every vertex has a defined result.
Exemptions exemptionsIn(std::span<const JointMatrix> palette,
                        const reference::SkinnedMesh& skinned) {
  Exemptions exemptions = exemptionsOf(skinned);
  if (isFinite(palette)) exemptions.skipped = 0;
  return exemptions;
}

/// Positions must fit in float32. Sums in the computation of a position reach a few times its size.
Result<void> checkReach(const ScenePart& part, const PoseToVerify& pose,
                        const reference::SkinnedMesh& skinned) {
  constexpr double most = static_cast<double>(std::numeric_limits<float>::max()) / 8;
  for (const reference::VertexBounds& bounds : skinned.bounds) {
    if (bounds.undefined || !(bounds.scale > most)) continue;
    return Error{ErrorCode::invalidMesh,
                 fmt::format("{}, {}: positions reach {:.3g}, which is too large for float32",
                             part.name, pose.name, bounds.scale)};
  }
  return {};
}

Result<ReferencePose> skinReference(samples::TargetPool& pool, const Scene& scene,
                                    std::span<const Figure> figures, const PoseToVerify& pose) {
  ReferencePose skinned{scenePose(scene, pose.clip, pose.time), {}, {}};
  skinned.figures.resize(figures.size());
  skinned.exemptions.resize(figures.size());
  Result<void> done = pool.run(
      {.tasks = figures.size()}, [&](std::size_t index, samples::BatchTarget&) -> Result<void> {
        const Figure& figure = figures[index];
        const ScenePart& part = scene.parts[figure.part];
        Result<reference::SkinnedMesh> mesh =
            reference::skin(part.mesh->view(), skinned.pose.pose(part), figure.method,
                            skinned.pose.morphs[figure.part]);
        if (!mesh) return mesh.error();
        skinned.exemptions[index] = exemptionsIn(skinned.pose.pose(part), *mesh);
        skinned.figures[index] = std::move(*mesh);
        return checkReach(part, pose, skinned.figures[index]);
      });
  if (!done) return done.error();
  return skinned;
}

/// All figures of a scene in one pose, and the pose that their motion starts from.
struct PosedFigures {
  const PoseToVerify& pose;
  const std::vector<reference::SkinnedMesh>& expected;
  std::vector<samples::InstanceToVerify> instances;
  std::vector<const ScenePart*> parts;  ///< by instance

  PosedFigures(const Scene& scene, std::span<const Figure> figures, const PoseToVerify& name,
               const ReferencePose& now, const ReferencePose& before)
      : pose(name), expected(now.figures) {
    for (std::size_t index = 0; index < figures.size(); ++index) {
      const auto& [part, method] = figures[index];
      parts.push_back(&scene.parts[part]);
      instances.push_back({&parts.back()->mesh->packed(), now.pose.pose(*parts.back()),
                           before.pose.pose(*parts.back()), now.pose.morphs[part],
                           before.pose.morphs[part], method, &now.figures[index],
                           &before.figures[index], now.exemptions[index],
                           before.exemptions[index]});
    }
  }

  VerifiedCase newCase(std::size_t index, std::string variant) const {
    VerifiedCase verified;
    verified.part = parts[index]->name;
    verified.method = methodName(instances[index].method);
    verified.pose = pose.name;
    verified.variant = std::move(variant);
    return verified;
  }
};

/// The batches of one pose. Results are in the order of the batches, whichever runs first.
class PoseVerifier {
 public:
  PoseVerifier(const SceneCases& cases, const PosedFigures& pose,
               std::span<const SceneBatch> batches)
      : cases_(cases), pose_(pose), batches_(batches), outcomes_(batches.size()) {}

  Result<void> run(samples::TargetPool& pool, const std::function<void()>& done) {
    const auto isDivision = [this](const SceneBatch& batch) { return divides(batch); };
    const auto divisions = static_cast<std::size_t>(std::ranges::count_if(batches_, isDivision));
    return pool.run({.tasks = batches_.size(), .pinnedTasks = divisions, .done = done},
                    [this](std::size_t index, samples::BatchTarget& target) {
                      return divides(batches_[index]) ? divide(target, index)
                                                      : store(target, index);
                    });
  }

  Result<void> addTo(std::vector<VerifiedCase>& cases) {
    for (std::size_t index = 0; index < batches_.size(); ++index) {
      if (divides(batches_[index])) {
        if (Result<void> compared = compareDivision(index); !compared) return compared;
      }
      std::ranges::move(outcomes_[index].cases, std::back_inserter(cases));
    }
    return {};
  }

 private:
  struct Outcome {
    std::vector<samples::SkinnedVertices> divided;
    std::vector<VerifiedCase> cases;
  };
  /// The results of the first division.
  struct First {
    const samples::SkinnedVertices* skinned;
    Comparison comparison;
  };

  bool divides(const SceneBatch& batch) const { return batch.way < cases_.divisions.size(); }

  Result<void> divide(samples::BatchTarget& target, std::size_t index) {
    const SceneBatch& batch = batches_[index];
    std::vector<samples::SkinRequest> requests;
    for (const std::size_t figure : batch.figures) {
      const samples::InstanceToVerify& instance = pose_.instances[figure];
      samples::SkinRequest& request = requests.emplace_back();
      request.mesh = instance.packed;
      request.pose = instance.pose;
      request.method = instance.method;
      request.morphs = instance.morphs;
    }
    const samples::Division& division = cases_.divisions[batch.way];
    const samples::OutputCase output = divisionOutput(division);
    samples::RunOptions options;
    options.tuning = output.tuning;
    options.instructions = division.instructions;
    options.output = output.layout;
    options.countUntouched = false;
    Result<samples::BatchResult> result = target.run(requests, options);
    if (!result) return result.error();
    outcomes_[index].divided = std::move(result->instances);
    return {};
  }

  /// The result must have the same bits as that of the first division.
  Result<void> compareDivision(std::size_t index) {
    const SceneBatch& batch = batches_[index];
    Outcome& outcome = outcomes_[index];
    for (std::size_t place = 0; place < batch.figures.size(); ++place) {
      const std::size_t figure = batch.figures[place];
      const samples::SkinnedVertices& skinned = outcome.divided[place];
      VerifiedCase& verified =
          outcome.cases.emplace_back(pose_.newCase(figure, cases_.divisions[batch.way].name));
      verified.status = skinned.status;
      const auto first = firsts_.find(figure);
      if (first != firsts_.end() && first->second.skinned->streams == skinned.streams) {
        verified.comparison = first->second.comparison;
        continue;
      }
      const Result<Comparison> comparison = compareWithReference(
          pose_.expected[figure], skinned.view(), pose_.instances[figure].exemptions);
      if (!comparison) return comparison.error();
      verified.comparison = *comparison;
      if (first == firsts_.end()) {
        firsts_[figure] = {&skinned, *comparison};
      } else {
        verified.wrong =
            "the result does not have the same bits as that of " + cases_.divisions[0].name;
      }
    }
    return {};
  }

  Result<void> store(samples::BatchTarget& target, std::size_t index) {
    const SceneBatch& batch = batches_[index];
    const samples::OutputCase& output = cases_.outputs[batch.way - cases_.divisions.size()].output;
    std::vector<samples::InstanceToVerify> instances;
    std::vector<std::size_t> figures;
    for (const std::size_t figure : batch.figures) {
      // Every other box for snorm16 positions is too small, so that some positions are clamped.
      for (std::size_t copy = 0; copy < (isSnormPosition(output.layout.positions) ? 2 : 1);
           ++copy) {
        instances.push_back(pose_.instances[figure]);
        figures.push_back(figure);
      }
    }
    Result<std::vector<samples::VerifiedInstance>> verified =
        samples::verifyBatch(target, instances, output);
    if (!verified) return verified.error();
    for (std::size_t place = 0; place < verified->size(); ++place) {
      const bool clamps = isSnormPosition(output.layout.positions) && place % 2 == 1;
      VerifiedCase& added = outcomes_[index].cases.emplace_back(
          pose_.newCase(figures[place], output.name() + (clamps ? ", in a small box" : "")));
      added.comparison = (*verified)[place].comparison;
      added.status = (*verified)[place].status;
      added.wrong = std::move((*verified)[place].wrong);
    }
    return {};
  }

  const SceneCases& cases_;
  const PosedFigures& pose_;
  std::span<const SceneBatch> batches_;
  std::vector<Outcome> outcomes_;        ///< by batch
  std::map<std::size_t, First> firsts_;  ///< by figure
};

}  // namespace

std::string VerifiedCase::failure() const {
  std::string text;
  if (comparison.failures != 0 && !comparesVertices()) {
    const bool areWeights = variant == weightsVariant;
    text = fmt::format(
        "{} {} are outside their bound; the first is {} {}. Largest error divided by its bound: "
        "{:.3g} ({} {})",
        comparison.failures,
        areWeights            ? "weights"
        : method == rigMethod ? "joints"
                              : "points",
        areWeights ? "weight" : "of joint", comparison.firstFailure, comparison.worstPosition,
        areWeights ? "weight" : "joint", comparison.worstPositionVertex);
  } else if (comparison.failures != 0) {
    text = fmt::format(
        "{} vertices are outside their bound; the first is {}. Largest error divided by its bound: "
        "positions {:.3g} (vertex {}), normals {:.3g} (vertex {}), tangents {:.3g} (vertex {})",
        comparison.failures, comparison.firstFailure, comparison.worstPosition,
        comparison.worstPositionVertex, comparison.worstNormal, comparison.worstNormalVertex,
        comparison.worstTangent, comparison.worstTangentVertex);
  }
  const auto add = [&text](const std::string& what) { text += (text.empty() ? "" : "; ") + what; };
  if (comparison.exempt != comparison.expectedExempt) {
    add(
        fmt::format("{} vertices were checked only for being finite (expected {}), {} were skipped "
                    "(expected {}), {} were out of range (expected {})",
                    comparison.exempt.onlyFinite, comparison.expectedExempt.onlyFinite,
                    comparison.exempt.skipped, comparison.expectedExempt.skipped,
                    comparison.exempt.outOfRange, comparison.expectedExempt.outOfRange));
  }
  if (!wrong.empty()) add(wrong);
  if (text.empty() && !passed()) text = "no vertex could be compared";
  return text;
}

std::vector<PoseToVerify> posesToVerify(const gltf::Model& model) {
  std::vector<PoseToVerify> poses{{noIndex, 0, "rest pose"}};
  for (std::uint32_t clip = 0; clip < model.clips.size(); ++clip) {
    for (const double share : {0.0, 0.31, 0.77, 1.0}) {
      const double time = share * model.clips[clip].duration;
      poses.push_back({clip, time,
                       fmt::format("clip {} {} at {:.4g} s", clip,
                                   samples::inQuotes(model.clips[clip].name), time)});
    }
  }
  return poses;
}

namespace {

/// The outputs of a scene that a target supports. Together they combine each of its methods with
/// every format that is verified.
std::vector<OutputToVerify> outputsToVerify(const Scene& scene, const samples::BatchTarget& target,
                                            samples::Coverage coverage) {
  std::vector<MeshInfo> meshes;
  for (const ScenePart& part : scene.parts) {
    if (part.mesh != nullptr) meshes.push_back(part.mesh->packed().info());
  }
  const std::vector<samples::OutputCase> cases =
      samples::outputCases(target.limits(), coverage, meshes);
  const std::vector<std::vector<Method>> methods =
      samples::shareOutMethods(cases, target.methods());
  std::vector<OutputToVerify> outputs;
  for (std::size_t index = 0; index < cases.size(); ++index)
    outputs.push_back({cases[index], methods[index]});
  return outputs;
}

}  // namespace

SceneCases casesOf(const Scene& scene, samples::BatchTarget& target, std::size_t poseCount,
                   samples::Coverage coverage) {
  return sceneCases(figuresOf(scene, target.methods()), target.divisions(),
                    outputsToVerify(scene, target, coverage), poseCount);
}

Result<std::vector<VerifiedCase>> verifyScene(samples::TargetPool& pool, const Scene& scene,
                                              std::span<const PoseToVerify> poses,
                                              const SceneCases& cases,
                                              const std::function<void()>& done) {
  std::vector<VerifiedCase> verified;
  Result<ReferencePose> before = skinReference(pool, scene, cases.figures, poses.back());
  std::span<const SceneBatch> rest = cases.batches;
  for (std::size_t index = 0; index < poses.size(); ++index) {
    if (!before) return before.error();
    Result<ReferencePose> now = skinReference(pool, scene, cases.figures, poses[index]);
    if (!now) return now.error();
    const PosedFigures pose(scene, cases.figures, poses[index], *now, *before);
    const auto own = static_cast<std::size_t>(
        std::ranges::find_if(rest, [&](const SceneBatch& batch) { return batch.pose != index; }) -
        rest.begin());
    PoseVerifier verifier(cases, pose, rest.first(own));
    if (Result<void> ran = verifier.run(pool, done); !ran) return ran.error();
    if (Result<void> added = verifier.addTo(verified); !added) return added.error();
    rest = rest.subspan(own);
    before = std::move(now);
  }
  return verified;
}

Result<std::vector<VerifiedCase>> verifyRandomMeshes(samples::TargetPool& pool,
                                                     std::span<const samples::RandomCase> cases,
                                                     const std::function<void()>& done) {
  std::vector<std::vector<VerifiedCase>> byCase(cases.size());
  Result<void> ran =
      pool.run({.tasks = cases.size(), .done = done},
               [&](std::size_t index, samples::BatchTarget& target) -> Result<void> {
                 const samples::RandomCase& random = cases[index];
                 Result<std::vector<samples::VerifiedInstance>> verified =
                     samples::verifyRandomCase(target, random);
                 if (!verified) return verified.error();
                 for (std::size_t instance = 0; instance < verified->size(); ++instance) {
                   VerifiedCase& added = byCase[index].emplace_back();
                   added.part = random.inputName();
                   added.method = methodName(random.method);
                   added.pose = fmt::format("instance {}", instance);
                   added.variant = random.output.name();
                   added.comparison = (*verified)[instance].comparison;
                   added.status = (*verified)[instance].status;
                   added.wrong = std::move((*verified)[instance].wrong);
                 }
                 return {};
               });
  if (!ran) return ran.error();
  std::vector<VerifiedCase> all;
  for (std::vector<VerifiedCase>& added : byCase) std::ranges::move(added, std::back_inserter(all));
  return all;
}

}  // namespace dermis::cli
