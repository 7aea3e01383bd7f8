#include "verification.h"

#include <fmt/format.h>

#include <bit>

namespace dermis::cli {
namespace {

struct VariantToVerify {
  Tuning tuning;
  bool normals = true;
  std::string name() const {
    return fmt::format("{} invocations, {} instances each, {}", tuning.workgroupSize,
                       tuning.instancesPerInvocation, normals ? "normals" : "positions only");
  }
};

/// The first is the one that others must equal to the bit.
const std::vector<VariantToVerify>& variantsToVerify() {
  static const std::vector<VariantToVerify> variants{
      {{}, true}, {{8, 1}, true}, {{32, 3}, true}, {{128, 16}, true}, {{}, false}};
  return variants;
}

std::uint64_t countDifferingFloats(const std::vector<float>& a, const std::vector<float>& b) {
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (std::bit_cast<std::uint32_t>(a[i]) != std::bit_cast<std::uint32_t>(b[i])) ++count;
  }
  return count;
}

AttributeView viewOf(const std::vector<float>& vectors) {
  return floatAttribute(vectors.data(), static_cast<std::uint32_t>(vectors.size() / 3), 3);
}

/// What is skinned once and compared with every variant.
struct Expected {
  const ScenePart* part;
  Method method;
  reference::SkinnedMesh skinned;
};

}  // namespace

std::string VerifiedCase::failure() const {
  if (comparison.failures != 0) {
    return fmt::format(
        "{} vertices are outside their bound, the first is {}; positions reach {:.3g} of the bound "
        "(vertex {}), normals "
        "{:.3g} (vertex {})",
        comparison.failures, comparison.firstFailure, comparison.worstPosition,
        comparison.worstPositionVertex, comparison.worstNormal, comparison.worstNormalVertex);
  }
  if (differingFloats != 0)
    return fmt::format("{} floats differ from the first variant's", differingFloats);
  return {};
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

Result<std::vector<VerifiedCase>> verifyPose(samples::Device& device, vulkan::Context& context,
                                             const Scene& scene, const PoseToVerify& pose) {
  const std::vector<std::vector<JointMatrix>> palettes = scenePalettes(scene, pose.clip, pose.time);
  std::vector<Expected> expected;
  std::vector<samples::SkinRequest> requests;
  for (const ScenePart& part : scene.parts) {
    if (part.mesh == nullptr) continue;
    const std::vector<JointMatrix>& palette = palettes[part.source.skin];
    for (const Method method : allMethods) {
      Result<reference::SkinnedMesh> skinned = reference::skin(part.mesh->view(), palette, method);
      if (!skinned) return skinned.error();
      expected.push_back({&part, method, std::move(*skinned)});
      requests.push_back({&part.mesh->packed(), palette, true, method});
    }
  }

  std::vector<VerifiedCase> cases;
  std::vector<samples::SkinnedVertices> first;
  for (const VariantToVerify& variant : variantsToVerify()) {
    samples::RunOptions options;
    options.tuning = variant.tuning;
    options.normals = variant.normals;
    Result<samples::BatchResult> result = samples::runBatch(device, context, requests, options);
    if (!result) return result.error();
    for (std::size_t index = 0; index < expected.size(); ++index) {
      const samples::SkinnedVertices& skinned = result->instances[index];
      Result<Comparison> comparison = compare(expected[index].skinned, viewOf(skinned.positions),
                                              viewOf(skinned.normals), expected[index].method);
      if (!comparison) return comparison.error();
      VerifiedCase verified{expected[index].part->name,
                            std::string(methodName(expected[index].method)),
                            pose.name,
                            variant.name(),
                            *comparison,
                            skinned.status,
                            0};
      if (!first.empty()) {
        verified.differingFloats = countDifferingFloats(skinned.positions, first[index].positions) +
                                   countDifferingFloats(skinned.normals, first[index].normals);
      }
      cases.push_back(std::move(verified));
    }
    if (first.empty()) first = std::move(result->instances);
  }
  return cases;
}

}  // namespace dermis::cli
