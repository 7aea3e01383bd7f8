// The weights of morph targets: who says them, and what lies between two keys, against numbers
// worked out by hand.
#include <limits>
#include <span>
#include <vector>

#include "dermis/clips.h"
#include "gltf_builder.h"
#include "test_data.h"

namespace dermis::test {
namespace {

using Floats = std::vector<float>;
using gltf::morphWeights;

/// The triangle with two targets.
FileBuilder morphed() {
  FileBuilder file = skinnedTriangle();
  file.primitive()["targets"] = {{{"POSITION", 0}}, {{"POSITION", 0}}};
  return file;
}

/// Its weights moved by a clip; `values` has two floats a key, or six.
FileBuilder animated(const Floats& times, const Floats& values, const char* interpolation) {
  FileBuilder file = morphed();
  const std::size_t input = file.addFloats(times, "SCALAR");
  const std::size_t output = file.addFloats(values, "SCALAR");
  file.json["animations"] = {
      {{"samplers", {{{"input", input}, {"output", output}, {"interpolation", interpolation}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}}}}}};
  return file;
}

TEST(GltfMorph, TheClipGoesBeforeTheNodeAndTheNodeBeforeTheMesh) {
  FileBuilder file = animated({0, 1}, {3, 4, 5, 6}, "STEP");
  EXPECT_EQ(morphWeights(loaded(file), 0, noIndex, 0), (Floats{0, 0}));
  file.json["meshes"][0]["weights"] = {0.25, 0.5};
  EXPECT_EQ(morphWeights(loaded(file), 0, noIndex, 0), (Floats{0.25f, 0.5f}));
  file.json["nodes"][0]["weights"] = {0, 0.125};
  const gltf::Model model = loaded(file);
  EXPECT_EQ(morphWeights(model, 0, noIndex, 0), (Floats{0, 0.125f}));
  EXPECT_EQ(morphWeights(model, 0, 7, 0), (Floats{0, 0.125f})) << "there is no such clip";
  EXPECT_EQ(morphWeights(model, 0, 0, 0), (Floats{3, 4}));
}

TEST(GltfMorph, SkeletonAndClipsHaveWeights) {
  FileBuilder file = animated({0, 1}, {3, 4, 5, 6}, "STEP");
  const auto weightsOf = [](const gltf::Model& model) {
    const std::span<const float> weights = gltf::skeleton(model).nodes[0].weights;
    return Floats(weights.begin(), weights.end());
  };
  gltf::Model model = loaded(file);
  EXPECT_EQ(weightsOf(model), (Floats{0, 0}));
  EXPECT_TRUE(gltf::skeleton(model).nodes[1].weights.empty());
  const std::vector<ClipView> clips = gltf::clips(model);
  ASSERT_EQ(clips.at(0).channels.size(), 1u);
  EXPECT_EQ(clips[0].channels[0].path, ChannelPath::weights);
  EXPECT_EQ(clips[0].channels[0].values.size(), 4u);
  file.json["meshes"][0]["weights"] = {0.25};
  model = expectNoted(file, "mesh 0: it has 1 weights for 2 morph targets");
  EXPECT_EQ(weightsOf(model), (Floats{0.25f, 0}));
  file.json["meshes"][0]["weights"] = {0.25, 0};  // the notes of one kind are joined
  file.json["nodes"][0]["weights"] = {0.5};
  model = expectNoted(file, "node 0: it has 1 weights for 2 morph targets");
  EXPECT_EQ(weightsOf(model), (Floats{0.5f, 0}));
}

TEST(GltfMorph, AClipThatMovesSomethingElseLeavesTheWeights) {
  FileBuilder file = morphed();
  file.json["meshes"][0]["weights"] = {0.25, 0.5};
  // The clip moves another node that has the same mesh, and node 0 in another way.
  file.json["nodes"].push_back({{"mesh", 0}, {"skin", 0}});
  file.json["scenes"][0]["nodes"].push_back(3);
  const std::size_t times = file.addFloats({0, 2}, "SCALAR");
  const std::size_t weights = file.addFloats({1, 2, 3, 4}, "SCALAR");
  const std::size_t places = file.addFloats({5, 5, 5, 6, 6, 6}, "VEC3");
  file.json["animations"] = {
      {{"samplers",
        {{{"input", times}, {"output", weights}}, {{"input", times}, {"output", places}}}},
       {"channels",
        {{{"sampler", 1}, {"target", {{"node", 0}, {"path", "translation"}}}},
         {{"sampler", 0}, {"target", {{"node", 3}, {"path", "weights"}}}}}}}};
  const gltf::Model model = loaded(file);
  EXPECT_EQ(morphWeights(model, 0, 0, 1), (Floats{0.25f, 0.5f}));
  EXPECT_EQ(morphWeights(model, 3, 0, 1), (Floats{2, 3}));
}

TEST(GltfMorph, InterpolatesLinearlyAndClamps) {
  const gltf::Model model = loaded(animated({1, 2, 4}, {10, -1, 20, 1, -20, 0}, "LINEAR"));
  const std::vector<std::pair<double, Floats>> expected = {
      {-5, {10, -1}},         {1, {10, -1}},
      {1.25, {12.5f, -0.5f}}, {2, {20, 1}},
      {3, {0, 0.5f}},         {4, {-20, 0}},
      {99, {-20, 0}},         {std::numeric_limits<double>::quiet_NaN(), {10, -1}}};
  for (const auto& [time, weights] : expected) {
    EXPECT_EQ(morphWeights(model, 0, 0, time), weights) << time;
  }
}

TEST(GltfMorph, Steps) {
  const gltf::Model model = loaded(animated({1, 2}, {10, 1, 20, 2}, "STEP"));
  EXPECT_EQ(morphWeights(model, 0, 0, 0), (Floats{10, 1}));
  EXPECT_EQ(morphWeights(model, 0, 0, 1.999), (Floats{10, 1}));
  EXPECT_EQ(morphWeights(model, 0, 0, 2), (Floats{20, 2}));
}

// glTF 2.0, appendix C.5, as in the test of translations: keys 1 and 3, at t = ¼ 11.9375 and at
// t = ½ 14 for the first target. In-tangents of all targets come first, then values, then
// out-tangents.
TEST(GltfMorph, InterpolatesCubicSplines) {
  const gltf::Model model =
      loaded(animated({1, 3}, {99, 0, 10, 0, 4, 0, 8, 0, 20, 1, -99, 0}, "CUBICSPLINE"));
  EXPECT_EQ(morphWeights(model, 0, 0, 0), (Floats{10, 0}));
  EXPECT_EQ(morphWeights(model, 0, 0, 1.5), (Floats{11.9375f, 0.15625f}));
  EXPECT_EQ(morphWeights(model, 0, 0, 2), (Floats{14, 0.5f}));
  EXPECT_EQ(morphWeights(model, 0, 0, 3), (Floats{20, 1}));
}

TEST(GltfMorph, ASplineThatLeavesTheRangeOfAFloatStaysFinite) {
  const gltf::Model model = loaded(
      animated({0, 4}, {0, 0, 3e38f, 0, 3e38f, -3e38f, 0, 0, 3e38f, 0, 0, 0}, "CUBICSPLINE"));
  constexpr float largest = std::numeric_limits<float>::max();
  EXPECT_EQ(morphWeights(model, 0, 0, 2), (Floats{largest, -1.5e38f}));
}

TEST(GltfMorph, ThereAreNoneWithoutTargetsOrMesh) {
  FileBuilder file = morphed();
  const gltf::Model model = loaded(file);
  EXPECT_TRUE(morphWeights(model, 1, noIndex, 0).empty()) << "a node without a mesh";
  EXPECT_TRUE(morphWeights(model, 99, noIndex, 0).empty()) << "no such node";
  EXPECT_TRUE(morphWeights(model, noIndex, 0, 0).empty());
  EXPECT_TRUE(morphWeights(loaded(skinnedTriangle()), 0, noIndex, 0).empty());
}

TEST(GltfMorph, AMeshThatIsNotDecodedHasItsWeights) {
  FileBuilder file = morphed();
  file.json["nodes"][0].erase("skin");
  const gltf::Model model = loaded(file);
  EXPECT_TRUE(model.meshes.at(0).primitives.empty());
  EXPECT_EQ(morphWeights(model, 0, noIndex, 0), (Floats{0, 0}));
}

// A cube whose two targets a clip blends between 0 and 1.
TEST(GltfMorph, ReadsARealModel) {
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  const gltf::Model model =
      loaded(gltf::load(*data / "models/AnimatedMorphCube/glTF-Quantized/AnimatedMorphCube.gltf"));
  std::uint32_t node = 0;
  while (node < model.nodes.size() && model.nodes[node].mesh == noIndex) ++node;
  ASSERT_LT(node, model.nodes.size());
  ASSERT_EQ(model.clips.size(), 1u);
  EXPECT_EQ(morphWeights(model, node, noIndex, 0), (Floats{0, 0}));
  bool moved = false;
  for (int step = 0; step <= 20; ++step) {
    const Floats weights = morphWeights(model, node, 0, model.clips[0].duration * step / 20);
    ASSERT_EQ(weights.size(), 2u);
    moved |= weights[0] > 0.5f || weights[1] > 0.5f;
    for (const float weight : weights) EXPECT_TRUE(weight >= -0.01f && weight <= 1.01f) << weight;
  }
  EXPECT_TRUE(moved);
}

}  // namespace
}  // namespace dermis::test
