// Normals that are computed for primitives without: glTF 2.0, 3.7.2.1.
#include <dermis/mesh.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "gltf_builder.h"

namespace dermis::test {
namespace {

using Floats = std::vector<float>;
using Indices = std::vector<std::uint32_t>;
using gltf::MissingNormals;

/// Two triangles at a right angle that share the edge 0 1, with everything that a vertex can have.
FileBuilder roof() {
  FileBuilder file = skinnedTriangle();
  file.attributes() = {
      {"POSITION", file.addFloats({0, 0, 0, 0, 1, 0, -1, 0, 0, 0, 0, -1}, "VEC3")},
      {"TANGENT", file.addFloats({0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1}, "VEC4")},
      {"TEXCOORD_0", file.addFloats({0, 0.5f, 1, 0.5f, 2, 0.5f, 3, 0.5f}, "VEC2")},
      {"COLOR_0", file.addFloats({0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3}, "VEC3")},
      {"JOINTS_0", file.add<std::uint16_t>({0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0}, "VEC4",
                                           unsignedShortType)},
      {"WEIGHTS_0",
       file.addFloats({0.5f, 0.5f, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4")}};
  const std::size_t dense = file.addFloats({1, 0, 0, 2, 0, 0, 3, 0, 0, 4, 0, 0}, "VEC3");
  const auto sparse = [&](const std::vector<std::uint8_t>& vertices, const Floats& values) {
    return file.addAccessor(
        {{"componentType", floatType},
         {"type", "VEC3"},
         {"count", 4},
         {"sparse",
          {{"count", vertices.size()},
           {"indices",
            {{"bufferView", file.addView(bytesOf(vertices))}, {"componentType", unsignedByteType}}},
           {"values", {{"bufferView", file.addView(bytesOf(values))}}}}}});
  };
  file.primitive()["targets"] = {{{"POSITION", dense}, {"NORMAL", dense}},
                                 {{"POSITION", sparse({1, 3}, {5, 0, 0, 6, 0, 0})}}};
  file.primitive()["indices"] =
      file.add<std::uint8_t>({0, 1, 2, 1, 0, 3}, "SCALAR", unsignedByteType);
  return file;
}

gltf::Model loadedWith(const FileBuilder& file, MissingNormals normals) {
  return loaded(file.load({}, {.missingNormals = normals}));
}

gltf::Primitive readWith(const FileBuilder& file, MissingNormals normals) {
  return firstPrimitive(loadedWith(file, normals));
}

TEST(GltfNormals, AreLeftOutUnlessAskedFor) {
  const gltf::Primitive primitive = firstPrimitive(loaded(roof()));
  EXPECT_TRUE(primitive.normals.empty());
  EXPECT_EQ(primitive.vertexCount, 4u);
}

TEST(GltfNormals, SmoothOnesLeaveTheVertices) {
  const gltf::Primitive before = firstPrimitive(loaded(roof()));
  const gltf::Primitive primitive = readWith(roof(), MissingNormals::smooth);
  const float half = std::sqrt(0.5f);
  const Floats expected{half, 0, half, half, 0, half, 0, 0, 1, 1, 0, 0};
  ASSERT_EQ(primitive.normals.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i)
    EXPECT_NEAR(primitive.normals[i], expected[i], 1e-6) << i;
  EXPECT_EQ(primitive.positions, before.positions);
  EXPECT_EQ(primitive.triangles, before.triangles);
  EXPECT_TRUE(primitive.tangents.empty());
  EXPECT_TRUE(primitive.morphTargets.at(0).normals.empty());
  EXPECT_EQ(primitive.morphTargets.at(0).positions, before.morphTargets.at(0).positions);
}

TEST(GltfNormals, FlatOnesRepeatTheVerticesWithAllTheyHave) {
  const gltf::Primitive primitive = readWith(roof(), MissingNormals::flat);
  EXPECT_EQ(primitive.vertexCount, 6u);
  EXPECT_EQ(primitive.triangles.values(), (Indices{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(primitive.normals.values(),
            (Floats{0, 0, 1, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 1, 0, 0}));
  EXPECT_EQ(primitive.positions.values(),
            (Floats{0, 0, 0, 0, 1, 0, -1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, -1}));
  EXPECT_EQ(primitive.texcoords.at(0).values(),
            (Floats{0, 0.5f, 1, 0.5f, 2, 0.5f, 1, 0.5f, 0, 0.5f, 3, 0.5f}));
  EXPECT_EQ(primitive.colors.values(),
            (Floats{0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 1, 0, 0, 0, 1, 3, 3, 3, 1}));
  EXPECT_TRUE(primitive.tangents.empty());
  const gltf::Influences set = onlySet(primitive);
  EXPECT_EQ(componentsOf<std::uint16_t>(set.joints),
            (std::vector<std::uint16_t>{0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0,
                                        1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}));
  EXPECT_EQ(componentsOf<float>(set.weights).at(4 * 4), 0.5f);
  ASSERT_EQ(primitive.morphTargets.size(), 2u);
  const gltf::MorphTarget& dense = primitive.morphTargets[0];
  EXPECT_EQ(dense.positions.values(),
            (Floats{1, 0, 0, 2, 0, 0, 3, 0, 0, 2, 0, 0, 1, 0, 0, 4, 0, 0}));
  EXPECT_TRUE(dense.normals.empty());
  const gltf::MorphTarget& sparse = primitive.morphTargets[1];
  EXPECT_EQ(sparse.vertices.values(), (Indices{1, 3, 5}));
  EXPECT_EQ(sparse.positions.values(), (Floats{5, 0, 0, 5, 0, 0, 6, 0, 0}));
  const gltf::PrimitiveView view(primitive);
  EXPECT_TRUE(pack(view.mesh(), 2).ok());
}

TEST(GltfNormals, OnesOfTheFileAndPointsStay) {
  FileBuilder file = roof();
  file.attributes()["NORMAL"] = Json(file.attributes()["POSITION"]);
  for (const MissingNormals kind : {MissingNormals::smooth, MissingNormals::flat}) {
    const gltf::Primitive primitive = readWith(file, kind);
    EXPECT_EQ(primitive.normals, primitive.positions);
    EXPECT_FALSE(primitive.tangents.empty());
    EXPECT_EQ(primitive.vertexCount, 4u);
  }
  file = roof();
  file.primitive()["mode"] = 0;
  EXPECT_TRUE(readWith(file, MissingNormals::flat).normals.empty());
}

TEST(GltfNormals, RigidMeshesGetThemToo) {
  FileBuilder file = roof();
  file.json["meshes"].push_back(file.json["meshes"][0]);
  Json& attributes = file.json["meshes"][1]["primitives"][0]["attributes"];
  attributes.erase("JOINTS_0");
  attributes.erase("WEIGHTS_0");
  file.json["nodes"][2]["mesh"] = 1;
  const gltf::Model model =
      loaded(file.load({}, {.rigidMeshes = true, .missingNormals = MissingNormals::flat}));
  const gltf::Primitive& primitive = model.meshes.at(1).primitives.at(0);
  EXPECT_EQ(primitive.normals.size(), 18u);
  EXPECT_EQ(onlySet(primitive).joints.size(), 24u);
}

// Primitives that share all accessors take little memory, but each has its own normals.
TEST(GltfNormals, AreSpentFromTheBudget) {
  FileBuilder file = roof();
  const std::vector<std::uint8_t> indices(30'000);
  file.primitive()["indices"] = file.add(indices, "SCALAR", unsignedByteType);
  const Json primitive = file.primitive();
  for (int i = 1; i < 1000; ++i) file.json["meshes"][0]["primitives"].push_back(primitive);
  EXPECT_TRUE(file.load().ok());
  for (const MissingNormals kind : {MissingNormals::smooth, MissingNormals::flat})
    expectError(file.load({}, {.missingNormals = kind}), ErrorCode::limitExceeded,
                "it needs more memory than");
}

}  // namespace
}  // namespace dermis::test
