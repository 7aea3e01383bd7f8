// What `dermis skin` writes, in each of its formats: read back by other means, and compared.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "dermis_command.h"
#include "glb.h"
#include "gltf_builder.h"
#include "obj.h"
#include "ply.h"
#include "test_data.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using Floats = std::vector<float>;

CommandResult skin(const std::string& model, const std::string& out,
                   const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments{"skin", model, "-o", out, "--device", "cpu"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return dermis(arguments);
}

/// One pose in all three formats.
struct Pose {
  Ply ply;
  Obj obj;
  Glb glb;
};

Pose skinToAll(const std::string& model, const std::vector<std::string>& more = {}) {
  for (const char* ending : {"ply", "obj", "glb"}) {
    const CommandResult result = skin(model, outFile(std::string("pose.") + ending), more);
    EXPECT_EQ(result.status, 0) << result.errors;
    EXPECT_TRUE(result.output.empty()) << result.output;
  }
  const std::optional<Ply> ply = readPly(outFile("pose.ply"));
  const std::optional<Obj> obj = readObj(outFile("pose.obj"));
  EXPECT_TRUE(ply.has_value());
  EXPECT_TRUE(obj.has_value());
  EXPECT_TRUE(gltf::load(outFile("pose.glb")).ok()) << "the importer takes it too";
  return {ply.value_or(Ply{}), obj.value_or(Obj{}), readGlb(outFile("pose.glb"))};
}

/// The same vertices and triangles in the same order, to the bit.
void expectSame(const Pose& pose) {
  EXPECT_EQ(pose.obj.positions, pose.ply.positions);
  EXPECT_EQ(pose.obj.normals, pose.ply.normals);
  ASSERT_EQ(pose.obj.objects.size(), pose.glb.parts.size());
  std::size_t vertex = 0, face = 0, texcoord = 0;
  std::set<std::string> names;
  for (std::size_t i = 0; i < pose.glb.parts.size(); ++i) {
    const GlbPart& part = pose.glb.parts[i];
    const ObjObject& object = pose.obj.objects[i];
    EXPECT_TRUE(names.insert(object.name).second) << object.name;
    ASSERT_LE(vertex + part.positions.size(), pose.ply.positions.size());
    EXPECT_TRUE(std::equal(part.positions.begin(), part.positions.end(),
                           pose.ply.positions.begin() + static_cast<std::ptrdiff_t>(vertex)));
    EXPECT_EQ(object.positions, part.positions.size());
    EXPECT_EQ(object.normals, part.positions.size());
    EXPECT_EQ(object.texcoords != 0, part.others.contains("TEXCOORD_0"));
    ASSERT_EQ(object.faces.size(), part.indices.size() / 3);
    ASSERT_LE(face + object.faces.size(), pose.ply.faces.size());
    for (std::size_t corner = 0; corner < part.indices.size(); ++corner) {
      const std::size_t whole = vertex + part.indices[corner];
      const ObjCorner& fromObj = object.faces[corner / 3][corner % 3];
      ASSERT_EQ(static_cast<std::size_t>(pose.ply.faces[face + corner / 3][corner % 3]), whole);
      ASSERT_EQ(fromObj.position, whole);
      ASSERT_EQ(fromObj.normal, whole);
      const std::size_t expected = texcoord + part.indices[corner];
      ASSERT_EQ(fromObj.texcoord.value_or(expected), expected);
    }
    vertex += part.positions.size();
    face += object.faces.size();
    texcoord += object.texcoords;
  }
  EXPECT_EQ(vertex, pose.ply.positions.size());
  EXPECT_EQ(face, pose.ply.faces.size());
  EXPECT_EQ(texcoord, pose.obj.texcoords.size());
}

TEST(OutputTest, SampleModelsAreTheSameInAllFormats) {
  for (const char* name : {"bar", "arm", "figure"}) {
    SCOPED_TRACE(name);
    const Pose pose = skinToAll(std::string(sampleModels) + "/" + name + ".glb", {"--time", "0.4"});
    EXPECT_GE(pose.ply.faces.size(), 500u);
    expectSame(pose);
  }
}

TEST(OutputTest, RealModelsAreTheSameInAllFormats) {
  const std::optional<std::filesystem::path> data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  std::size_t skinned = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(*data / "models")) {
    const std::string path = entry.path().string();
    if (!path.ends_with(".gltf") && !path.ends_with(".glb") && !path.ends_with(".vrm")) continue;
    SCOPED_TRACE(path);
    // What is broken or has nothing to skin ends with 3.
    if (skin(path, outFile("probe.ply")).status != 0) continue;
    ++skinned;
    expectSame(skinToAll(path, {"--time", "0.3"}));
  }
  EXPECT_GE(skinned, 40u);
}

TEST(OutputTest, KeepsWhatSkinningLeavesAsItIs) {
  FileBuilder file = skinnedTriangle();
  file.json["nodes"][0]["name"] = "Body";
  file.json["materials"] = {{{"name", "unused"}},
                            {{"name", "skin"},
                             {"pbrMetallicRoughness",
                              {{"baseColorFactor", {0.5, 0.25, 0.1, 0.75}},
                               {"metallicFactor", 0.8},
                               {"roughnessFactor", 0.3}}},
                             {"emissiveFactor", {1, 0, 0.5}},
                             {"alphaMode", "MASK"},
                             {"alphaCutoff", 0.6},
                             {"doubleSided", true}}};
  file.primitive()["material"] = 1;
  file.attributes()["TEXCOORD_0"] = file.addFloats({0, 1, 0.25f, 0.75f, 4, -5}, "VEC2");
  file.attributes()["TEXCOORD_1"] =
      file.add<std::uint16_t>({0, 65535, 0, 0, 65535, 0}, "VEC2", unsignedShortType, true);
  file.attributes()["COLOR_0"] = file.addFloats({1, 0, 0, 0, 0.5f, 0, 0, 0, 1}, "VEC3");
  const Pose pose = skinToAll(file.writtenTo(outFile("kept.gltf")));
  expectSame(pose);
  ASSERT_EQ(pose.glb.parts.size(), 1u);
  const GlbPart& part = pose.glb.parts[0];
  EXPECT_EQ(part.name, "Body");
  EXPECT_EQ(part.mode, 4);
  EXPECT_EQ(part.others.at("TEXCOORD_0"), (Floats{0, 1, 0.25f, 0.75f, 4, -5}));
  EXPECT_EQ(part.others.at("TEXCOORD_1"), (Floats{0, 1, 0, 0, 1, 0}));
  EXPECT_EQ(part.others.at("COLOR_0"), (Floats{1, 0, 0, 1, 0, 0.5f, 0, 1, 0, 0, 1, 1}));
  // The very numbers of the file, not the digits of the floats in between.
  EXPECT_EQ(part.material, Json::parse(R"({"name": "skin", "pbrMetallicRoughness":
      {"baseColorFactor": [0.5, 0.25, 0.1, 0.75], "metallicFactor": 0.8, "roughnessFactor": 0.3},
      "emissiveFactor": [1.0, 0.0, 0.5], "alphaMode": "MASK", "alphaCutoff": 0.6,
      "doubleSided": true})"));
  EXPECT_EQ(pose.glb.json.at("materials").size(), 1u) << "the unused one is left out";
  // OBJ counts texture coordinates from the bottom.
  EXPECT_EQ(pose.obj.texcoords,
            (std::vector<std::array<float, 2>>{{0, 0}, {0.25f, 0.25f}, {4, 6}}));
  EXPECT_EQ(pose.obj.objects.at(0).name, "Body");
}

// A validator refuses colors and factors outside 0 to 1, normals that are not of unit length, and
// whatever is not finite.
TEST(OutputTest, MendsInAGlbWhatGltfForbids) {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  FileBuilder file = skinnedTriangle();
  file.attributes()["NORMAL"] = file.addFloats({0, 0, 0, 0, 3, 0, 1e-30f, 0, 0}, "VEC3");
  file.attributes()["TEXCOORD_0"] = file.addFloats({nan, 1, -infinity, 0.5f, 4, 0}, "VEC2");
  file.attributes()["COLOR_0"] =
      file.addFloats({2, -1, nan, 1, infinity, 0.5f, 0, 7, 0, 0, 0, 0}, "VEC4");
  file.json["materials"] = {
      {{"pbrMetallicRoughness",
        {{"baseColorFactor", {2, -1, 0.5, 1}}, {"metallicFactor", -3}, {"roughnessFactor", 1.5}}},
       {"emissiveFactor", {10, 0, 0}},
       {"alphaMode", "MASK"},
       {"alphaCutoff", -1}}};
  file.primitive()["material"] = 0;
  const Pose pose = skinToAll(file.writtenTo(outFile("mended.gltf")));
  expectSame(pose);
  const GlbPart& part = pose.glb.parts.at(0);
  EXPECT_EQ(pose.ply.normals.at(0), (std::array<float, 3>{0, 0, 0})) << "a zero normal stays zero";
  EXPECT_EQ(part.normals.at(0), (std::array<float, 3>{0, 0, 1}));
  EXPECT_EQ(part.normals.at(1), (std::array<float, 3>{0, 1, 0}));
  EXPECT_EQ(part.others.at("TEXCOORD_0"), (Floats{0, 1, 0, 0.5f, 4, 0}));
  EXPECT_EQ(part.others.at("COLOR_0"), (Floats{1, 0, 0, 1, 1, 0.5f, 0, 1, 0, 0, 0, 0}));
  EXPECT_EQ(part.material.at("emissiveFactor"), Json::parse("[1.0, 0.0, 0.0]"));
  EXPECT_EQ(part.material.at("alphaCutoff"), 0.0);
  EXPECT_EQ(pose.obj.texcoords.at(0), (std::array<float, 2>{0, 0}));
}

/// The triangle with normals and tangents, both joints turned by a right angle about z: x becomes
/// y, y becomes -x. A target displaces the first vertex' tangent.
FileBuilder turnedTriangle() {
  FileBuilder file = skinnedTriangle();
  file.attributes()["NORMAL"] = file.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  file.attributes()["TANGENT"] =
      file.addFloats({1, 0, 0, 1, 0, 1, 0, -1, 0, 0.6f, 0.8f, 1}, "VEC4");
  file.primitive()["targets"] = {
      {{"TANGENT", file.addFloats({-1, 1, 0, 0, 0, 0, 0, 0, 0}, "VEC3")}}};
  file.json["nodes"][1]["rotation"] = {0, 0, std::sqrt(0.5), std::sqrt(0.5)};
  return file;
}

void expectTangents(const GlbPart& part, const std::vector<std::array<float, 4>>& expected) {
  ASSERT_EQ(part.tangents.size(), expected.size());
  for (std::size_t vertex = 0; vertex < expected.size(); ++vertex) {
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_NEAR(part.tangents[vertex][i], expected[vertex][i], 1e-6f) << vertex << ", " << i;
  }
}

TEST(OutputTest, TangentsAreSkinnedIntoAGlb) {
  FileBuilder file = turnedTriangle();
  const Pose pose = skinToAll(file.writtenTo(outFile("turned.gltf")));
  expectSame(pose);
  expectTangents(pose.glb.parts.at(0), {{0, 1, 0, 1}, {-1, 0, 0, -1}, {-0.6f, 0, 0.8f, 1}});
  file.json["meshes"][0]["weights"] = {1};
  expectTangents(skinToAll(file.writtenTo(outFile("morphed.gltf"))).glb.parts.at(0),
                 {{-1, 0, 0, 1}, {-1, 0, 0, -1}, {-0.6f, 0, 0.8f, 1}});
  // A mirror turns the handedness over.
  file.json["nodes"][1]["scale"] = {1, 1, -1};
  expectTangents(skinToAll(file.writtenTo(outFile("mirrored.gltf"))).glb.parts.at(0),
                 {{-1, 0, 0, -1}, {-1, 0, 0, 1}, {-0.6f, 0, -0.8f, -1}});
}

TEST(OutputTest, TheDeviceSkinsTheSameTangents) {
  REQUIRE_DEVICE();
  FileBuilder file = turnedTriangle();
  file.json["meshes"][0]["weights"] = {0.25};
  const std::string model = file.writtenTo(outFile("device.gltf"));
  ASSERT_EQ(dermis({"skin", model, "-o", outFile("device.glb")}).status, 0);
  ASSERT_EQ(skin(model, outFile("cpu.glb")).status, 0);
  const Glb expected = readGlb(outFile("cpu.glb"));
  EXPECT_EQ(expected.parts.at(0).tangents.size(), 3u);
  expectTangents(readGlb(outFile("device.glb")).parts.at(0), expected.parts.at(0).tangents);
}

TEST(OutputTest, APartWithoutInfluencesKeepsItsTangentsButForItsMorphs) {
  FileBuilder file = turnedTriangle();
  file.attributes().erase("JOINTS_0");
  file.attributes().erase("WEIGHTS_0");
  file.json["meshes"][0]["weights"] = {0.5};
  const float root = std::sqrt(0.5f);
  expectTangents(skinToAll(file.writtenTo(outFile("bind.gltf"))).glb.parts.at(0),
                 {{root, root, 0, 1}, {0, 1, 0, -1}, {0, 0.6f, 0.8f, 1}});
}

// What has no direction gets one that is square to the normal; the validator wants the handedness
// to be 1 or -1.
TEST(OutputTest, TangentsThatCannotStandInAGlbAreMended) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  FileBuilder file = turnedTriangle();
  file.primitive().erase("targets");
  file.attributes()["TANGENT"] =
      file.addFloats({0, 0, 0, 0.5f, 0, 30, 0, -7, nan, 0, 0, 1}, "VEC4");
  const Pose pose = skinToAll(file.writtenTo(outFile("mended.gltf")));
  const GlbPart& part = pose.glb.parts.at(0);
  ASSERT_EQ(part.tangents.size(), 3u);
  for (std::size_t vertex = 0; vertex < 3; ++vertex) {
    const auto& t = part.tangents[vertex];
    const auto& n = part.normals[vertex];
    EXPECT_NEAR(t[0] * n[0] + t[1] * n[1] + t[2] * n[2], 0, 1e-6) << vertex;
  }
  EXPECT_EQ(part.tangents[0][3], 1);
  EXPECT_EQ(part.tangents[1][3], -1);
  EXPECT_NEAR(part.tangents[1][0], -1, 1e-6);
}

// glTF 2.0, 3.7.2.1: without normals they must be ignored; points have no use for them.
TEST(OutputTest, TangentsWithoutNormalsOrTrianglesAreLeftOut) {
  FileBuilder file = turnedTriangle();
  file.primitive().erase("targets");
  FileBuilder points = file;
  points.primitive()["mode"] = 0;
  EXPECT_TRUE(skinToAll(points.writtenTo(outFile("points.gltf"))).glb.parts.at(0).tangents.empty());
  file.attributes().erase("NORMAL");
  EXPECT_TRUE(skinToAll(file.writtenTo(outFile("normals.gltf"))).glb.parts.at(0).tangents.empty());
}

// The triangle's mesh with a second primitive before and after it: points without texture
// coordinates, and a strip.
TEST(OutputTest, PointsAndStripsKeepTheirVertices) {
  FileBuilder file = skinnedTriangle();
  file.json["meshes"][0]["name"] = "Mixed";
  const Json triangle = file.primitive();
  Json points = triangle, strip = triangle;
  points["mode"] = 0;
  strip["mode"] = 5;
  strip["indices"] = file.add<std::uint8_t>({0, 1, 2, 0}, "SCALAR", unsignedByteType);
  const std::size_t texcoords = file.addFloats({0, 0, 1, 0, 0, 1}, "VEC2");
  strip["attributes"]["TEXCOORD_0"] = texcoords;
  file.json["meshes"][0]["primitives"] = {points, triangle, strip};
  file.json["meshes"][0]["primitives"][1]["attributes"]["TEXCOORD_0"] = texcoords;
  const Pose pose = skinToAll(file.writtenTo(outFile("mixed.gltf")));
  expectSame(pose);
  ASSERT_EQ(pose.glb.parts.size(), 3u);
  EXPECT_EQ(pose.ply.positions.size(), 9u) << "shared accessors repeat their vertices";
  EXPECT_EQ(pose.glb.parts[0].mode, 0);
  EXPECT_EQ(pose.glb.parts[0].name, "Mixed.0");
  EXPECT_TRUE(pose.obj.objects[0].faces.empty());
  EXPECT_EQ(pose.glb.parts[1].indices, (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_EQ(pose.glb.parts[2].indices, (std::vector<std::uint32_t>{0, 1, 2, 1, 0, 2}));
  EXPECT_EQ(pose.obj.objects[2].faces.at(1).at(0).texcoord, 4u) << "the first part has none";
}

TEST(OutputTest, NormalsThatAreMissingAreComputed) {
  const Pose pose = skinToAll(skinnedTriangle().writtenTo(outFile("normals.gltf")));
  expectSame(pose);
  for (const auto& normal : pose.glb.parts.at(0).normals) {
    EXPECT_EQ(normal, (std::array<float, 3>{0, 0, 1}));
  }
}

TEST(OutputTest, NamesCannotBreakAFile) {
  FileBuilder file = skinnedTriangle();
  file.json["nodes"][0]["name"] = "a b\nf 1 1 1\\\n#\tc";
  file.json["nodes"].push_back(file.json["nodes"][0]);
  file.json["nodes"].push_back({{"mesh", 0}, {"skin", 0}});
  file.json["scenes"][0]["nodes"] = {0, 1, 3, 4};
  const Pose pose = skinToAll(file.writtenTo(outFile("names.gltf")));
  expectSame(pose);
  ASSERT_EQ(pose.glb.parts.size(), 3u);
  EXPECT_EQ(pose.glb.parts[0].name, "a b\nf 1 1 1\\\n#\tc");
  EXPECT_EQ(pose.obj.objects[0].name, "a_b_nf_1_1_1__n__u0009c");
  EXPECT_NE(pose.obj.objects[1].name, pose.obj.objects[0].name);
  EXPECT_EQ(pose.obj.objects[2].name, "node_4");
}

TEST(OutputTest, IndicesThatDoNotFitIntoSixteenBitsAreThirtyTwo) {
  for (const std::size_t vertices : {std::size_t{65535}, std::size_t{65536}}) {
    FileBuilder file = skinnedTriangle();
    Floats positions(vertices * 3);
    for (std::size_t i = 0; i < positions.size(); ++i) positions[i] = static_cast<float>(i % 7);
    file.attributes() = {
        {"POSITION", file.addFloats(positions, "VEC3")},
        {"JOINTS_0", file.add(std::vector<std::uint8_t>(vertices * 4), "VEC4", unsignedByteType)},
        {"WEIGHTS_0", file.addFloats(Floats(vertices * 4, 0.25f), "VEC4")}};
    const auto last = static_cast<std::uint32_t>(vertices - 1);
    file.primitive()["indices"] = file.add<std::uint32_t>({0, 1, last}, "SCALAR", unsignedIntType);
    const Pose pose = skinToAll(file.writtenTo(outFile("large.gltf")));
    expectSame(pose);
    const Json& primitive = pose.glb.json.at("meshes").at(0).at("primitives").at(0);
    EXPECT_EQ(pose.glb.json.at("accessors")
                  .at(primitive.at("indices").get<std::size_t>())
                  .at("componentType"),
              vertices == 65535 ? unsignedShortType : unsignedIntType);
  }
}

TEST(OutputTest, OnlyAPlyHoldsWhatIsNotFinite) {
  FileBuilder file = skinnedTriangle();
  // Each scale fits into float32, their product does not.
  file.json["nodes"][1]["scale"] = {1e30, 1, 1};
  file.json["nodes"][2]["scale"] = {1e30, 1, 1};
  const std::string model = file.writtenTo(outFile("infinite.gltf"));
  const CommandResult ply = skin(model, outFile("infinite.ply"));
  EXPECT_EQ(ply.status, 0);
  EXPECT_NE(ply.errors.find("dermis: warning: "), std::string::npos) << ply.errors;
  for (const char* name : {"infinite.obj", "infinite.glb"}) {
    std::filesystem::remove(outFile(name));
    const CommandResult result = skin(model, outFile(name));
    EXPECT_EQ(result.status, 3) << name;
    EXPECT_NE(result.errors.find("are not finite"), std::string::npos) << result.errors;
    EXPECT_NE(result.errors.find("; only a .ply can hold them\n"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists(outFile(name)));
  }
}

TEST(OutputTest, FramesAreWrittenInEveryFormat) {
  const std::string bar = std::string(sampleModels) + "/bar.glb";
  const std::vector<std::string> frames{"--frames", "2", "--fps", "4", "--time", "0.25"};
  EXPECT_EQ(skin(bar, outFile("%02d.obj"), frames).status, 0);
  EXPECT_EQ(skin(bar, outFile("%02d.glb"), frames).status, 0);
  EXPECT_EQ(skin(bar, outFile("single.ply"), {"--time", "0.5"}).status, 0);
  const std::optional<Ply> single = readPly(outFile("single.ply"));
  const std::optional<Obj> obj = readObj(outFile("01.obj"));
  ASSERT_TRUE(single && obj);
  EXPECT_EQ(obj->positions, single->positions);
  EXPECT_EQ(readGlb(outFile("01.glb")).parts.at(0).positions, single->positions);
  EXPECT_NE(readGlb(outFile("00.glb")).parts.at(0).positions, single->positions);
}

TEST(OutputTest, WhatCannotBeWrittenEndsWithFive) {
  const std::string bar = std::string(sampleModels) + "/bar.glb";
  for (const std::string ending : {".ply", ".obj", ".glb"}) {
    EXPECT_EQ(skin(bar, "/nonexistent/folder/out" + ending).status, 5);
    const std::string link = outFile("full" + ending);
    std::filesystem::remove(link);
    std::filesystem::create_symlink("/dev/full", link);
    const CommandResult full = skin(bar, link);
    EXPECT_EQ(full.status, 5);
    EXPECT_EQ(full.errors,
              "dermis: error: " + link + " cannot be written: No space left on device\n");
    EXPECT_TRUE(std::filesystem::is_symlink(link)) << "what is not a regular file stays";
    const std::string folder = outFile("folder" + ending);
    std::filesystem::create_directory(folder);
    EXPECT_EQ(skin(bar, folder).status, 5);
    EXPECT_TRUE(std::filesystem::is_directory(folder));
  }
}

TEST(OutputTest, OtherEndingsAreRefused) {
  const std::string bar = std::string(sampleModels) + "/bar.glb";
  for (const char* name : {"out.gltf", "out.stl", "out", "out.glb.zip", "out.fbx"}) {
    const CommandResult result = skin(bar, outFile(name));
    EXPECT_EQ(result.status, 2) << name;
    EXPECT_NE(result.errors.find("-o OUT must end in .ply, .obj or .glb"), std::string::npos);
  }
}

}  // namespace
}  // namespace dermis::test
