#include "verification.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "method_rotation.h"

namespace dermis::cli {
namespace {

/// The first is the one that others must equal to the bit.
constexpr std::array<Tuning, 4> tunings{{{64, 4}, {8, 1}, {32, 3}, {128, 16}}};

std::string name(const Tuning& tuning) {
  return fmt::format("{} invocations, {} instances each", tuning.workgroupSize,
                     tuning.instancesPerInvocation);
}

/// What is skinned together in one pose, and from which pose it moves.
struct PoseBatch {
  ScenePose now, before;
  std::vector<samples::InstanceToVerify> instances;
  std::vector<const ScenePart*> parts;  ///< of the instances
  std::vector<reference::SkinnedMesh> expected, expectedBefore;

  PoseBatch(const Scene& scene, const PoseToVerify& pose, const PoseToVerify& previous)
      : now(scenePose(scene, pose.clip, pose.time)),
        before(scenePose(scene, previous.clip, previous.time)) {
    for (std::size_t index = 0; index < scene.parts.size(); ++index) {
      const ScenePart& part = scene.parts[index];
      if (part.mesh == nullptr) continue;
      for (const Method method : allMethods) {
        if (!part.mesh->allows(method)) continue;
        instances.push_back({&part.mesh->packed(), now.palette(part), before.palette(part),
                             now.morphs[index], before.morphs[index], method, nullptr, nullptr});
        parts.push_back(&part);
      }
    }
  }
  PoseBatch(const PoseBatch&) = delete;
  PoseBatch& operator=(const PoseBatch&) = delete;

  /// What must come out, of all instances.
  Result<void> skinReference() {
    for (std::size_t index = 0; index < instances.size(); ++index) {
      const samples::InstanceToVerify& instance = instances[index];
      const MeshView mesh = parts[index]->mesh->view();
      Result<reference::SkinnedMesh> skinned =
          reference::skin(mesh, instance.palette, instance.method, instance.morphs);
      if (!skinned) return skinned.error();
      Result<reference::SkinnedMesh> skinnedBefore =
          reference::skin(mesh, instance.previousPalette, instance.method, instance.previousMorphs);
      if (!skinnedBefore) return skinnedBefore.error();
      expected.push_back(std::move(*skinned));
      expectedBefore.push_back(std::move(*skinnedBefore));
    }
    for (std::size_t index = 0; index < instances.size(); ++index) {
      instances[index].expected = &expected[index];
      instances[index].expectedBefore = &expectedBefore[index];
    }
    return {};
  }

  VerifiedCase newCase(std::size_t index, const PoseToVerify& pose, std::string variant) const {
    VerifiedCase verified;
    verified.part = parts[index]->name;
    verified.method = methodName(instances[index].method);
    verified.pose = pose.name;
    verified.variant = std::move(variant);
    return verified;
  }
};

bool hasBox(const samples::OutputCase& output) {
  return output.layout.positions == VertexFormat::snorm16x3 ||
         output.layout.positions == VertexFormat::snorm16x4;
}

/// Positions, normals and tangents as float32, with every tuning: not a bit may change.
Result<void> verifyTunings(samples::Device& device, vulkan::Context& context,
                           const PoseBatch& batch, const PoseToVerify& pose,
                           std::vector<VerifiedCase>& cases) {
  std::vector<samples::SkinRequest> requests;
  for (const samples::InstanceToVerify& instance : batch.instances) {
    samples::SkinRequest& request = requests.emplace_back();
    request.mesh = instance.packed;
    request.palette = instance.palette;
    request.method = instance.method;
    request.morphs = instance.morphs;
  }
  std::vector<samples::SkinnedVertices> first;
  for (const Tuning& tuning : tunings) {
    samples::RunOptions options;
    options.tuning = tuning;
    options.output.tangents = VertexFormat::float32x4;
    options.countUntouched = false;
    Result<samples::BatchResult> result = samples::runBatch(device, context, requests, options);
    if (!result) return result.error();
    for (std::size_t index = 0; index < requests.size(); ++index) {
      const samples::SkinnedVertices& skinned = result->instances[index];
      const Result<Comparison> comparison =
          compare(batch.expected[index], skinned.view(), requests[index].method);
      if (!comparison) return comparison.error();
      VerifiedCase verified = batch.newCase(index, pose, name(tuning));
      verified.comparison = *comparison;
      verified.status = skinned.status;
      if (!first.empty() && skinned.streams != first[index].streams)
        verified.wrong = "the result is not to the bit that of " + name(tunings[0]);
      cases.push_back(std::move(verified));
    }
    if (first.empty()) first = std::move(result->instances);
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
  if (!wrong.empty()) text += (text.empty() ? "" : "; ") + wrong;
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
           fmt::format("clip {} '{}' at {:.4g} s", clip, model.clips[clip].name, time)});
    }
  }
  return poses;
}

std::vector<OutputToVerify> outputsToVerify(const DeviceLimits& limits) {
  const std::vector<samples::OutputCase> cases = samples::outputCases(limits);
  const std::vector<std::vector<Method>> methods = samples::shareOutMethods(cases);
  std::vector<OutputToVerify> outputs;
  for (std::size_t index = 0; index < cases.size(); ++index)
    outputs.push_back({cases[index], methods[index]});
  return outputs;
}

Result<std::vector<VerifiedCase>> verifyPose(samples::Device& device, vulkan::Context& context,
                                             const Scene& scene, const PoseToVerify& pose,
                                             const PoseToVerify& before,
                                             std::span<const OutputToVerify> outputs) {
  PoseBatch batch(scene, pose, before);
  if (Result<void> done = batch.skinReference(); !done) return done.error();
  std::vector<VerifiedCase> cases;
  if (Result<void> done = verifyTunings(device, context, batch, pose, cases); !done)
    return done.error();
  for (const OutputToVerify& output : outputs) {
    std::vector<samples::InstanceToVerify> instances;
    std::vector<std::size_t> indices;
    for (std::size_t index = 0; index < batch.instances.size(); ++index) {
      if (std::ranges::count(output.methods, batch.instances[index].method) == 0) continue;
      // Every other box of positions in snorm16 is too small, so that some are clamped.
      for (std::size_t copy = 0; copy < (hasBox(output.output) ? 2 : 1); ++copy) {
        instances.push_back(batch.instances[index]);
        indices.push_back(index);
      }
    }
    Result<std::vector<samples::VerifiedInstance>> verified =
        samples::verifyBatch(device, context, instances, output.output);
    if (!verified) return verified.error();
    for (std::size_t place = 0; place < verified->size(); ++place) {
      const bool clamps = hasBox(output.output) && place % 2 == 1;
      VerifiedCase& added = cases.emplace_back(batch.newCase(
          indices[place], pose, output.output.name() + (clamps ? ", in a small box" : "")));
      added.comparison = (*verified)[place].comparison;
      added.status = (*verified)[place].status;
      added.wrong = std::move((*verified)[place].wrong);
    }
  }
  return cases;
}

Result<std::vector<VerifiedCase>> verifyRandomMeshes(samples::Device& device,
                                                     vulkan::Context& context,
                                                     std::span<const samples::RandomCase> cases,
                                                     const std::function<void()>& done) {
  std::vector<VerifiedCase> all;
  for (const samples::RandomCase& random : cases) {
    Result<std::vector<samples::VerifiedInstance>> verified =
        samples::verifyRandomCase(device, context, random);
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
