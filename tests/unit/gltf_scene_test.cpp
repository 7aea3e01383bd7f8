// Nodes, scenes and skins: what is skinned by what, and where the joints are at rest.
#include <cmath>
#include <limits>

#include "gltf_builder.h"

namespace dermis::test {
namespace {

using gltf::nodeGlobals;

std::array<double, 3> translationOf(const Transform& transform) {
  return {transform[0][3], transform[1][3], transform[2][3]};
}

void expectTransform(const Transform& actual, const Transform& expected) {
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      EXPECT_NEAR(actual[row][column], expected[row][column], 1e-15)
          << "row " << row << " column " << column;
    }
  }
}

FileBuilder withNodes(const Json& nodes) {
  FileBuilder file;
  file.json["nodes"] = nodes;
  return file;
}

TEST(GltfNode, ComposesTranslationRotationAndScale) {
  // A quarter turn about z, after scaling, before moving.
  const double half = std::sqrt(0.5);
  const gltf::Model model = loaded(withNodes(
      {{{"translation", {1, 2, 3}}, {"rotation", {0, 0, half, half}}, {"scale", {2, 3, 4}}}}));
  expectTransform(nodeGlobals(model, noIndex, 0)[0], {{{0, -3, 0, 1}, {2, 0, 0, 2}, {0, 0, 4, 3}}});
}

TEST(GltfNode, ReadsAMatrixByColumns) {
  const gltf::Model model =
      loaded(withNodes({{{"matrix", {1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0, 10, 11, 12, 1}}}}));
  expectTransform(nodeGlobals(model, noIndex, 0)[0],
                  {{{1, 4, 7, 10}, {2, 5, 8, 11}, {3, 6, 9, 12}}});
}

TEST(GltfNode, MultipliesParentsFirstWhateverTheOrder) {
  // Node 0 hangs below 2, which hangs below 1.
  const gltf::Model model = loaded(withNodes({{{"translation", {1, 0, 0}}},
                                              {{"children", {2}}, {"scale", {10, 10, 10}}},
                                              {{"children", {0}}, {"translation", {0, 1, 0}}}}));
  const auto globals = nodeGlobals(model, noIndex, 0);
  EXPECT_EQ(translationOf(globals[0]), (std::array<double, 3>{10, 10, 0}));
  EXPECT_EQ(translationOf(globals[2]), (std::array<double, 3>{0, 10, 0}));
  EXPECT_EQ(model.nodeOrder, (std::vector<std::uint32_t>{1, 2, 0}));
  EXPECT_EQ(model.nodes[0].parent, 2u);
  EXPECT_EQ(model.nodes[1].parent, noIndex);
}

TEST(GltfNode, NormalizesRotations) {
  const gltf::Model model = expectNoted(withNodes({{{"rotation", {0, 0, 0.3, 0.4}}},
                                                   {{"rotation", {0, 0, 0, 0}}},
                                                   {{"rotation", {0, 0, 0, 1}}}}),
                                        "node 0: its rotation has a length of 0.5, not 1");
  EXPECT_NEAR(model.nodes[0].rotation[2], 0.6, 1e-15);
  EXPECT_EQ(model.nodes[1].rotation, (std::array<double, 4>{0, 0, 0, 1}));
}

// A chain as deep as a hostile file likes: no recursion may follow it.
TEST(GltfNode, FollowsADeepChain) {
  Json nodes = Json::array();
  constexpr int depth = 50'000;
  for (int i = 0; i < depth; ++i) {
    Json node = {{"translation", {1, 0, 0}}};
    if (i > 0) node["children"] = {i - 1};
    nodes.push_back(node);
  }
  const gltf::Model model = loaded(withNodes(nodes));
  EXPECT_EQ(translationOf(nodeGlobals(model, noIndex, 0)[0])[0], depth);
}

TEST(GltfNode, RefusesWhatIsNoTree) {
  const auto withCycle = [](Json joints) {
    FileBuilder file = skinnedTriangle();
    for (const int child : {4, 3, 6}) file.json["nodes"].push_back({{"children", {child}}});
    file.json["nodes"][4]["children"].push_back(5);
    file.json["nodes"].push_back({{"translation", {1, 0, 0}}});
    file.json["skins"][0]["joints"] = joints;
    return file;
  };
  const gltf::Model model =
      expectNoted(withCycle({1, 2}), "node 3: it is part of, or below, a cycle of nodes");
  EXPECT_EQ(model.nodeOrder.size(), 7u);
  EXPECT_EQ(nodeGlobals(model, noIndex, 0).size(), 7u);
  expectInvalid(withCycle({1, 4}), "node 4: it is part of, or below, a cycle of nodes");
  expectInvalid(withCycle({1, 6}), "node 6: it is part of, or below, a cycle of nodes");
  FileBuilder file = withCycle({1, 2});
  file.json["nodes"][5]["mesh"] = file.json["nodes"][5]["skin"] = 0;
  expectInvalid(file, "node 5: it is part of, or below, a cycle of nodes");
  file = withCycle({1, 2});
  file.json["scenes"][0]["nodes"].push_back(3);
  expectInvalid(file, "node 3: it is part of, or below, a cycle of nodes");
  expectInvalid(withNodes({{{"children", {2}}}, {{"children", {2}}}, Json::object()}),
                "node 2: it is a child of both node 0 and node 1");
}

TEST(GltfNode, RefusesBadProperties) {
  expectInvalid(withNodes({{{"children", {5}}}}),
                "node 0: an entry of children is 5, and the file has 1 nodes");
  expectInvalid(withNodes({{{"children", 5}}}), "node 0: children is not an array");
  expectInvalid(withNodes({{{"mesh", 0}}}), "node 0: mesh is 0, and the file has 0 meshes");
  expectInvalid(withNodes({{{"translation", {1, 2}}}}),
                "node 0: translation is not an array of 3 numbers");
  expectInvalid(withNodes({{{"rotation", {1, 2, 3, "x"}}}}),
                "node 0: rotation contains something other than numbers");
  expectInvalid(withNodes({{{"scale", {1, 1, 1e300}}}}),
                "node 0: scale contains a number that is out of range for float32");
  expectInvalid(withNodes({{{"matrix", {1, 0, 0, 0}}}}),
                "node 0: matrix is not an array of 16 numbers");
}

TEST(GltfNode, NotesPropertiesThatHaveNoEffect) {
  EXPECT_EQ(expectNoted(withNodes({{{"children", {1, 1}}}, Json::object()}),
                        "node 0: children lists 1 twice")
                .nodeOrder,
            (std::vector<std::uint32_t>{0, 1}));
  expectNoted(withNodes({{{"matrix", {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}}}),
              "node 0: the fourth row of its matrix is not 0 0 0 1");
  const gltf::Model model = expectNoted(
      withNodes(
          {{{"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}, {"scale", {2, 2, 2}}}}),
      "node 0: it has both matrix and scale");
  EXPECT_EQ(nodeGlobals(model, noIndex, 0)[0][0][0], 1);
  FileBuilder file = skinnedTriangle();
  file.json["nodes"][0].erase("mesh");
  EXPECT_TRUE(expectNoted(file, "node 0: it has skin but no mesh").skinnedPrimitives.empty());
}

TEST(GltfScene, ListsSkinnedPrimitivesByNodeThenPrimitive) {
  FileBuilder file = skinnedTriangle();
  file.json["meshes"][0]["primitives"].push_back(file.primitive());
  // A second node has the same mesh with another skin; the scene names it first.
  file.json["nodes"].push_back({{"mesh", 0}, {"skin", 1}});
  file.json["skins"].push_back({{"joints", {2, 1}}});
  file.json["scenes"][0]["nodes"] = {3, 1, 0};
  const gltf::Model model = loaded(file);
  ASSERT_EQ(model.skinnedPrimitives.size(), 4u);
  const std::uint32_t expected[4][3] = {{0, 0, 0}, {0, 1, 0}, {3, 0, 1}, {3, 1, 1}};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(model.skinnedPrimitives[i].node, expected[i][0]);
    EXPECT_EQ(model.skinnedPrimitives[i].primitive, expected[i][1]);
    EXPECT_EQ(model.skinnedPrimitives[i].skin, expected[i][2]);
    EXPECT_EQ(model.skinnedPrimitives[i].mesh, 0u);
  }
  EXPECT_EQ(model.skins[1].joints, (std::vector<std::uint32_t>{2, 1}));
}

TEST(GltfScene, TakesTheDefaultScene) {
  FileBuilder file = skinnedTriangle();
  file.json["scenes"] = {{{"nodes", {1}}}, {{"nodes", {0, 1}}}};
  file.json["scene"] = 1;
  EXPECT_EQ(loaded(file).skinnedPrimitives.size(), 1u);
  file.json["scene"] = 0;
  gltf::Model model = loaded(file);
  EXPECT_TRUE(model.skinnedPrimitives.empty());
  EXPECT_TRUE(model.meshes.at(0).primitives.empty()) << "decoded though nothing skins it";
  EXPECT_EQ(model.notes.at(0), "1 node left out: outside the default scene");
  file.json.erase("scene");
  EXPECT_TRUE(loaded(file).skinnedPrimitives.empty()) << "without a scene number it is scene 0";
  file.json.erase("scenes");
  model = loaded(file);
  EXPECT_EQ(model.skinnedPrimitives.size(), 1u) << "without scenes it is all root nodes";
  EXPECT_EQ(model.notes.at(0), "the file has no scene: all its nodes are used");
}

TEST(GltfScene, FindsSkinnedNodesBelowTheRoots) {
  FileBuilder file = skinnedTriangle();
  file.json["nodes"].push_back({{"children", {0}}, {"translation", {9, 9, 9}}});
  file.json["scenes"][0]["nodes"] = {1, 3};
  EXPECT_EQ(loaded(file).skinnedPrimitives.size(), 1u);
}

TEST(GltfScene, LeavesOutMeshesWithoutASkin) {
  FileBuilder file = skinnedTriangle();
  file.json["nodes"].push_back({{"mesh", 0}});
  file.json["nodes"].push_back({{"mesh", 0}});
  file.json["scenes"][0]["nodes"] = {0, 1, 3, 4};
  const gltf::Model model = loaded(file);
  EXPECT_EQ(model.skinnedPrimitives.size(), 1u);
  EXPECT_EQ(model.notes.at(0), "2 nodes left out: a mesh but no skin");
}

// A hat on node 4, which is below joint 2; an animated node is between them. The ground, node 5, is
// on no joint.
FileBuilder withHat() {
  FileBuilder file = skinnedTriangle();
  const std::size_t positions = file.addFloats({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const Json triangle = {{"attributes", {{"POSITION", positions}}}};
  file.json["meshes"].push_back({{"name", "hat"}, {"primitives", {triangle, triangle}}});
  file.json["meshes"].push_back({{"name", "ground"}, {"primitives", {triangle}}});
  file.json["nodes"][2]["children"] = {3};
  file.json["nodes"].push_back({{"children", {4}}});
  file.json["nodes"].push_back({{"name", "hat"}, {"mesh", 1}, {"translation", {0, 0.5, 0}}});
  file.json["nodes"].push_back({{"mesh", 2}});
  file.json["scenes"][0]["nodes"] = {0, 1, 5};
  const std::size_t input = file.addFloats({0}, "SCALAR");
  const std::size_t output = file.addFloats({7, 0, 0}, "VEC3");
  file.json["animations"] = {
      {{"samplers", {{{"input", input}, {"output", output}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", 3}, {"path", "translation"}}}}}}}};
  return file;
}

gltf::Model loadedWithRigidMeshes(const FileBuilder& file) {
  return loaded(file.load({}, {.rigidMeshes = true}));
}

TEST(GltfRigidMesh, IsSkinnedToItsNode) {
  const gltf::Model model = loadedWithRigidMeshes(withHat());
  ASSERT_EQ(model.skinnedPrimitives.size(), 3u) << "both primitives of the hat";
  for (const std::uint32_t primitive : {0u, 1u}) {
    const gltf::SkinnedPrimitive& hat = model.skinnedPrimitives[1 + primitive];
    EXPECT_EQ(hat.node, 4u);
    EXPECT_EQ(hat.mesh, 1u);
    EXPECT_EQ(hat.primitive, primitive);
    EXPECT_EQ(hat.skin, 1u);
    const gltf::Influences set = onlySet(model.meshes[1].primitives[primitive]);
    EXPECT_EQ(set.jointType, ComponentType::uint8);
    EXPECT_EQ(set.weightType, ComponentType::unorm8);
    EXPECT_EQ(componentsOf<std::uint8_t>(set.joints), std::vector<std::uint8_t>(12));
    EXPECT_EQ(componentsOf<std::uint8_t>(set.weights),
              (std::vector<std::uint8_t>{255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0}));
  }
  ASSERT_EQ(model.skins.size(), 2u);
  EXPECT_EQ(model.skins[1].name, "hat");
  EXPECT_EQ(model.skins[1].joints, std::vector<std::uint32_t>{4});
  const std::vector<JointMatrix> pose = gltf::pose(model, 1, 0, 0);
  ASSERT_EQ(pose.size(), 1u);
  EXPECT_EQ(pose[0].m[0][3], 7) << "the node between them moves it";
  EXPECT_EQ(pose[0].m[1][3], 1.5f);
  EXPECT_TRUE(hasNote(model, "1 node left out: a mesh but no skin")) << "the ground";
  EXPECT_EQ(loaded(withHat()).skinnedPrimitives.size(), 1u) << "only if requested";
  EXPECT_EQ(loaded(withHat()).skins.size(), 1u);
}

TEST(GltfRigidMesh, MayBeOnAJointAndOnSeveralNodes) {
  FileBuilder file = withHat();
  file.json["nodes"][1]["mesh"] = 1;
  const gltf::Model model = loadedWithRigidMeshes(file);
  ASSERT_EQ(model.skinnedPrimitives.size(), 5u);
  EXPECT_EQ(model.skins.at(1).joints, std::vector<std::uint32_t>{1}) << "a joint itself";
  EXPECT_EQ(model.skins.at(2).joints, std::vector<std::uint32_t>{4});
  EXPECT_EQ(model.skinnedPrimitives[1].mesh, model.skinnedPrimitives[3].mesh);
}

TEST(GltfRigidMesh, NeedsAJointOfSomethingSkinned) {
  FileBuilder file = withHat();
  file.json["nodes"][0].erase("skin");
  EXPECT_TRUE(loadedWithRigidMeshes(file).skinnedPrimitives.empty());
  file = withHat();
  file.json["scenes"][0]["nodes"] = {0, 5};
  EXPECT_EQ(loadedWithRigidMeshes(file).skinnedPrimitives.size(), 1u) << "outside the scene";
}

TEST(GltfRigidMesh, WithASkinElsewhereIsLeftOut) {
  FileBuilder file = withHat();
  file.json["nodes"][4]["mesh"] = 0;
  const gltf::Model model = loadedWithRigidMeshes(file);
  EXPECT_EQ(model.skinnedPrimitives.size(), 1u);
  EXPECT_EQ(componentsOf<float>(onlySet(firstPrimitive(model)).weights)[8], 0.25f)
      << "the skinned mesh keeps its influences";
  EXPECT_TRUE(hasNote(model, "2 nodes left out: a mesh but no skin"));
}

TEST(GltfRigidMesh, IsLeftOutIfItIsFaulty) {
  const auto expectLeftOut = [](const FileBuilder& file, const std::string& fault) {
    const gltf::Model model = loadedWithRigidMeshes(file);
    EXPECT_EQ(model.skinnedPrimitives.size(), 1u) << fault;
    EXPECT_TRUE(hasNote(model, fault)) << testing::PrintToString(model.notes);
    EXPECT_TRUE(hasNote(model, "2 nodes left out: a mesh but no skin"));
    expectError(file.load({}, {.rigidMeshes = true, .strict = true}), ErrorCode::invalidData,
                fault);
  };
  FileBuilder file = withHat();
  Json& hat = file.json["meshes"][1]["primitives"];
  hat[1]["attributes"]["NORMAL"] = file.addFloats({0, 0, 1}, "VEC3");
  expectLeftOut(file, "mesh 1 primitive 1 NORMAL: accessor ");
  file = withHat();
  file.json["meshes"][1]["primitives"][1]["indices"] =
      file.add<std::uint16_t>({0, 1, 3}, "SCALAR", unsignedShortType);
  expectLeftOut(file, "mesh 1 primitive 1: index 2 of accessor ");
  file = withHat();
  file.json["meshes"][1]["primitives"][0]["attributes"]["POSITION"] = 99;
  expectLeftOut(file, "mesh 1 primitive 0");
}

TEST(GltfRigidMesh, CountsAgainstTheBudget) {
  FileBuilder file = withHat();
  constexpr std::uint64_t vertices = 999;
  const Json hat = {
      {"attributes", {{"POSITION", file.addFloats(std::vector<float>(3 * vertices), "VEC3")}}}};
  const auto spent = [&] {
    return loaded(file).memoryLeft - loadedWithRigidMeshes(file).memoryLeft;
  };
  file.json["meshes"][1]["primitives"] = Json::array({hat});
  const std::uint64_t withOne = spent();
  EXPECT_GE(withOne, vertices * (12 + 4 + 8)) << "positions, triangles and influences";
  EXPECT_LE(withOne, vertices * (12 + 4 + 8) + 1000);
  file.json["meshes"][1]["primitives"] = {hat, hat};
  EXPECT_LE(spent(), withOne + 100) << "influences are shared, too";
  file.json["nodes"][1]["mesh"] = 1;
  EXPECT_GE(spent(), withOne + sizeof(gltf::Skin) + sizeof(JointMatrix)) << "a second skin";
}

TEST(GltfScene, LoadsAFileWithNothingInIt) {
  const gltf::Model model = loaded(FileBuilder());
  EXPECT_TRUE(model.nodes.empty());
  EXPECT_TRUE(model.skinnedPrimitives.empty());
  EXPECT_TRUE(nodeGlobals(model, noIndex, 0).empty());
  EXPECT_TRUE(gltf::pose(model, 0, noIndex, 0).empty());
}

TEST(GltfScene, RefusesBadScenes) {
  FileBuilder file = skinnedTriangle();
  file.json["scene"] = 1;
  expectInvalid(file, "the file: scene is 1, and the file has 1 scenes");
  file.json["scene"] = 0;
  file.json["scenes"][0]["nodes"] = {0, 7};
  expectInvalid(file, "scene 0: an entry of nodes is 7, and the file has 3 nodes");
  file.json["scenes"][0]["nodes"] = {0, 2};
  expectInvalid(file, "scene 0: node 2 is not a root but a child of node 1");
  // It is there anyway.
  file.json["scenes"][0]["nodes"] = {2, 0, 1};
  EXPECT_EQ(expectNoted(file, "scene 0: node 2 is not a root but a child of node 1")
                .skinnedPrimitives.size(),
            1u);
}

TEST(GltfSkin, TakesIdentitiesWhereThereAreNoMatrices) {
  const gltf::Model model = loaded(skinnedTriangle());
  const auto matrices = gltf::pose(model, 0, noIndex, 0);
  ASSERT_EQ(matrices.size(), 2u);
  EXPECT_EQ(matrices[0].m[0][0], 1.0f);
  EXPECT_EQ(matrices[0].m[1][3], 0.0f);
  EXPECT_EQ(matrices[1].m[1][3], 1.0f);
}

std::vector<float> matrixByColumns(float scale, float x, float y, float z) {
  return {scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0, x, y, z, 1};
}

TEST(GltfSkin, MultipliesJointByInverseBindMatrix) {
  FileBuilder file = skinnedTriangle();
  std::vector<float> matrices = matrixByColumns(1, 0, 0, 0);
  const auto second = matrixByColumns(2, 5, 6, 7);
  matrices.insert(matrices.end(), second.begin(), second.end());
  matrices.insert(matrices.end(), second.begin(), second.end());  // One more than needed.
  file.json["skins"][0]["inverseBindMatrices"] = file.addFloats(matrices, "MAT4");
  const auto result = gltf::pose(loaded(file), 0, noIndex, 0);
  ASSERT_EQ(result.size(), 2u);
  // Joint 2 stands at y = 1: its translation is added to what the matrix does.
  EXPECT_EQ(result[1].m[0][0], 2.0f);
  EXPECT_EQ(result[1].m[0][3], 5.0f);
  EXPECT_EQ(result[1].m[1][3], 7.0f);
  EXPECT_EQ(result[1].m[2][3], 7.0f);
}

// glTF 2.0, 3.7.3.3: a skinned mesh goes where its joints are, not where its node is.
TEST(GltfSkin, IgnoresTheSkinnedNodesTransform) {
  FileBuilder file = skinnedTriangle();
  const auto still = gltf::pose(loaded(file), 0, noIndex, 0);
  file.json["nodes"][0]["translation"] = {100, 200, 300};
  const auto moved = gltf::pose(loaded(file), 0, noIndex, 0);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(std::memcmp(&still[i], &moved[i], sizeof still[i]), 0);
  }
}

TEST(GltfSkin, FollowsNodesThatAreNoJoints) {
  FileBuilder file = skinnedTriangle();
  // 1 is a joint, 3 between them is none, 2 is a joint again; the root above is outside the scene.
  file.json["nodes"] = {{{"mesh", 0}, {"skin", 0}},
                        {{"children", {3}}},
                        {{"translation", {0, 1, 0}}},
                        {{"children", {2}}, {"translation", {0, 0, 5}}},
                        {{"children", {1}}, {"scale", {2, 2, 2}}}};
  file.json["scenes"][0]["nodes"] = {0};
  const auto matrices = gltf::pose(loaded(file), 0, noIndex, 0);
  EXPECT_EQ(matrices[1].m[0][0], 2.0f);
  EXPECT_EQ(matrices[1].m[1][3], 2.0f);
  EXPECT_EQ(matrices[1].m[2][3], 10.0f);
}

TEST(GltfSkin, NotesJointsWithoutACommonRoot) {
  FileBuilder file = skinnedTriangle();
  file.json["skins"][0]["joints"] = {1, 0};
  EXPECT_EQ(expectNoted(file, "skin 0: its joints have no").notes.at(0),
            "skin 0: its joints have no common root");
}

TEST(GltfSkin, RefusesBadSkins) {
  FileBuilder file = skinnedTriangle();
  Json& skin = file.json["skins"][0];
  skin["joints"] = {1, 9};
  expectInvalid(file, "skin 0: an entry of joints is 9, and the file has 3 nodes");
  skin["joints"] = {1, 1};
  EXPECT_EQ(expectNoted(file, "skin 0: joints lists 1 twice").skins[0].joints,
            (std::vector<std::uint32_t>{1, 1}))
      << "each place in the list has its own matrix";
  skin["joints"] = Json::array();
  expectInvalid(file, "skin 0: joints is an empty array");
  skin.erase("joints");
  expectInvalid(file, "skin 0: it has no joints");
  skin["joints"] = {1, 2};
  skin["skeleton"] = 3;
  expectNoted(file, "skin 0: skeleton is 3, and the file has 3 nodes");
  skin.erase("skeleton");
  skin["inverseBindMatrices"] = 8;
  expectInvalid(file, "skin 0: inverseBindMatrices is 8, and the file has 3 accessors");
  skin["inverseBindMatrices"] = 0;
  expectInvalid(file, "skin 0 inverseBindMatrices: accessor 0 is VEC3 of float, not MAT4 of float");
  file.json["nodes"][0]["skin"] = 1;
  expectInvalid(file, "node 0: skin is 1, and the file has 1 skins");
  file.json["skins"] = Json::array();
  expectInvalid(file, "node 0: skin is 1, and the file has 0 skins");
  file.json["nodes"][0].erase("skin");
  expectNoted(file, "'skins' is an empty array");
}

// Its place in the list remains, so that others keep their numbers.
TEST(GltfSkin, LeavesOutABrokenSkinThatNoNodeUses) {
  FileBuilder file = skinnedTriangle();
  file.json["skins"].insert(file.json["skins"].begin(),
                            Json{{"joints", {1, 9}}, {"name", "broken"}});
  file.json["nodes"][0]["skin"] = 1;
  gltf::Model model = expectNoted(file, "skin 0: an entry of joints is 9");
  ASSERT_EQ(model.skins.size(), 2u);
  EXPECT_TRUE(model.skins[0].joints.empty());
  EXPECT_TRUE(gltf::pose(model, 0, noIndex, 0).empty());
  EXPECT_EQ(model.skinnedPrimitives.at(0).skin, 1u);
  file.json["skins"][0] = {{"joints", {1, 2}}, {"inverseBindMatrices", 0}};
  model = expectNoted(file, "skin 0 inverseBindMatrices: accessor 0 is VEC3 of float, not MAT4");
  EXPECT_TRUE(model.skins[0].joints.empty());
  EXPECT_EQ(gltf::pose(model, 1, noIndex, 0).size(), 2u);
}

TEST(GltfSkin, RefusesBadMatrices) {
  const auto withMatrices = [](std::vector<float> matrices) {
    FileBuilder file = skinnedTriangle();
    file.json["skins"][0]["inverseBindMatrices"] = file.addFloats(matrices, "MAT4");
    return file;
  };
  const auto two = [](std::size_t place, float value) {
    std::vector<float> matrices = matrixByColumns(1, 0, 0, 0);
    matrices.insert(matrices.end(), matrices.begin(), matrices.begin() + 16);
    matrices[place] = value;
    return matrices;
  };
  expectInvalid(withMatrices(matrixByColumns(1, 0, 0, 0)),
                "skin 0 inverseBindMatrices: accessor 3 has 1 matrices for 2 joints");
  expectInvalid(withMatrices(two(20, std::numeric_limits<float>::quiet_NaN())),
                "skin 0: inverse bind matrix 1 contains a number that is not finite");
  expectInvalid(withMatrices(two(0, std::numeric_limits<float>::infinity())),
                "skin 0: inverse bind matrix 0 contains a number that is not finite");
  expectInvalid(withMatrices(two(19, 0.5f)),
                "skin 0: inverse bind matrix 1: its fourth row is not 0 0 0 1");
  loaded(withMatrices(two(19, 1e-7f)));
  expectNoted(
      withMatrices(two(19, 1e-4f)),
      "skin 0: inverse bind matrix 1: its fourth row is not exactly 0 0 0 1; it is ignored");
}

}  // namespace
}  // namespace dermis::test
