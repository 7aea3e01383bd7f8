// Poses from other programs (../shared/golden), through a bank.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "clip_rig.h"
#include "dermis/verify.h"
#include "few_cases.h"
#include "gltf_builder.h"
#include "golden_file.h"
#include "scene_meshes.h"
#include "test_data.h"

namespace dermis::test {
namespace {

using glm::dvec3;

/// The positions by linear blending, and how far off each may be.
struct BankPositions {
  std::vector<dvec3> positions;
  std::vector<double> bounds;
};

std::vector<dvec3> skinned(const MeshView& mesh, std::span<const JointMatrix> pose,
                           std::span<const MorphWeight> morphs) {
  std::vector<dvec3> positions;
  for (const auto& [x, y, z] : must(reference::skin(mesh, pose, Method::linear, morphs)).positions)
    positions.emplace_back(x, y, z);
  return positions;
}

/// Of the primitive. A primitive has the first morph targets of its mesh.
std::vector<MorphWeight> morphsOf(const gltf::Model& model, const gltf::SkinnedPrimitive& skinned,
                                  std::uint32_t clip, double time) {
  const auto& targets = model.meshes[skinned.mesh].primitives[skinned.primitive].morphTargets;
  const std::vector<float> weights = gltf::morphWeights(model, skinned.node, clip, time);
  std::vector<MorphWeight> morphs;
  for (std::uint32_t target = 0; target < std::min(weights.size(), targets.size()); ++target)
    morphs.push_back({target, weights[target]});
  return morphs;
}

void addPrimitive(const PackedRig& rig, const gltf::SkinnedPrimitive& part,
                  std::span<const ClipLayer> layers, BankPositions& result) {
  const SkeletonSkin& skin = rig.skeleton.skins[part.skin];
  const gltf::PrimitiveView view(rig.model.meshes[part.mesh].primitives[part.primitive]);
  const RepairedMesh mesh =
      must(repair(view.mesh(), static_cast<std::uint32_t>(skin.joints.size())));
  const std::vector<MorphWeight> morphs =
      layers.empty() ? morphsOf(rig.model, part, noIndex, 0)
                     : morphsOf(rig.model, part, layers[0].clip, layers[0].time);
  const std::vector<dvec3> positions = skinned(mesh.view(), rig.sample(layers, part.skin), morphs);
  result.positions.insert(result.positions.end(), positions.begin(), positions.end());

  const reference::SampledPose expected =
      must(reference::samplePose(rig.skeleton, rig.clips, {}, layers, part.skin, &*rig.bank));
  for (const reference::VertexBounds& bounds :
       must(reference::skin(mesh.view(), expected, Method::linear, morphs)).bounds)
    result.bounds.push_back(bounds.position);
}

TEST(ClipsGolden, EveryPoseAgrees) {
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  std::unique_ptr<PackedRig> rig;
  std::string loadedFile;
  std::size_t poses = 0, number = 0;
  for (const nlohmann::json& entry : goldenManifest(*data)) {
    if (number++ % (hasFewCases ? 4 : 1) != 0) continue;
    const std::string file = entry["file"].get<std::string>();
    SCOPED_TRACE(entry["golden"].get<std::string>());
    if (file != loadedFile) {
      rig = std::make_unique<PackedRig>(loaded(gltf::load(*data / "models" / file)));
      ASSERT_TRUE(rig->pack());
      loadedFile = file;
    }
    const std::string animation = entry["anim"].get<std::string>();
    std::vector<ClipLayer> layers;
    if (animation != "-") {
      layers.push_back({.clip = static_cast<std::uint32_t>(std::stoul(animation)),
                        .time = entry["time"].get<double>(),
                        .hold = true});
    }
    BankPositions bank;
    for (const gltf::SkinnedPrimitive& skinned : rig->model.skinnedPrimitives)
      addPrimitive(*rig, skinned, layers, bank);
    const Golden golden = readGolden(*data / "golden" / entry["golden"].get<std::string>());
    ASSERT_EQ(bank.positions.size(), golden.vertices());
    const double tolerance = 1e-5 * golden.size();
    for (std::size_t vertex = 0; vertex < golden.vertices(); ++vertex) {
      const dvec3 expected(golden.at(false, vertex, 0), golden.at(false, vertex, 1),
                           golden.at(false, vertex, 2));
      const double distance = glm::length(bank.positions[vertex] - expected);
      if (std::isnan(distance)) continue;  // the file's weights are
      ASSERT_LE(distance, tolerance + bank.bounds[vertex]) << "vertex " << vertex;
    }
    ++poses;
  }
  EXPECT_GE(poses, fewer(76u, 4u));
}

}  // namespace
}  // namespace dermis::test
