// All models of the test data that are not broken on purpose: they load, and what they hold is
// sound.
#include <algorithm>
#include <fstream>

#include "gltf_builder.h"
#include "model_files.h"
#include "test_data.h"

namespace dermis::test {
namespace {

void checkPrimitive(const gltf::Primitive& primitive) {
  const std::size_t vertices = primitive.vertexCount;
  EXPECT_EQ(primitive.positions.size(), 3 * vertices);
  EXPECT_TRUE(primitive.normals.empty() || primitive.normals.size() == 3 * vertices);
  EXPECT_TRUE(primitive.tangents.empty() || primitive.tangents.size() == 4 * vertices);
  for (const gltf::Influences& set : primitive.influences) {
    EXPECT_EQ(set.joints.size(), 4 * vertices * componentSize(set.jointType));
    EXPECT_EQ(set.weights.size(), 4 * vertices * componentSize(set.weightType));
  }
  EXPECT_EQ(primitive.triangles.size() % 3, 0u);
  EXPECT_TRUE(std::all_of(primitive.triangles.begin(), primitive.triangles.end(),
                          [&](std::uint32_t index) { return index < vertices; }));
}

TEST(GltfModels, AllLoad) {
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  const auto files = modelFiles(*data);
  EXPECT_GT(files.size(), 40u);
  for (const auto& file : files) {
    SCOPED_TRACE(file.string());
    const gltf::Model model = loaded(gltf::load(file));
    EXPECT_EQ(model.nodeOrder.size(), model.nodes.size());
    for (const gltf::SkinnedPrimitive& skinned : model.skinnedPrimitives) {
      checkPrimitive(model.meshes.at(skinned.mesh).primitives.at(skinned.primitive));
      EXPECT_LT(skinned.skin, model.skins.size());
    }
    for (std::uint32_t clip = 0; clip < model.clips.size(); ++clip) {
      const auto globals = nodeGlobals(model, clip, model.clips[clip].duration / 3);
      for (std::uint32_t skin = 0; skin < model.skins.size(); ++skin) {
        EXPECT_EQ(gltf::pose(model, skin, globals).size(), model.skins[skin].joints.size());
      }
      for (std::uint32_t node = 0; node < model.nodes.size(); ++node) {
        const std::uint32_t mesh = model.nodes[node].mesh;
        EXPECT_EQ(morphWeights(model, node, clip, model.clips[clip].duration / 3).size(),
                  mesh == noIndex ? 0u : model.meshes.at(mesh).morphTargetCount);
      }
    }
  }
}

// The binary and the text form of one model are the same model.
TEST(GltfModels, FormsAgree) {
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  const std::vector<std::pair<std::string, std::string>> pairs = {
      {"Fox/glTF/Fox.gltf", "Fox/glTF-Binary/Fox.glb"},
      {"RiggedSimple/glTF/RiggedSimple.gltf", "RiggedSimple/glTF-Binary/RiggedSimple.glb"},
      {"SimpleSkin/glTF/SimpleSkin.gltf", "SimpleSkin/glTF-Embedded/SimpleSkin.gltf"}};
  for (const auto& [first, second] : pairs) {
    SCOPED_TRACE(first);
    const gltf::Model a = loaded(gltf::load(*data / "models" / first));
    const gltf::Model b = loaded(gltf::load(*data / "models" / second));
    EXPECT_EQ(firstPrimitive(a).positions, firstPrimitive(b).positions);
    EXPECT_EQ(onlySet(firstPrimitive(a)).joints, onlySet(firstPrimitive(b)).joints);
    EXPECT_EQ(onlySet(firstPrimitive(a)).weights, onlySet(firstPrimitive(b)).weights);
    EXPECT_EQ(a.clips.size(), b.clips.size());
  }
}

// Every model cut short: an error with a sentence, never a crash.
TEST(GltfModels, TruncationsAreRefused) {
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  for (const auto& file : modelFiles(*data)) {
    SCOPED_TRACE(file.string());
    std::ifstream stream(file, std::ios::binary);
    const std::string content{std::istreambuf_iterator<char>(stream), {}};
    const auto bytes = bytesOf(content.substr(0, content.find_last_not_of(" \n\r\t") + 1));
    for (std::size_t part = 0; part < 16; ++part) {
      const auto result =
          gltf::loadFromMemory(std::span(bytes).first(bytes.size() * part / 16), {});
      ASSERT_FALSE(result.ok());
      EXPECT_EQ(result.error().code, ErrorCode::invalidData) << result.error().message;
    }
  }
}

}  // namespace
}  // namespace dermis::test
