// Primitives: influences, triangles, the formats each attribute may have.
#include <dermis/mesh.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "gltf_builder.h"

namespace dermis::test {
namespace {

using Floats = std::vector<float>;
using Indices = std::vector<std::uint32_t>;
using Bytes = std::vector<std::uint8_t>;
using Shorts = std::vector<std::uint16_t>;

TEST(GltfPrimitive, ReadsInfluences) {
  const gltf::Primitive primitive = firstPrimitive(loaded(skinnedTriangle()));
  EXPECT_EQ(primitive.vertexCount, 3u);
  EXPECT_EQ(primitive.influencesPerVertex(), 4u);
  const gltf::Influences set = onlySet(primitive);
  EXPECT_EQ(set.jointType, ComponentType::uint8);
  EXPECT_EQ(componentsOf<std::uint8_t>(set.joints), (Bytes{0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}));
  EXPECT_EQ(set.weightType, ComponentType::float32);
  EXPECT_EQ(componentsOf<float>(set.weights), (Floats{1, 0, 0, 0, 1, 0, 0, 0, 0.25f, 0.75f, 0, 0}));
  EXPECT_EQ(primitive.name, "number 0");
}

TEST(GltfPrimitive, NamesItselfByItsMesh) {
  FileBuilder file = skinnedTriangle();
  file.json["meshes"][0]["name"] = "Fox";
  EXPECT_EQ(firstPrimitive(loaded(file)).name, "Fox");
  const Json one = file.primitive();
  file.json["meshes"][0]["primitives"].push_back(one);
  EXPECT_EQ(loaded(file).meshes[0].primitives[1].name, "Fox primitive 1");
  // What is too long is cut, not the number; and no quotes within quotes.
  file.json["meshes"][0]["name"] = "Fox\n" + std::string(3'000'000, 'x');
  const gltf::Model model = loaded(file);
  const gltf::Primitive& second = model.meshes[0].primitives[1];
  EXPECT_TRUE(second.name.starts_with("Fox\\nxx")) << second.name;
  EXPECT_TRUE(second.name.ends_with("x... primitive 1")) << second.name;
  EXPECT_LE(second.name.size(), 80u);
}

// There is no count of vertices that targets could agree with: this used to read out of bounds.
TEST(GltfPrimitive, RefusesMorphTargetsOfNothing) {
  FileBuilder file = skinnedTriangle();
  file.primitive()["targets"] = {{{"POSITION", file.attributes()["POSITION"]}}};
  FileBuilder bare = file;
  bare.attributes() = Json::object();
  expectInvalid(bare, "mesh 0 primitive 0: it has morph targets, but no attribute");
  bare.primitive()["indices"] = bare.add<std::uint16_t>({0, 1, 2}, "SCALAR", unsignedShortType);
  expectInvalid(bare, "mesh 0 primitive 0: it has morph targets, but no attribute");
  bare.primitive()["targets"] = Json::array({Json::object()});
  expectInvalid(bare, "mesh 0 primitive 0: it has morph targets, but no attribute");
  bare.attributes() = {{"_ANY", file.attributes()["POSITION"]}};
  EXPECT_EQ(loaded(bare).skinnedPrimitives.size(), 0u) << "no positions: left out, with a note";
  // As a file that a fuzzer found nothing wrong with: no node shows the mesh.
  const std::string smallest =
      R"({"asset":{"version":"2.0"},"accessors":[{"componentType":5126,"type":"VEC3","count":1}],)"
      R"("meshes":[{"primitives":[{"attributes":{},"targets":[{"POSITION":0}]}]}]})";
  expectNoted(bytesOf(smallest), "it has morph targets, but no attribute");
}

TEST(GltfPrimitive, AttributeNamesInMessagesAreShortAndOnOneLine) {
  for (const bool inTarget : {false, true}) {
    FileBuilder file = skinnedTriangle();
    const std::string name = "\n\x1b[31m" + std::string(3'000'000, 'A');
    const std::size_t two = file.addFloats({1, 2, 3, 4, 5, 6}, "VEC3");
    if (inTarget) {
      file.primitive()["targets"] = {{{name, two}}};
    } else {
      file.attributes()[name] = two;
    }
    const gltf::Model model = loaded(file);
    if (inTarget) continue;  // What an application adds to a target is not looked at.
    ASSERT_EQ(model.notes.size(), 1u);
    EXPECT_NE(model.notes[0].find("\\n\\u001b[31mAAA"), std::string::npos) << model.notes[0];
    EXPECT_LT(model.notes[0].size(), 250u);
  }
}

// Which weights are equal is a matter of the integers, not of their quotients.
TEST(GltfPrimitive, KeepsIntegerWeightsAsTheyAre) {
  FileBuilder file = skinnedTriangle();
  const Bytes bytes{255, 0, 0, 0, 51, 204, 0, 0, 1, 254, 0, 0};
  file.attributes()["WEIGHTS_0"] = file.add(bytes, "VEC4", unsignedByteType, true);
  gltf::Influences set = onlySet(firstPrimitive(loaded(file)));
  EXPECT_EQ(set.weightType, ComponentType::unorm8);
  EXPECT_EQ(componentsOf<std::uint8_t>(set.weights), bytes);

  const Shorts shorts{65535, 0, 0, 0, 0, 65535, 0, 0, 1, 65534, 0, 0};
  file.attributes()["WEIGHTS_0"] = file.add(shorts, "VEC4", unsignedShortType, true);
  file.attributes()["JOINTS_0"] = file.add(shorts, "VEC4", unsignedShortType);
  set = onlySet(firstPrimitive(loaded(file)));
  EXPECT_EQ(set.weightType, ComponentType::unorm16);
  EXPECT_EQ(componentsOf<std::uint16_t>(set.weights), shorts);
  EXPECT_EQ(set.jointType, ComponentType::uint16);
  EXPECT_EQ(componentsOf<std::uint16_t>(set.joints), shorts);
}

TEST(GltfPrimitive, PutsSparseAndSpacedInfluencesTogether) {
  FileBuilder file = skinnedTriangle();
  const std::size_t indices = file.addView(bytesOf(Bytes{1}));
  const std::size_t values = file.addView(bytesOf(Shorts{9, 8, 7, 6}));
  // Elements 12 bytes apart, with something else between them.
  const std::size_t spaced =
      file.add(Shorts{1, 2, 3, 4, 99, 99, 5, 6, 7, 8, 99, 99, 10, 11, 12, 13, 99, 99}, "VEC4",
               unsignedShortType, true);
  file.json["bufferViews"].back()["byteStride"] = 12;
  file.json["accessors"][spaced]["count"] = 3;
  file.json["accessors"][spaced]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", indices}, {"componentType", unsignedByteType}}},
      {"values", {{"bufferView", values}}}};
  file.attributes()["WEIGHTS_0"] = spaced;
  EXPECT_EQ(componentsOf<std::uint16_t>(onlySet(firstPrimitive(loaded(file))).weights),
            (Shorts{1, 2, 3, 4, 9, 8, 7, 6, 10, 11, 12, 13}));
}

TEST(GltfPrimitive, ReadsAnyNumberOfSets) {
  FileBuilder file = skinnedTriangle();
  for (int set = 1; set < 12; ++set) {
    const auto joint = static_cast<std::uint16_t>(set);
    const auto weight = static_cast<float>(set);
    file.attributes()["JOINTS_" + std::to_string(set)] =
        file.add(Shorts(12, joint), "VEC4", unsignedShortType);
    file.attributes()["WEIGHTS_" + std::to_string(set)] =
        file.addFloats(Floats(12, weight), "VEC4");
  }
  const gltf::Primitive primitive = firstPrimitive(loaded(file));
  EXPECT_EQ(primitive.influencesPerVertex(), 48u);
  ASSERT_EQ(primitive.influences.size(), 12u);
  for (std::size_t set = 1; set < 12; ++set) {
    const gltf::Influences& influences = primitive.influences[set];
    EXPECT_EQ(componentsOf<std::uint16_t>(influences.joints),
              Shorts(12, static_cast<std::uint16_t>(set)));
    EXPECT_EQ(componentsOf<float>(influences.weights), Floats(12, static_cast<float>(set)));
  }
  EXPECT_EQ(componentsOf<float>(primitive.influences[0].weights)[9], 0.75f);
}

TEST(GltfPrimitive, IsViewedWithAllItsSets) {
  FileBuilder file = skinnedTriangle();
  file.attributes()["NORMAL"] = file.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  file.attributes()["TANGENT"] = file.addFloats({1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, -1}, "VEC4");
  file.attributes()["JOINTS_1"] = file.add(Shorts(12, 1), "VEC4", unsignedShortType);
  file.attributes()["WEIGHTS_1"] = file.add(Bytes(12, 51), "VEC4", unsignedByteType, true);
  const gltf::Primitive primitive = firstPrimitive(loaded(file));
  const gltf::PrimitiveView owner(primitive);
  const MeshView view = owner.mesh();
  EXPECT_EQ(view.name, primitive.name);
  EXPECT_EQ(view.vertexCount, 3u);
  EXPECT_EQ(view.positions.data, primitive.positions.data());
  EXPECT_EQ(view.normals.components, 3u);
  EXPECT_EQ(view.tangents.components, 4u);
  EXPECT_EQ(view.tangents.stride, 16u);
  EXPECT_TRUE(view.morphTargets.empty());
  ASSERT_EQ(view.influenceSets.size(), 2u);
  for (std::size_t set = 0; set < 2; ++set) {
    const InfluenceSet& influences = view.influenceSets[set];
    const gltf::Influences& stored = primitive.influences[set];
    EXPECT_EQ(influences.joints.data, stored.joints.data());
    EXPECT_EQ(influences.joints.type, stored.jointType);
    EXPECT_EQ(influences.joints.stride, set == 0 ? 4u : 8u);
    EXPECT_EQ(influences.joints.count, 3u);
    EXPECT_EQ(influences.joints.components, 4u);
    EXPECT_EQ(influences.weights.data, stored.weights.data());
    EXPECT_EQ(influences.weights.type, stored.weightType);
    EXPECT_EQ(influences.weights.stride, set == 0 ? 16u : 4u);
    EXPECT_EQ(influences.weights.components, 4u);
  }
}

FileBuilder withTwoTargets() {
  FileBuilder file = skinnedTriangle();
  file.primitive()["targets"] = {
      {{"POSITION", file.addFloats({1, 2, 3, 4, 5, 6, 7, 8, 9}, "VEC3")}},
      {{"NORMAL", file.addFloats(Floats(9, 1.0f), "VEC3")},
       {"TANGENT", file.addFloats(Floats(9, 2.0f), "VEC3")}}};
  return file;
}

TEST(GltfPrimitive, IsViewedWithItsMorphTargets) {
  const FileBuilder file = withTwoTargets();
  const gltf::Primitive primitive = firstPrimitive(loaded(file));
  gltf::PrimitiveView first(primitive);
  const gltf::PrimitiveView owner = std::move(first);
  const MeshView view = owner.mesh();
  ASSERT_EQ(view.morphTargets.size(), 2u);
  const MorphTargetView& position = view.morphTargets[0];
  const MorphTargetView& rest = view.morphTargets[1];
  EXPECT_TRUE(position.vertices.empty());
  EXPECT_EQ(position.positions.data, primitive.morphTargets[0].positions.data());
  EXPECT_EQ(position.positions.count, 3u);
  EXPECT_EQ(position.positions.stride, 12u);
  EXPECT_EQ(position.positions.components, 3u);
  EXPECT_EQ(position.positions.type, ComponentType::float32);
  EXPECT_FALSE(position.normals || position.tangents);
  EXPECT_FALSE(rest.positions);
  EXPECT_EQ(rest.normals.data, primitive.morphTargets[1].normals.data());
  EXPECT_EQ(rest.tangents.data, primitive.morphTargets[1].tangents.data());
  EXPECT_EQ(rest.tangents.components, 3u) << "the handedness is not displaced";
}

TEST(GltfPrimitive, KeepsAPrimitiveWithoutJoints) {
  FileBuilder file = skinnedTriangle();
  file.attributes().erase("JOINTS_0");
  file.attributes().erase("WEIGHTS_0");
  const gltf::Model model = loaded(file);
  EXPECT_EQ(model.skinnedPrimitives.size(), 1u);
  const gltf::Primitive primitive = firstPrimitive(model);
  EXPECT_EQ(primitive.influencesPerVertex(), 0u);
  const gltf::PrimitiveView view(primitive);
  EXPECT_TRUE(view.mesh().influenceSets.empty());
  ASSERT_EQ(model.notes.size(), 1u);
  EXPECT_EQ(model.notes[0],
            "node 0: it has a skin, but mesh 0 has no joints and stays in bind pose");
}

TEST(GltfPrimitive, KeepsAPrimitiveWithoutJointsBesideOneThatHasThem) {
  FileBuilder file = skinnedTriangle();
  Json& primitives = file.json["meshes"][0]["primitives"];
  primitives.push_back({{"attributes", {{"POSITION", file.attributes()["POSITION"]}}}});
  const gltf::Model model = loaded(file.load({}, {.strict = true}));
  ASSERT_EQ(model.notes.size(), 1u);
  EXPECT_EQ(model.notes[0], "1 primitive left in bind pose: a skinned node, but no joints");
}

TEST(GltfPrimitive, LeavesOutAPrimitiveWithoutPositions) {
  FileBuilder file = skinnedTriangle();
  const Json whole = file.primitive();
  file.attributes().erase("POSITION");
  file.json["meshes"][0]["primitives"].push_back(whole);
  const gltf::Model model = loaded(file);
  ASSERT_EQ(model.skinnedPrimitives.size(), 1u);
  EXPECT_EQ(model.skinnedPrimitives[0].primitive, 1u);
  ASSERT_EQ(model.notes.size(), 1u);
  EXPECT_NE(model.notes[0].find("mesh 0 primitive 0: it has no positions"), std::string::npos);
}

// Five vertices, no indices, one mode after another.
FileBuilder fiveVertices(int mode) {
  FileBuilder file = skinnedTriangle();
  file.attributes() = {{"POSITION", file.addFloats(Floats(15), "VEC3")}};
  file.primitive()["mode"] = mode;
  return file;
}

TEST(GltfPrimitive, UnrollsStripsAndFans) {
  // glTF 2.0, 3.7.2.1: every second triangle of a strip is turned round.
  EXPECT_EQ(firstPrimitive(loaded(fiveVertices(5))).triangles,
            (Indices{0, 1, 2, 1, 3, 2, 2, 3, 4}));
  EXPECT_EQ(firstPrimitive(loaded(fiveVertices(6))).triangles,
            (Indices{1, 2, 0, 2, 3, 0, 3, 4, 0}));
}

TEST(GltfPrimitive, MakesNoTrianglesOfPointsAndLines) {
  for (const int mode : {0, 1, 2, 3}) {
    const gltf::Primitive primitive = firstPrimitive(loaded(fiveVertices(mode)));
    EXPECT_EQ(primitive.vertexCount, 5u);
    EXPECT_TRUE(primitive.triangles.empty());
  }
}

TEST(GltfPrimitive, LeavesOutIndicesThatMakeNoTriangle) {
  const gltf::Model model = loaded(fiveVertices(4));
  EXPECT_EQ(firstPrimitive(model).triangles, (Indices{0, 1, 2}));
  EXPECT_TRUE(hasNote(model, "the last 2 indices do not form a triangle and are left out"));
}

TEST(GltfPrimitive, ReadsIndicesOfEveryType) {
  FileBuilder file = skinnedTriangle();
  file.primitive()["indices"] =
      file.add<std::uint8_t>({2, 1, 0, 0, 1, 2}, "SCALAR", unsignedByteType);
  EXPECT_EQ(firstPrimitive(loaded(file)).triangles, (Indices{2, 1, 0, 0, 1, 2}));
  file.primitive()["indices"] = file.add<std::uint16_t>({2, 1, 0}, "SCALAR", unsignedShortType);
  EXPECT_EQ(firstPrimitive(loaded(file)).triangles, (Indices{2, 1, 0}));
  file.primitive()["indices"] = file.add<std::uint32_t>({1, 1, 0}, "SCALAR", unsignedIntType);
  EXPECT_EQ(firstPrimitive(loaded(file)).triangles, (Indices{1, 1, 0}));
  file.primitive()["mode"] = 5;
  file.primitive()["indices"] = file.add<std::uint32_t>({2, 1}, "SCALAR", unsignedIntType);
  EXPECT_TRUE(firstPrimitive(loaded(file)).triangles.empty());
}

TEST(GltfPrimitive, RefusesBadIndices) {
  FileBuilder file = skinnedTriangle();
  file.primitive()["indices"] = file.add<std::uint8_t>({2, 1, 3}, "SCALAR", unsignedByteType);
  expectInvalid(file, "mesh 0 primitive 0: index 2 of accessor 3 is 3, and there are 3 vertices");
  // The largest value restarts a strip in some interfaces, and is forbidden here.
  file.primitive()["indices"] = file.add<std::uint8_t>({0, 255, 1}, "SCALAR", unsignedByteType);
  expectInvalid(file, "is 255, and there are 3 vertices");
  file.primitive()["indices"] = file.addFloats({0, 1, 2}, "SCALAR");
  expectInvalid(file, "indices: accessor 5 is SCALAR of float, not SCALAR of unsigned byte");
  file.primitive()["indices"] = 0;
  expectInvalid(file, "indices: accessor 0 is VEC3 of float");
  file.primitive()["indices"] = 77;
  expectInvalid(file, "mesh 0 primitive 0: indices is 77");
  const std::size_t indices = file.add<std::uint32_t>({0, 1, 2}, "SCALAR", unsignedIntType);
  file.json["bufferViews"].back()["byteStride"] = 4;
  file.primitive()["indices"] = indices;
  const gltf::Model model =
      expectNoted(file, "indices: bufferView 6 of accessor 6 has a byteStride of 4");
  EXPECT_EQ(firstPrimitive(model).triangles, (Indices{0, 1, 2}));
}

TEST(GltfPrimitive, ReadsTexcoordsColorsAndMaterial) {
  FileBuilder file = skinnedTriangle();
  file.json["materials"] = {{{"name", "plain"}},
                            {{"pbrMetallicRoughness",
                              {{"baseColorFactor", {0.5, 0.25, 0.125, 1}},
                               {"metallicFactor", 0.5},
                               {"roughnessFactor", 0.25}}},
                             {"emissiveFactor", {1, 0, 0.5}},
                             {"alphaMode", "MASK"},
                             {"alphaCutoff", 0.75},
                             {"doubleSided", true}}};
  file.primitive()["material"] = 1;
  file.attributes()["TEXCOORD_0"] = file.addFloats({0, 1, 2, 3, 4, 5}, "VEC2");
  file.attributes()["TEXCOORD_1"] =
      file.add<std::uint16_t>({0, 65535, 0, 0, 65535, 0}, "VEC2", unsignedShortType, true);
  file.attributes()["COLOR_0"] = file.addFloats({1, 0, 0, 0, 1, 0, 0, 0, 1}, "VEC3");
  const gltf::Model model = loaded(file);
  const gltf::Primitive primitive = firstPrimitive(model);
  ASSERT_EQ(primitive.texcoords.size(), 2u);
  EXPECT_EQ(primitive.texcoords[0], (Floats{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(primitive.texcoords[1], (Floats{0, 1, 0, 0, 1, 0}));
  EXPECT_EQ(primitive.colors, (Floats{1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1}));
  EXPECT_EQ(primitive.material, 1u);
  ASSERT_EQ(model.materials.size(), 2u);
  EXPECT_EQ(model.materials[0].name, "plain");
  EXPECT_EQ(model.materials[0].metallic, 1.0f);
  EXPECT_EQ(model.materials[0].alphaMode, gltf::Material::AlphaMode::opaque);
  EXPECT_EQ(model.materials[1].baseColor, (std::array<float, 4>{0.5f, 0.25f, 0.125f, 1}));
  EXPECT_EQ(model.materials[1].roughness, 0.25f);
  EXPECT_EQ(model.materials[1].emissive, (std::array<float, 3>{1, 0, 0.5f}));
  EXPECT_EQ(model.materials[1].alphaMode, gltf::Material::AlphaMode::mask);
  EXPECT_EQ(model.materials[1].alphaCutoff, 0.75f);
  EXPECT_TRUE(model.materials[1].doubleSided);

  file.attributes()["COLOR_0"] = file.add<std::uint8_t>({255, 0, 51, 204, 0, 0, 0, 0, 1, 2, 3, 4},
                                                        "VEC4", unsignedByteType, true);
  EXPECT_EQ(firstPrimitive(loaded(file)).colors[3], 0.8f);
}

// A gap in what does not concern skinning is no reason to refuse a file.
TEST(GltfPrimitive, ReadsTexcoordsUpToAGap) {
  FileBuilder file = skinnedTriangle();
  file.attributes()["TEXCOORD_0"] = file.addFloats({0, 1, 2, 3, 4, 5}, "VEC2");
  file.attributes()["TEXCOORD_2"] = file.attributes()["TEXCOORD_0"];
  EXPECT_EQ(firstPrimitive(loaded(file)).texcoords.size(), 1u);
}

// Nothing that is wrong with a material moves a vertex: the default is taken.
TEST(GltfPrimitive, NotesBadMaterials) {
  FileBuilder file = skinnedTriangle();
  file.primitive()["material"] = 0;
  EXPECT_EQ(firstPrimitive(expectNoted(file,
                                       "mesh 0 primitive 0: material is 0, and the file has "
                                       "0 materials"))
                .material,
            noIndex);
  file.json["materials"] = {{{"emissiveFactor", {1, 2}}, {"alphaCutoff", 0.25}}};
  const gltf::Model model =
      expectNoted(file, "material 0: emissiveFactor is not an array of 3 numbers");
  EXPECT_EQ(model.materials.at(0).emissive, (std::array<float, 3>{0, 0, 0}));
  EXPECT_EQ(model.materials.at(0).alphaCutoff, 0.25f);
  EXPECT_EQ(firstPrimitive(model).material, 0u);
  file.json["materials"] = {{{"alphaMode", "SOME"}}};
  expectNoted(file, "material 0: alphaMode is 'SOME'");
  file.json["materials"] = {{{"pbrMetallicRoughness", 3}}};
  expectNoted(file, "material 0: pbrMetallicRoughness is not an object");
  file.json["materials"] = {{{"pbrMetallicRoughness", {{"metallicFactor", "x"}}}}};
  EXPECT_EQ(expectNoted(file, "material 0: metallicFactor contains something other than numbers")
                .materials[0]
                .metallic,
            1.0f);
}

/// An accessor without a bufferView: zeros, but for these sparse elements.
std::size_t addSparse(FileBuilder& file, std::size_t count,
                      const std::vector<std::uint16_t>& elements, const Floats& values) {
  const std::size_t indices = file.addView(bytesOf(elements));
  const std::size_t view = file.addView(bytesOf(values));
  return file.addAccessor(
      {{"componentType", floatType},
       {"count", count},
       {"type", "VEC3"},
       {"sparse",
        {{"count", elements.size()},
         {"indices", {{"bufferView", indices}, {"componentType", unsignedShortType}}},
         {"values", {{"bufferView", view}}}}}});
}

TEST(GltfPrimitive, DecodesASharedAccessorOnce) {
  FileBuilder file = withTwoTargets();
  file.attributes()["NORMAL"] = file.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  file.attributes()["TEXCOORD_0"] = file.addFloats({0, 1, 2, 3, 4, 5}, "VEC2");
  file.attributes()["COLOR_0"] = file.addFloats({1, 0, 0, 0, 1, 0, 0, 0, 1}, "VEC3");
  file.primitive()["indices"] = file.add<std::uint8_t>({0, 1, 2}, "SCALAR", unsignedByteType);
  file.primitive()["targets"].push_back({{"POSITION", addSparse(file, 3, {1}, {1, 2, 3})}});
  const Json primitive = file.primitive();
  file.json["meshes"][0]["primitives"].push_back(primitive);
  file.json["meshes"].push_back({{"primitives", {primitive}}});
  file.json["nodes"].push_back({{"mesh", 1}, {"skin", 0}});
  file.json["scenes"][0]["nodes"].push_back(3);
  const gltf::Model model = loaded(file);
  const gltf::Primitive& first = model.meshes.at(0).primitives.at(0);
  ASSERT_EQ(first.morphTargets.size(), 3u);
  for (const gltf::Primitive* other :
       {&model.meshes.at(0).primitives.at(1), &model.meshes.at(1).primitives.at(0)}) {
    EXPECT_EQ(other->positions.data(), first.positions.data());
    EXPECT_EQ(other->normals.data(), first.normals.data());
    EXPECT_EQ(other->texcoords.at(0).data(), first.texcoords.at(0).data());
    EXPECT_EQ(other->colors.data(), first.colors.data());
    EXPECT_EQ(other->triangles.data(), first.triangles.data());
    EXPECT_EQ(onlySet(*other).joints.data(), onlySet(first).joints.data());
    EXPECT_EQ(onlySet(*other).weights.data(), onlySet(first).weights.data());
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(other->morphTargets.at(i).positions.data(), first.morphTargets[i].positions.data());
      EXPECT_EQ(other->morphTargets.at(i).normals.data(), first.morphTargets[i].normals.data());
      EXPECT_EQ(other->morphTargets.at(i).vertices.data(), first.morphTargets[i].vertices.data());
    }
  }
}

// Colors with and without alpha, and triangles of another mode or of more vertices, are others.
TEST(GltfPrimitive, SharesOnlyWhatIsTheSame) {
  FileBuilder file = skinnedTriangle();
  file.primitive()["indices"] = file.add<std::uint8_t>({0, 1, 2, 1}, "SCALAR", unsignedByteType);
  file.primitive()["mode"] = 5;
  file.attributes()["NORMAL"] = file.attributes()["COLOR_0"] = file.attributes()["POSITION"];
  file.json["meshes"][0]["primitives"].push_back(file.primitive());
  file.json["meshes"][0]["primitives"][1]["mode"] = 6;
  const gltf::Model model = loaded(file);
  const gltf::Primitive& strip = model.meshes.at(0).primitives.at(0);
  const gltf::Primitive& fan = model.meshes.at(0).primitives.at(1);
  EXPECT_EQ(strip.triangles, (std::vector<std::uint32_t>{0, 1, 2, 1, 1, 2}));
  EXPECT_EQ(fan.triangles, (std::vector<std::uint32_t>{1, 2, 0, 2, 1, 0}));
  EXPECT_EQ(strip.colors, (Floats{0, 0, 0, 1, 1, 0, 0, 1, 0, 2, 0, 1}));
  EXPECT_EQ(strip.normals, (Floats{0, 0, 0, 1, 0, 0, 0, 2, 0}));
}

// Three bytes a color: the stride is that of the elements, without padding.
TEST(GltfPrimitive, NotesColorsWithoutPadding) {
  FileBuilder file = skinnedTriangle();
  file.attributes()["COLOR_0"] =
      file.add<std::uint8_t>({255, 0, 51, 204, 0, 0, 0, 0, 255}, "VEC3", unsignedByteType, true);
  const gltf::Model model = expectNoted(file, "starts at byte 0 with a stride of 3");
  EXPECT_EQ(firstPrimitive(model).colors, (Floats{1, 0, 0.2f, 1, 0.8f, 0, 0, 1, 0, 0, 1, 1}));
}

TEST(GltfPrimitive, KeepsSparseMorphTargetsSparse) {
  FileBuilder file = skinnedTriangle();
  file.attributes()["NORMAL"] = file.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const std::size_t last = addSparse(file, 3, {2}, {1, 2, 3});
  const std::size_t ends = addSparse(file, 3, {0, 2}, {4, 5, 6, 7, 8, 9});
  const std::size_t zeros =
      file.addAccessor({{"componentType", floatType}, {"count", 3}, {"type", "VEC3"}});
  const std::size_t dense = file.addFloats({1, 2, 3, 4, 5, 6, 7, 8, 9}, "VEC3");
  file.primitive()["targets"] = {{{"POSITION", last}, {"NORMAL", ends}},
                                 {{"POSITION", zeros}, {"NORMAL", last}},
                                 {{"POSITION", zeros}, {"NORMAL", zeros}},
                                 {{"POSITION", dense}, {"NORMAL", last}}};
  const gltf::Primitive primitive = firstPrimitive(loaded(file));
  ASSERT_EQ(primitive.morphTargets.size(), 4u);
  using Vertices = std::vector<std::uint32_t>;
  const auto& targets = primitive.morphTargets;
  EXPECT_EQ(targets[0].vertices, (Vertices{0, 2})) << "of both attributes";
  EXPECT_EQ(targets[0].positions, (Floats{0, 0, 0, 1, 2, 3}));
  EXPECT_EQ(targets[0].normals, (Floats{4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(targets[1].vertices, (Vertices{2}));
  EXPECT_TRUE(targets[1].positions.empty()) << "zeros displace nothing";
  EXPECT_EQ(targets[1].normals, (Floats{1, 2, 3}));
  EXPECT_TRUE(targets[2].vertices.empty());
  EXPECT_TRUE(targets[2].positions.empty() && targets[2].normals.empty());
  EXPECT_TRUE(targets[3].vertices.empty()) << "dense if one attribute is";
  EXPECT_EQ(targets[3].positions, (Floats{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(targets[3].normals, (Floats{0, 0, 0, 0, 0, 0, 1, 2, 3}));

  const gltf::PrimitiveView owner(primitive);
  const MeshView view = owner.mesh();
  EXPECT_TRUE(std::ranges::equal(view.morphTargets[0].vertices, targets[0].vertices));
  EXPECT_EQ(view.morphTargets[0].positions.count, 2u);
  EXPECT_EQ(view.morphTargets[3].normals.count, 3u);
  EXPECT_TRUE(validate(view, 2).packable());
}

// Elements out of order are a broken rule; of two values for one, the last counts.
TEST(GltfPrimitive, SortsTheVerticesOfASparseMorphTarget) {
  FileBuilder file = skinnedTriangle();
  const std::size_t sparse = addSparse(file, 3, {2, 0, 2}, {1, 1, 1, 2, 2, 2, 3, 3, 3});
  file.primitive()["targets"] = {{{"POSITION", sparse}}};
  const gltf::Model model = expectNoted(file, "sparse index 1 is 0 after 2: they must ascend");
  const gltf::MorphTarget target = firstPrimitive(model).morphTargets.at(0);
  EXPECT_EQ(target.vertices, (std::vector<std::uint32_t>{0, 2}));
  EXPECT_EQ(target.positions, (Floats{2, 2, 2, 3, 3, 3}));
}

TEST(GltfPrimitive, ReadsMorphTargets) {
  FileBuilder file = withTwoTargets();
  file.json["meshes"][0]["weights"] = {0.25, 0.5};
  file.json["nodes"][0]["weights"] = {1, 0};
  const gltf::Model model = loaded(file);
  const gltf::Primitive primitive = firstPrimitive(model);
  ASSERT_EQ(primitive.morphTargets.size(), 2u);
  EXPECT_EQ(primitive.morphTargets[0].positions, (Floats{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_TRUE(primitive.morphTargets[0].normals.empty());
  EXPECT_EQ(primitive.morphTargets[1].normals, Floats(9, 1.0f));
  EXPECT_EQ(primitive.morphTargets[1].tangents, Floats(9, 2.0f));
  EXPECT_EQ(model.meshes[0].morphTargetCount, 2u);
  EXPECT_EQ(model.meshes[0].morphWeights, (Floats{0.25f, 0.5f}));
  EXPECT_EQ(model.nodes[0].morphWeights, (Floats{1, 0}));
}

TEST(GltfPrimitive, RefusesBadMorphTargets) {
  FileBuilder file = skinnedTriangle();
  file.primitive()["targets"] = {{{"POSITION", file.addFloats(Floats(6), "VEC3")}}};
  expectInvalid(file, "morph target 0 POSITION: accessor 3 has 2 elements, but");
  file.primitive()["targets"] = {{{"POSITION", 2}}};
  expectInvalid(file, "morph target 0 POSITION: accessor 2 is VEC4");
  file.primitive()["targets"] = {{{"POSITION", 99}}};
  expectInvalid(file, "targets: 'POSITION' is 99");
}

TEST(GltfPrimitive, ReadsWeightsOfAnotherNumberThanTargets) {
  FileBuilder file = skinnedTriangle();
  file.primitive()["targets"] = {{{"POSITION", 0}}, {{"POSITION", 0}}};
  const auto weightsOfNoted = [&](const char* note) {
    return morphWeights(expectNoted(file, note), 0, noIndex, 0);
  };
  file.json["nodes"][0]["weights"] = {1, 2, 3};
  EXPECT_EQ(weightsOfNoted("node 0: it has 3 weights for 2 morph targets"), (Floats{1, 2}));
  file.json["nodes"][0]["weights"] = {1};
  EXPECT_EQ(weightsOfNoted("node 0: it has 1 weights for 2 morph targets"), (Floats{1, 0}));
  file.json["nodes"][0].erase("weights");
  file.json["meshes"][0]["weights"] = {4};
  EXPECT_EQ(weightsOfNoted("mesh 0: it has 1 weights for 2 morph targets"), (Floats{4, 0}));
  file.json["meshes"][0]["weights"] = {4, 5};
  file.json["nodes"][0]["weights"] = {1};
  expectInvalid(file,
                "node 0: it has 1 weights for 2 morph targets, but its mesh has more weights");
}

// A primitive without targets stays as it is while others move.
TEST(GltfPrimitive, ReadsPrimitivesOfDifferentNumbersOfTargets) {
  FileBuilder file = skinnedTriangle();
  const Json without = file.primitive();
  file.primitive()["targets"] = {{{"POSITION", 0}}, {{"POSITION", 0}}};
  file.json["meshes"][0]["primitives"].insert(file.json["meshes"][0]["primitives"].begin(),
                                              without);
  const gltf::Model model =
      expectNoted(file, "mesh 0 primitive 1: it has 2 morph targets, but primitive 0 has 0");
  EXPECT_EQ(model.meshes[0].morphTargetCount, 2u);
  EXPECT_EQ(model.meshes[0].primitives[0].morphTargets.size(), 0u);
  EXPECT_EQ(model.meshes[0].primitives[1].morphTargets.size(), 2u);
}

TEST(GltfPrimitive, ReadsQuantizedMeshes) {
  FileBuilder file = skinnedTriangle();
  const std::size_t positions =
      file.add<std::int16_t>({1, -2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0}, "VEC4", shortType);
  file.json["accessors"][positions]["type"] = "VEC3";
  file.json["accessors"][positions]["count"] = 3;
  file.json["bufferViews"].back()["byteStride"] = 8;
  const std::size_t normals =
      file.add<std::int8_t>({0, 0, 127, 0, 0, -127, 0, 0, 127, 0, 0, 0}, "VEC4", byteType, true);
  file.json["accessors"][normals]["type"] = "VEC3";
  file.json["bufferViews"].back()["byteStride"] = 4;
  file.attributes()["POSITION"] = positions;
  file.attributes()["NORMAL"] = normals;
  file.attributes()["TANGENT"] = file.add<std::int8_t>(
      {127, 0, 0, 127, 127, 0, 0, 127, 127, 0, 0, -127}, "VEC4", byteType, true);
  expectNoted(file, "NORMAL: accessor 4 is VEC3 of normalized byte, not VEC3 of float");
  EXPECT_EQ(firstPrimitive(loaded(file)).positions, (Floats{1, -2, 3, 4, 5, 6, 7, 8, 9}));
  file.json["extensionsUsed"] = {"KHR_mesh_quantization"};
  file.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  const gltf::Primitive primitive = firstPrimitive(loaded(file));
  EXPECT_EQ(primitive.positions, (Floats{1, -2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(primitive.normals, (Floats{0, 0, 1, 0, -1, 0, 1, 0, 0}));
  EXPECT_EQ(primitive.tangents.values().back(), -1.0f);
}

TEST(GltfPrimitive, RefusesFormatsThatAnAttributeMayNotHave) {
  const auto expectFormat = [](const char* attribute, auto values, const char* type,
                               int componentType, bool normalized, const std::string& text) {
    FileBuilder file = skinnedTriangle();
    file.attributes()[attribute] = file.add(values, type, componentType, normalized);
    expectInvalid(file, std::string("mesh 0 primitive 0 ") + attribute + ": accessor 3 is " + text);
  };
  expectFormat("POSITION", Floats(12), "VEC4", floatType, false, "VEC4 of float, not VEC3");
  expectFormat("POSITION", std::vector<std::uint32_t>(9), "VEC3", unsignedIntType, false,
               "VEC3 of unsigned int, not VEC3 of float");
  expectFormat("NORMAL", Floats(6), "VEC2", floatType, false, "VEC2 of float, not VEC3");
  expectFormat("TANGENT", Floats(9), "VEC3", floatType, false, "VEC3 of float, not VEC4");
  expectFormat("JOINTS_0", std::vector<std::uint16_t>(9), "VEC3", unsignedShortType, false,
               "VEC3 of unsigned short, not VEC4");
  expectFormat("WEIGHTS_0", std::vector<std::uint32_t>(12), "VEC4", unsignedIntType, false,
               "VEC4 of unsigned int, not VEC4 of float or normalized unsigned byte");
  expectFormat("WEIGHTS_0", std::vector<std::int16_t>(12), "VEC4", shortType, false,
               "VEC4 of short, not");
  expectFormat("WEIGHTS_0", Floats(9), "VEC3", floatType, false, "VEC3 of float, not VEC4");
}

// A joint is an integer whatever stores it.
TEST(GltfPrimitive, ReadsJointsOfFormatsThatTheyMayNotHave) {
  const auto read = [](auto values, int type, bool normalized, const std::string& text) {
    FileBuilder file = skinnedTriangle();
    file.attributes()["JOINTS_0"] = file.add(values, "VEC4", type, normalized);
    return onlySet(firstPrimitive(expectNoted(file, "JOINTS_0: accessor 3 is VEC4 of " + text)));
  };
  const Bytes bytes{0, 1, 0, 0, 1, 0, 0, 0, 200, 1, 0, 0};
  gltf::Influences set = read(bytes, unsignedByteType, true, "normalized unsigned byte, not");
  EXPECT_EQ(set.jointType, ComponentType::uint8);
  EXPECT_EQ(componentsOf<std::uint8_t>(set.joints), bytes);
  const Shorts shorts{0, 1, 0, 0, 1, 0, 0, 0, 65535, 1, 0, 0};
  set = read(Floats(shorts.begin(), shorts.end()), floatType, false, "float, not");
  EXPECT_EQ(set.jointType, ComponentType::uint16);
  EXPECT_EQ(componentsOf<std::uint16_t>(set.joints), shorts);
  set = read(Indices(shorts.begin(), shorts.end()), unsignedIntType, false, "unsigned int, not");
  EXPECT_EQ(componentsOf<std::uint16_t>(set.joints), shorts);
  set = read(std::vector<std::int16_t>(12, 300), shortType, false, "short, not");
  EXPECT_EQ(componentsOf<std::uint16_t>(set.joints), Shorts(12, 300));

  const auto expectNoJoint = [](auto values, int type, const std::string& text) {
    FileBuilder file = skinnedTriangle();
    file.attributes()["JOINTS_0"] = file.add(values, "VEC4", type);
    expectInvalid(file, "mesh 0 primitive 0 JOINTS_0: component 0 of vertex 0 is " + text);
  };
  expectNoJoint(Floats(12, 0.5f), floatType, "0.5, which is not a joint");
  expectNoJoint(Floats(12, -1), floatType, "-1, which");
  expectNoJoint(Floats(12, std::numeric_limits<float>::quiet_NaN()), floatType, "nan, which");
  expectNoJoint(Indices(12, 65536), unsignedIntType, "65536, which");
  expectNoJoint(std::vector<std::int8_t>(12, -1), byteType, "-1, which");
}

// Weights are from 0 to 1: bytes that are not said to be normalized are all the same.
TEST(GltfPrimitive, ReadsWeightsOfFormatsThatTheyMayNotHave) {
  FileBuilder file = skinnedTriangle();
  const Bytes bytes{255, 0, 0, 0, 51, 204, 0, 0, 1, 254, 0, 0};
  file.attributes()["WEIGHTS_0"] = file.add(bytes, "VEC4", unsignedByteType);
  gltf::Influences set =
      onlySet(firstPrimitive(expectNoted(file, "WEIGHTS_0: accessor 3 is VEC4 of unsigned byte")));
  EXPECT_EQ(set.weightType, ComponentType::unorm8);
  EXPECT_EQ(componentsOf<std::uint8_t>(set.weights), bytes);
  file.attributes()["WEIGHTS_0"] =
      file.add(std::vector<std::int16_t>(12, 32767), "VEC4", shortType, true);
  set = onlySet(firstPrimitive(expectNoted(file, "accessor 4 is VEC4 of normalized short, not")));
  EXPECT_EQ(set.weightType, ComponentType::float32);
  EXPECT_EQ(componentsOf<float>(set.weights), Floats(12, 1.0f));
}

// What concerns only pictures is left out where it is wrong.
TEST(GltfPrimitive, LeavesOutAttributesThatConcernNoVertex) {
  const auto leaveOut = [](const char* attribute, auto values, const char* type, int componentType,
                           const std::string& text) {
    FileBuilder file = skinnedTriangle();
    file.attributes()[attribute] = file.add(values, type, componentType);
    return firstPrimitive(expectNoted(file, text));
  };
  EXPECT_TRUE(leaveOut("TEXCOORD_0", Floats(9), "VEC3", floatType,
                       "mesh 0 primitive 0 TEXCOORD_0: accessor 3 is VEC3 of float, not VEC2")
                  .texcoords.empty());
  EXPECT_TRUE(leaveOut("TEXCOORD_0", Floats(4), "VEC2", floatType,
                       "TEXCOORD_0: accessor 3 has 2 elements, but POSITION has 3")
                  .texcoords.empty());
  EXPECT_TRUE(leaveOut("COLOR_0", Floats(6), "VEC2", floatType,
                       "COLOR_0: accessor 3 is VEC2 of float, not VEC4")
                  .colors.empty());
  leaveOut("_LEVEL", Floats{1, 2}, "SCALAR", floatType, "'_LEVEL': accessor 3 has 2 elements");
  FileBuilder file = skinnedTriangle();
  file.attributes()["_LEVEL\n" + std::string(200, 'x')] = 99;
  for (const std::string& note : loaded(file).notes) {
    EXPECT_EQ(note.find('\n'), std::string::npos);
    EXPECT_LT(note.size(), 200u);
  }
}

TEST(GltfPrimitive, RefusesSetsThatAreNotNumberedOneByOne) {
  FileBuilder file = skinnedTriangle();
  file.attributes()["JOINTS_2"] = file.attributes()["JOINTS_0"];
  file.attributes()["WEIGHTS_2"] = file.attributes()["WEIGHTS_0"];
  expectInvalid(file, "it has 2 sets of JOINTS_n, but no JOINTS_1");
  for (const char* name : {"JOINTS_01", "JOINTS_", "JOINTS_x", "JOINTS_99999999999999"}) {
    file = skinnedTriangle();
    file.attributes()[name] = 1;
    expectInvalid(file, std::string("there is no attribute '") + name + "'");
  }
}

TEST(GltfPrimitive, RefusesCountsThatDisagree) {
  FileBuilder file = skinnedTriangle();
  file.accessor("WEIGHTS_0")["count"] = 2;
  expectInvalid(file, "WEIGHTS_0: accessor 2 has 2 elements, but POSITION has 3");
  file = skinnedTriangle();
  file.attributes()["NORMAL"] = file.addFloats(Floats(6), "VEC3");
  expectInvalid(file, "NORMAL: accessor 3 has 2 elements, but POSITION has 3");
}

TEST(GltfPrimitive, RefusesBadDescriptions) {
  FileBuilder file = skinnedTriangle();
  file.attributes()["POSITION"] = 12;
  expectInvalid(file, "mesh 0 primitive 0 attributes: 'POSITION' is 12, and the file has 3");
  file.primitive().erase("attributes");
  expectInvalid(file, "mesh 0 primitive 0: it has no attributes");
  file.primitive() = 3;
  expectInvalid(file, "mesh 0 primitive 0 is not an object");
  file.json["meshes"][0]["primitives"] = Json::array();
  EXPECT_TRUE(expectNoted(file, "mesh 0: primitives is an empty array").skinnedPrimitives.empty());
  file.json["meshes"][0].erase("primitives");
  expectInvalid(file, "mesh 0: it has no primitives");
  file = skinnedTriangle();
  file.primitive()["mode"] = 7;
  expectInvalid(file, "mesh 0 primitive 0: mode is not from 0 to 6");
  file = skinnedTriangle();
  file.json["meshes"][0]["name"] = 4;
  EXPECT_EQ(expectNoted(file, "mesh 0: its name is not a string").meshes[0].name, "");
}

// Whether a joint exists is a matter of each vertex, which `validate` looks at.
TEST(GltfPrimitive, KeepsValuesThatValidateLooksAt) {
  FileBuilder file = skinnedTriangle();
  file.attributes()["JOINTS_0"] =
      file.add(std::vector<std::uint16_t>(12, 60000), "VEC4", unsignedShortType);
  file.attributes()["WEIGHTS_0"] = file.addFloats(Floats(12, -1.0f), "VEC4");
  const gltf::Influences set = onlySet(firstPrimitive(loaded(file)));
  EXPECT_EQ(componentsOf<std::uint16_t>(set.joints)[0], 60000u);
  EXPECT_EQ(componentsOf<float>(set.weights)[0], -1.0f);
}

}  // namespace
}  // namespace dermis::test
