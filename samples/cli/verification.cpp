#include "verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "dermis/text.h"
#include "method_rotation.h"

namespace dermis::cli {
namespace {

/// A part with one of the methods that it allows.
struct Figure {
  std::size_t part;
  Method method;
};

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

/// What must come out, of every figure.
struct ReferencePose {
  ScenePose pose;
  std::vector<reference::SkinnedMesh> figures;
  std::vector<Exemptions> exemptions;  ///< of the figures
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

/// A pose whose joints are all finite leaves no vertex without an answer.
Exemptions exemptionsIn(std::span<const JointMatrix> palette,
                        const reference::SkinnedMesh& skinned) {
  Exemptions exemptions = exemptionsOf(skinned);
  if (isFinite(palette)) exemptions.skipped = 0;
  return exemptions;
}

/// Nobody can be asked to compute in float32 what it does not hold. Sums on the way to a position
/// reach a few times its size.
Result<void> checkReach(const ScenePart& part, const PoseToVerify& pose,
                        const reference::SkinnedMesh& skinned) {
  constexpr double most = static_cast<double>(std::numeric_limits<float>::max()) / 8;
  for (const reference::VertexBounds& bounds : skinned.bounds) {
    if (bounds.undefined || !(bounds.scale > most)) continue;
    return Error{ErrorCode::invalidMesh,
                 fmt::format("{}, {}: positions reach {:.3g}, which is too far for float32",
                             part.name, pose.name, bounds.scale)};
  }
  return {};
}

Result<ReferencePose> skinReference(const Scene& scene, std::span<const Figure> figures,
                                    const PoseToVerify& pose) {
  ReferencePose skinned{scenePose(scene, pose.clip, pose.time), {}, {}};
  for (const Figure& figure : figures) {
    const ScenePart& part = scene.parts[figure.part];
    Result<reference::SkinnedMesh> mesh =
        reference::skin(part.mesh->view(), skinned.pose.pose(part), figure.method,
                        skinned.pose.morphs[figure.part]);
    if (!mesh) return mesh.error();
    if (Result<void> checked = checkReach(part, pose, *mesh); !checked) return checked.error();
    skinned.exemptions.push_back(exemptionsIn(skinned.pose.pose(part), *mesh));
    skinned.figures.push_back(std::move(*mesh));
  }
  return skinned;
}

/// All figures in one pose, and from which pose they move.
struct PoseBatch {
  const PoseToVerify& pose;
  const std::vector<reference::SkinnedMesh>& expected;
  std::vector<samples::InstanceToVerify> instances;
  std::vector<const ScenePart*> parts;  ///< of the instances

  PoseBatch(const Scene& scene, std::span<const Figure> figures, const PoseToVerify& name,
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

/// Positions, normals and tangents as float32, however the work is cut up: not a bit may change.
Result<void> verifyDivisions(samples::BatchTarget& target, const PoseBatch& batch,
                             std::vector<VerifiedCase>& cases) {
  std::vector<samples::SkinRequest> requests;
  for (const samples::InstanceToVerify& instance : batch.instances) {
    samples::SkinRequest& request = requests.emplace_back();
    request.mesh = instance.packed;
    request.pose = instance.pose;
    request.method = instance.method;
    request.morphs = instance.morphs;
  }
  std::vector<samples::SkinnedVertices> first;
  std::vector<Comparison> firstComparisons;
  const std::vector<samples::Division> divisions = target.divisions();
  for (const samples::Division& division : divisions) {
    samples::RunOptions options;
    options.tuning = division.tuning;
    options.instructions = division.instructions;
    options.output.tangents = VertexFormat::float32x4;
    options.countUntouched = false;
    Result<samples::BatchResult> result = target.run(requests, options);
    if (!result) return result.error();
    for (std::size_t index = 0; index < requests.size(); ++index) {
      const samples::SkinnedVertices& skinned = result->instances[index];
      VerifiedCase verified = batch.newCase(index, division.name);
      verified.status = skinned.status;
      if (!first.empty() && skinned.streams == first[index].streams) {
        verified.comparison = firstComparisons[index];
      } else {
        const Result<Comparison> comparison = compareWithReference(
            batch.expected[index], skinned.view(), batch.instances[index].exemptions);
        if (!comparison) return comparison.error();
        verified.comparison = *comparison;
        if (!first.empty())
          verified.wrong = "the result is not to the bit that of " + divisions[0].name;
      }
      if (first.empty()) firstComparisons.push_back(verified.comparison);
      cases.push_back(std::move(verified));
    }
    if (first.empty()) first = std::move(result->instances);
  }
  return {};
}

/// One way to store the result.
Result<void> verifyOutput(samples::BatchTarget& target, const PoseBatch& batch,
                          const OutputToVerify& output, std::vector<VerifiedCase>& cases) {
  std::vector<samples::InstanceToVerify> instances;
  std::vector<std::size_t> indices;
  for (std::size_t index = 0; index < batch.instances.size(); ++index) {
    if (std::ranges::count(output.methods, batch.instances[index].method) == 0) continue;
    // Every other box of positions in snorm16 is too small, so that some are clamped.
    for (std::size_t copy = 0; copy < (isSnormPosition(output.output.layout.positions) ? 2 : 1);
         ++copy) {
      instances.push_back(batch.instances[index]);
      indices.push_back(index);
    }
  }
  Result<std::vector<samples::VerifiedInstance>> verified =
      samples::verifyBatch(target, instances, output.output);
  if (!verified) return verified.error();
  for (std::size_t place = 0; place < verified->size(); ++place) {
    const bool clamps = isSnormPosition(output.output.layout.positions) && place % 2 == 1;
    VerifiedCase& added = cases.emplace_back(
        batch.newCase(indices[place], output.output.name() + (clamps ? ", in a small box" : "")));
    added.comparison = (*verified)[place].comparison;
    added.status = (*verified)[place].status;
    added.wrong = std::move((*verified)[place].wrong);
  }
  return {};
}

}  // namespace

std::string VerifiedCase::failure() const {
  std::string text;
  if (comparison.failures != 0) {
    text = fmt::format(
        "{} vertices are outside their bound, the first is {}; positions reach {:.3g} of the bound "
        "(vertex {}), normals {:.3g} (vertex {}), tangents {:.3g} (vertex {})",
        comparison.failures, comparison.firstFailure, comparison.worstPosition,
        comparison.worstPositionVertex, comparison.worstNormal, comparison.worstNormalVertex,
        comparison.worstTangent, comparison.worstTangentVertex);
  }
  const auto add = [&text](const std::string& what) { text += (text.empty() ? "" : "; ") + what; };
  if (comparison.exempt != comparison.expectedExempt) {
    add(
        fmt::format("{} vertices were only asked to be finite, {} should be; {} were left out, {} "
                    "should be",
                    comparison.exempt.onlyFinite, comparison.expectedExempt.onlyFinite,
                    comparison.exempt.skipped, comparison.expectedExempt.skipped));
  }
  if (!wrong.empty()) add(wrong);
  if (text.empty() && !passed()) text = "no vertex could be compared";
  return text;
}

std::vector<PoseToVerify> posesToVerify(const gltf::Model& model) {
  std::vector<PoseToVerify> poses{{gltf::none, 0, "rest pose"}};
  for (std::uint32_t clip = 0; clip < model.clips.size(); ++clip) {
    for (const double share : {0.0, 0.31, 0.77, 1.0}) {
      const double time = share * model.clips[clip].duration;
      poses.push_back(
          {clip, time,
           fmt::format("clip {} {} at {:.4g} s", clip, inQuotes(model.clips[clip].name), time)});
    }
  }
  return poses;
}

std::vector<OutputToVerify> outputsToVerify(const samples::BatchTarget& target) {
  const std::vector<samples::OutputCase> cases = samples::outputCases(target.limits());
  const std::vector<std::vector<Method>> methods =
      samples::shareOutMethods(cases, target.methods());
  std::vector<OutputToVerify> outputs;
  for (std::size_t index = 0; index < cases.size(); ++index)
    outputs.push_back({cases[index], methods[index]});
  return outputs;
}

Result<std::vector<VerifiedCase>> verifyScene(samples::BatchTarget& target, const Scene& scene,
                                              std::span<const PoseToVerify> poses,
                                              std::span<const OutputToVerify> outputs,
                                              const std::function<void()>& done) {
  const std::vector<Figure> figures = figuresOf(scene, target.methods());
  std::vector<VerifiedCase> cases;
  Result<ReferencePose> before = skinReference(scene, figures, poses.back());
  for (std::size_t index = 0; index < poses.size(); ++index) {
    if (!before) return before.error();
    Result<ReferencePose> now = skinReference(scene, figures, poses[index]);
    if (!now) return now.error();
    const PoseBatch batch(scene, figures, poses[index], *now, *before);
    if (Result<void> verified = verifyDivisions(target, batch, cases); !verified)
      return verified.error();
    const std::size_t first = outputs.size() * index / poses.size();
    const std::size_t end = outputs.size() * (index + 1) / poses.size();
    for (const OutputToVerify& output : outputs.subspan(first, end - first)) {
      if (Result<void> verified = verifyOutput(target, batch, output, cases); !verified)
        return verified.error();
    }
    before = std::move(now);
    done();
  }
  return cases;
}

Result<std::vector<VerifiedCase>> verifyRandomMeshes(samples::BatchTarget& target,
                                                     std::span<const samples::RandomCase> cases,
                                                     const std::function<void()>& done) {
  std::vector<VerifiedCase> all;
  for (const samples::RandomCase& random : cases) {
    Result<std::vector<samples::VerifiedInstance>> verified =
        samples::verifyRandomCase(target, random);
    if (!verified) return verified.error();
    for (std::size_t index = 0; index < verified->size(); ++index) {
      VerifiedCase& added = all.emplace_back();
      added.part = random.inputName();
      added.method = methodName(random.method);
      added.pose = fmt::format("instance {}", index);
      added.variant = random.output.name();
      added.comparison = (*verified)[index].comparison;
      added.status = (*verified)[index].status;
      added.wrong = std::move((*verified)[index].wrong);
    }
    done();
  }
  return all;
}

}  // namespace dermis::cli
