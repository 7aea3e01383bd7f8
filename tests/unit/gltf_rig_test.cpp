// Rigs as JSON: what they do to a model, and the sentence about each mistake.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/rig.h"
#include "gltf_builder.h"

namespace dermis::test {
namespace {

using Floats = std::vector<float>;
using Rig = Result<std::shared_ptr<const RigView>>;

/// An arm along x, whose skin has these joints: 0 'upper' at 0, 1 'twist' at 1.5, below 2 'lower'
/// at 1, 3 'hand' at 2, 4 'muscle' at 0.5, below 'upper'. Six vertices: one for each joint, and one
/// half way between upper and lower, at 0.5. Targets 'bent' and 'smile'.
FileBuilder arm() {
  FileBuilder file;
  const std::size_t positions =
      file.addFloats({0, 0, 0, 1.5f, 0, 0, 1, 0, 0, 2, 0, 0, 0.5f, 1, 0, 0.5f, 0, 0}, "VEC3");
  const std::size_t joints = file.add<std::uint8_t>(
      {0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, 0, 2, 0, 0}, "VEC4",
      unsignedByteType);
  const std::size_t weights = file.addFloats(
      {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0.5f, 0.5f, 0, 0}, "VEC4");
  const std::size_t bent =
      file.addFloats({0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0}, "VEC3");
  const std::size_t smile =
      file.addFloats({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  file.json["meshes"] = {
      {{"primitives",
        {{{"attributes", {{"POSITION", positions}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}},
          {"targets", {{{"POSITION", bent}}, {{"POSITION", smile}}}}}}},
       {"weights", {0.125, 0.25}},
       {"extras", {{"targetNames", {"bent", "smile"}}}}}};
  Floats matrices;
  for (const float x : {0.0f, 1.5f, 1.0f, 2.0f, 0.5f})
    for (const float number :
         {1.f, 0.f, 0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 0.f, 1.f, 0.f, -x, 0.f, 0.f, 1.f})
      matrices.push_back(number);
  file.json["skins"] = {
      {{"joints", {1, 3, 2, 4, 5}}, {"inverseBindMatrices", file.addFloats(matrices, "MAT4")}}};
  file.json["nodes"] = {{{"mesh", 0}, {"skin", 0}},
                        {{"name", "upper"}, {"children", {2, 5}}},
                        {{"name", "lower"}, {"translation", {1, 0, 0}}, {"children", {3, 4}}},
                        {{"name", "twist"}, {"translation", {0.5, 0, 0}}},
                        {{"name", "hand"}, {"translation", {1, 0, 0}}},
                        {{"name", "muscle"}, {"translation", {0.5, 0, 0}}}};
  file.json["scenes"] = {{{"nodes", {0, 1}}}};
  file.json["scene"] = 0;
  return file;
}

const char* const allDrivers = R"({"drivers": [
  {"twist": "twist", "source": "hand", "axis": [2, 0, 0], "share": 0.25},
  {"corrective": ["lower"], "radius": 0.5, "examples": [
    {"rotations": [[0, 0, 0, 1]]},
    {"rotations": [[0, 0, 1, 1]], "weights": {"bent": 2}}]},
  {"chain": ["upper", "lower", "hand"], "segments": 4},
  {"linear": "muscle", "terms": [
    {"weight": "smile", "matrix": [0, 0, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0]},
    {"weight": "bent", "matrix": [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]}]}]})";

/// A joint's matrix that turns about an axis through the point (x, 0, 0).
JointMatrix turned(int axis, float x, double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  const auto c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
  if (axis == 0) return {{{1, 0, 0, 0}, {0, c, -s, 0}, {0, s, c, 0}}};
  return {{{c, -s, 0, x - c * x}, {s, c, 0, -s * x}, {0, 0, 1, 0}}};
}

void expectNear(const JointMatrix& a, const JointMatrix& b, const std::string& what) {
  for (int i = 0; i < 12; ++i)
    EXPECT_NEAR(a.m[i / 4][i % 4], b.m[i / 4][i % 4], 2e-6) << what << ", number " << i;
}

TEST(GltfRig, EachDriverDoesWhatTheTextSays) {
  gltf::Model model = loaded(arm());
  const Rig rig = gltf::applyRig(model, 0, allDrivers);
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  const RigView& view = **rig;
  ASSERT_EQ(view.writtenJoints, 3u);  // upper, lower, hand
  ASSERT_EQ(view.joints.size(), 8u);  // twist, muscle, three of the chain
  EXPECT_EQ(view.joints[1].parent, 0u);
  EXPECT_EQ(view.joints[2].parent, 1u);
  EXPECT_EQ(view.joints[3].parent, 1u);
  EXPECT_EQ(view.joints[4].parent, 0u);
  EXPECT_EQ(view.joints[3].bind.m[0][3], 1.5f);
  EXPECT_EQ(view.weightsOf, 0u);
  EXPECT_EQ(view.givenWeights, 1u);
  EXPECT_EQ(view.drivenWeights, 1u);

  const Result<PackedRig> packed = packRig(view);
  ASSERT_TRUE(packed.ok()) << packed.error().message;
  std::vector<JointMatrix> driven(5);
  Floats weights(2);
  // The lower arm bends by 90 degrees, and the hand is twisted by 80 more.
  const JointMatrix bend = turned(2, 1, 90), twist = turned(0, 0, 80);
  JointMatrix hand{};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      hand.m[row][column] = column == 3 ? bend.m[row][3] : 0;
      for (int i = 0; i < 3; ++i) hand.m[row][column] += bend.m[row][i] * twist.m[i][column];
    }
  }
  ASSERT_TRUE(
      evaluateRig(*packed, std::vector<JointMatrix>{{}, bend, hand}, Floats{0.5f}, driven, weights)
          .ok());
  EXPECT_NEAR(weights[1], 2, 1e-5);
  JointMatrix quarter{};
  const JointMatrix share = turned(0, 0, 20);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      quarter.m[row][column] = column == 3 ? bend.m[row][3] : 0;
      for (int i = 0; i < 3; ++i) quarter.m[row][column] += bend.m[row][i] * share.m[i][column];
    }
  }
  expectNear(driven[0], quarter, "twist");
  JointMatrix moved{{{1, 0, 0, 2}, {0, 1, 0, 0}, {0, 0, 1, 2}}};
  expectNear(driven[1], moved, "linear");
  // The joint of the chain in its middle is on the curve where the lower arm is.
  const JointMatrix& middle = driven[3];
  EXPECT_NEAR(middle.m[0][0] + middle.m[0][3], 1, 2e-6);
  EXPECT_NEAR(middle.m[1][0] + middle.m[1][3], 0, 2e-6);
}

TEST(GltfRig, TheModelHasTheNumbersOfTheRig) {
  FileBuilder file = arm();
  const std::size_t input = file.addFloats({0, 1}, "SCALAR");
  const std::size_t output = file.addFloats({3, 4, 5, 6}, "SCALAR");
  file.json["animations"] = {
      {{"samplers", {{{"input", input}, {"output", output}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}}}}}};
  gltf::Model model = loaded(file);
  const gltf::Primitive old = firstPrimitive(model);
  const Rig rig = gltf::applyRig(model, 0, allDrivers);
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  EXPECT_EQ(model.skins[0].joints, (std::vector<std::uint32_t>{1, 2, 4}));
  ASSERT_EQ(model.skins[0].inverseBindMatrices.size(), 3u);
  EXPECT_EQ(model.skins[0].inverseBindMatrices[2].m[0][3], -2);
  EXPECT_EQ(gltf::pose(model, 0, noIndex, 0).size(), 3u);

  const gltf::Primitive primitive = firstPrimitive(model);
  const gltf::Influences set = onlySet(primitive);
  ASSERT_EQ(set.jointType, ComponentType::uint16);
  ASSERT_EQ(set.weightType, ComponentType::float32);
  const auto joints = componentsOf<std::uint16_t>(set.joints);
  const auto weights = componentsOf<float>(set.weights);
  const auto only = [&](std::size_t vertex, std::uint16_t joint, float weight) {
    float sum = 0;
    for (std::size_t i = vertex * 4; i < vertex * 4 + 4; ++i)
      if (joints[i] == joint) sum += weights[i];
    EXPECT_FLOAT_EQ(sum, weight) << "vertex " << vertex << ", joint " << joint;
  };
  only(0, 0, 1);  // at the beginning of the chain
  only(1, 3, 1);  // 'twist', which is no joint of the chain
  only(2, 6, 1);  // in its middle
  only(3, 2, 1);  // at its end
  only(4, 4, 1);  // 'muscle'
  only(5, 5, 1);  // where the first two segments meet

  // 'smile', then 'bent'.
  ASSERT_EQ(primitive.morphTargets.size(), 2u);
  EXPECT_EQ(primitive.morphTargets[0].positions, old.morphTargets[1].positions);
  EXPECT_EQ(primitive.morphTargets[1].positions, old.morphTargets[0].positions);
  EXPECT_EQ(model.meshes[0].morphTargetCount, 1u);
  EXPECT_EQ(model.meshes[0].morphTargetNames, (std::vector<std::string>{"smile", "bent"}));
  EXPECT_EQ(gltf::morphWeights(model, 0, noIndex, 0), Floats{0.25f});
  EXPECT_EQ(gltf::morphWeights(model, 0, 0, 1), Floats{6});
  EXPECT_EQ(gltf::skeleton(model).nodes[0].weights.size(), 1u);
}

// Its joints would no longer be those of the first rig, which the vertices have.
TEST(GltfRig, CannotBeAppliedTwice) {
  for (const char* const second :
       {R"({"drivers": [{"twist": "lower", "source": "upper", "axis": [1, 0, 0]}]})",
        R"({"drivers": [{"corrective": ["lower"], "examples": [
             {"rotations": [[0, 0, 1, 0]], "weights": {"smile": 1}}]}]})"}) {
    gltf::Model model = loaded(arm());
    ASSERT_TRUE(gltf::applyRig(model, 0, R"({"drivers": [
        {"twist": "twist", "source": "hand", "axis": [1, 0, 0]},
        {"linear": "muscle", "terms": []}]})")
                    .ok());
    const gltf::Model before = model;
    const Rig rig = gltf::applyRig(model, 0, second);
    ASSERT_FALSE(rig.ok()) << second;
    EXPECT_EQ(rig.error().code, ErrorCode::invalidData);
    EXPECT_EQ(rig.error().message,
              "skin 0 has 3 joints, but vertex 1 of mesh 0 follows joint 3: the file is wrong, "
              "or a rig was applied to the skin before");
    EXPECT_EQ(model.skins[0].joints, before.skins[0].joints);
    EXPECT_EQ(onlySet(firstPrimitive(model)).joints, onlySet(firstPrimitive(before)).joints);
  }
}

// Slots without weight may have any number.
TEST(GltfRig, IgnoresJointsWithoutWeight) {
  gltf::Model model = loaded(arm());
  gltf::Influences& set = model.meshes[0].primitives[0].influences[0];
  ASSERT_EQ(set.jointType, ComponentType::uint8);
  std::vector<std::byte> joints(set.joints.values());
  joints[3] = std::byte{200};
  set.joints = joints;
  const Rig rig = gltf::applyRig(model, 0, allDrivers);
  EXPECT_TRUE(rig.ok()) << rig.error().message;
}

TEST(GltfRig, OtherSkinsKeepTheirMesh) {
  FileBuilder file = arm();
  file.json["skins"].push_back({{"joints", {1, 2, 3, 4, 5}}});
  file.json["nodes"].push_back({{"mesh", 0}, {"skin", 1}});
  file.json["scenes"][0]["nodes"].push_back(6);
  gltf::Model model = loaded(file);
  const gltf::Model before = model;
  const Rig rig = gltf::applyRig(model, 0, allDrivers);
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  ASSERT_EQ(model.meshes.size(), 2u);
  EXPECT_EQ(model.nodes[6].mesh, 0u);
  EXPECT_EQ(model.nodes[0].mesh, 1u);
  EXPECT_EQ(model.skinnedPrimitives[0].mesh, 1u);
  EXPECT_EQ(model.skinnedPrimitives[1].mesh, 0u);
  EXPECT_EQ(onlySet(firstPrimitive(model)).joints, onlySet(firstPrimitive(before)).joints);
  EXPECT_EQ(model.meshes[0].morphTargetCount, 2u);
  EXPECT_EQ(model.meshes[1].morphTargetCount, 1u);
}

TEST(GltfRig, IsInTheExtrasOfTheSkin) {
  FileBuilder file = arm();
  EXPECT_EQ(loaded(file).skins[0].rig, "");
  file.json["skins"][0]["extras"] = {{"dermis_rig", Json::parse(allDrivers)}, {"other", 1}};
  gltf::Model model = loaded(file);
  EXPECT_EQ(Json::parse(model.skins[0].rig), Json::parse(allDrivers));
  EXPECT_TRUE(gltf::applyRig(model, 0, model.skins[0].rig).ok());
  // Whatever else stands there.
  file.json["skins"][0]["extras"] = {1, 2};
  file.json["meshes"][0]["extras"] = {{"targetNames", 3}};
  EXPECT_EQ(loaded(file).skins[0].rig, "");
  EXPECT_TRUE(loaded(file).meshes[0].morphTargetNames.empty());
}

TEST(GltfRig, NumbersStandForNames) {
  FileBuilder file = arm();
  file.json["nodes"][3]["name"] = "hand";  // twice
  gltf::Model model = loaded(file);
  const Rig rig = gltf::applyRig(model, 0, R"({"drivers": [
    {"twist": 1, "source": 3, "axis": [1, 0, 0]},
    {"corrective": ["lower"], "examples": [{"rotations": [[0, 0, 1, 0]], "weights": {"0": 1}}]}]})");
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  EXPECT_EQ((*rig)->twists[0].joint, 4u);
  EXPECT_EQ((*rig)->twists[0].source, 2u);
  EXPECT_EQ((*rig)->twists[0].share, 0.5f);
  EXPECT_EQ(model.meshes[0].morphTargetNames, (std::vector<std::string>{"smile", "bent"}));
}

/// A mesh without the driven target gets no targets; one with some of them gets all.
TEST(GltfRig, AllMeshesOfTheSkinHaveTheDrivenTargets) {
  FileBuilder file = arm();
  Json other = file.json["meshes"][0];
  other["extras"]["targetNames"] = {"left", "bent"};
  file.json["meshes"].push_back(other);
  file.json["nodes"].push_back({{"mesh", 1}, {"skin", 0}});
  file.json["scenes"][0]["nodes"].push_back(6);
  gltf::Model model = loaded(file);
  const Rig rig = gltf::applyRig(model, 0, R"({"drivers": [
    {"corrective": ["lower"], "examples": [
      {"rotations": [[0, 0, 1, 0]], "weights": {"smile": 1, "left": 1}}]}]})");
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  const std::vector<gltf::MorphTarget>& first = model.meshes[0].primitives[0].morphTargets;
  const std::vector<gltf::MorphTarget>& second = model.meshes[1].primitives[0].morphTargets;
  ASSERT_EQ(first.size(), 3u);  // bent, left, smile
  EXPECT_TRUE(first[1].positions.empty());
  EXPECT_EQ(first[2].positions[2], 1);
  ASSERT_EQ(second.size(), 3u);
  EXPECT_EQ(second[1].positions[1], 1);
  EXPECT_TRUE(second[2].positions.empty());
}

TEST(GltfRig, EachMistakeHasASentence) {
  const std::string twist = R"({"twist": "twist", "source": "hand", "axis": [1, 0, 0]})";
  const std::string corrective = R"({"corrective": ["lower"], "examples": )";
  const auto expectMistake = [](const std::string& text, const std::string& sentence) {
    gltf::Model model = loaded(arm());
    const Rig rig = gltf::applyRig(model, 0, text);
    ASSERT_FALSE(rig.ok()) << text;
    EXPECT_NE(rig.error().message.find(sentence), std::string::npos)
        << rig.error().message << "\ninstead of: " << sentence;
    EXPECT_EQ(model.skins[0].joints.size(), 5u) << "the model changed";
    EXPECT_EQ(model.meshes[0].morphTargetCount, 2u);
  };
  expectMistake("[]", "the rig is not an object");
  expectMistake("{}", "the rig: it has no drivers");
  expectMistake(R"({"drivers": 1})", "drivers is not an array");
  expectMistake(R"({"drivers": [], "weights": []})",
                "the rig: the member 'weights' is unknown; known are drivers");
  expectMistake("{\"drivers\": [", "the JSON text is invalid at byte 14");
  expectMistake("{\n\"drivers\":\n  [,]}", "the JSON text is invalid in line 3, column 4");
  expectMistake("{\n\"drivers: [\n]}", "the JSON text is invalid in line 2, column 12");
  const std::vector<std::pair<std::string, std::string>> drivers = {
      {"7", "driver 0 is not an object"},
      {"{}", "driver 0: it has none of twist, corrective, chain, linear"},
      {R"({"aim": 1, "axis": []})",
       "driver 0: it has none of twist, corrective, chain, linear, but 'aim'"},
      {twist + ", {\"twist\": 3}", "driver 1: it has no source"},
      {R"({"twist": "wrist", "source": 0, "axis": [1, 0, 0]})",
       "driver 0: twist: the skin has no joint 'wrist'"},
      {R"({"twist": 5, "source": 0, "axis": [1, 0, 0]})", "the skin has no joint '5'"},
      {R"({"twist": -1, "source": 0, "axis": [1, 0, 0]})", "twist is not an integer"},
      {R"({"twist": {}, "source": 0, "axis": [1, 0, 0]})", "twist is neither a name nor a number"},
      {R"({"twist": 1, "source": 3, "axis": [1, 0]})", "axis is not an array of 3 numbers"},
      {R"({"twist": 1, "source": 3, "axis": [0, 0, 0]})", "driver 0: axis is 0"},
      {R"({"twist": 1, "source": 3, "axis": [1e39, 0, 0]})", "out of range for float32"},
      {R"({"twist": 1, "source": 3, "axis": [1, 0, 0], "share": 2})",
       "share is 2, which is not from -1 to 1"},
      {R"({"twist": 1, "source": 3, "axis": [1, 0, 0], "shares": 1})",
       "driver 0: the member 'shares' is unknown; known are axis, share, source, twist"},
      {twist + "," + twist, "driver 1: driver 0 drives the joint 'twist', too"},
      {R"({"twist": "twist", "source": "twist", "axis": [1, 0, 0]})",
       "driver 0 is part of, or reads, a cycle of drivers"},
      {twist + R"(,{"corrective": [], "examples": []})", "driver 1: corrective lists no joint"},
      {corrective + "[]}", "there are 0 examples; 1 to 64 are allowed"},
      {corrective + R"([{"rotations": []}]})", "example 0: there are 0 rotations for 1 joint"},
      {corrective + R"([{"rotations": [[0, 0, 0, 0]]}]})", "example 0: rotations[0] is 0"},
      {corrective + R"([{"rotations": [[0, 0, 0, 1]], "weights": {"x": 1}}]})",
       "driver 0: no mesh of the skin has the morph target 'x'"},
      {corrective + R"([{"rotations": [[0, 0, 0, 1]], "weights": {"bent": "1"}}]})",
       "example 0: the weight 'bent' is not a number"},
      {R"({"corrective": ["lower"], "radius": -1, "examples": []})",
       "driver 0: radius is -1, which is negative"},
      {R"({"corrective": ["lower"], "radius": 1e-50, "examples": []})",
       "driver 0: radius is 1e-50, which is too small for float32"},
      {corrective + R"([{"rotations": [[0, 0, 0, 1]], "weights": {"bent": 1, "00": 1}}]})",
       "driver 0: the weights '00' and 'bent' are the same morph target of mesh 0; write one of "
       "them"},
      {corrective + R"([{"rotations": [[0, 0, 0, 1]], "weights": {"1": 1}}]}, )" + corrective +
           R"([{"rotations": [[0, 0, 0, 1]], "weights": {"01": 1}}]})",
       "driver 1: the weights '1' and '01' are the same morph target of mesh 0; write one of them"},
      {corrective + R"([{"rotations": [[0, 0, 0, 1]], "weights": {"bent": 1}}]}, )" + corrective +
           R"([{"rotations": [[0, 0, 0, 1]], "weights": {"bent": 1}}]})",
       "driver 1: driver 0 drives the weight 'bent', too"},
      {corrective + R"([{"rotations": [[0, 0, 0, 1]], "joints": {"muscle": {}, "4": {}}}]})",
       "driver 0: example 0: joints: '4' and 'muscle' are the same joint; write one of them"},
      {corrective + R"([{"rotations": [[0, 0, 0, 1]], "joints": {"twist": {"turn": 1}}}]})",
       "example 0: joint 'twist': the member 'turn' is unknown; known are rotation, scale, "
       "translation"},
      {corrective + R"([{"rotations": [[0, 0, 0, 1]]}]})", "driver 0 drives nothing"},
      {corrective + R"([{"rotations": [[0, 0, 0, 1]], "weights": {"bent": 1}},
                        {"rotations": [[0, 0, 0, -1]], "weights": {"bent": 0}}]})",
       "driver 0"},
      {R"({"chain": ["hand"], "segments": 2})", "chain lists less than two joints"},
      {R"({"chain": ["lower", "hand"], "segments": 1})", "segments is 1, which is not from 2"},
      {R"({"chain": ["lower", "hand"], "segments": 2.5})", "segments is not an integer"},
      {R"({"chain": ["hand", "hand"], "segments": 2})", "chain lists the joint 'hand' twice"},
      {R"({"chain": ["hand", "lower"], "segments": 2})",
       "chain: the joint 'lower' is above 'hand'; list joints from the root to the tip"},
      {R"({"chain": ["lower", "hand"], "segments": 65534})", "the rig has 65538 joints"},
      {R"({"linear": "muscle", "terms": [{"weight": "x", "matrix": [0,0,0,0,0,0,0,0,0,0,0,0]}]})",
       "no mesh of the skin has the morph target 'x'"},
      {R"({"linear": "muscle", "terms": [{"weight": "smile", "matrix": [1]}]})",
       "term 0: matrix is not an array of 12 numbers"},
  };
  for (const auto& [text, sentence] : drivers)
    expectMistake("{\"drivers\": [" + text + "]}", sentence);
  gltf::Model model = loaded(arm());
  EXPECT_EQ(gltf::applyRig(model, 1, "{}").error().code, ErrorCode::invalidArgument);
}

/// Text with many elements.
template <typename Element>
std::string listOf(int count, Element element) {
  std::string text;
  for (int i = 0; i < count; ++i) text += std::string(i == 0 ? "" : ",") + element(i);
  return text;
}

/// More meshes of the skin, equal to the first one.
void addMeshes(gltf::Model& model, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    gltf::Node node = model.nodes[0];
    node.mesh = static_cast<std::uint32_t>(model.meshes.size());
    model.nodeOrder.push_back(static_cast<std::uint32_t>(model.nodes.size()));
    model.nodes.push_back(node);
    model.meshes.push_back(model.meshes[0]);
  }
}

/// Each mesh is searched for each driven weight. That takes time, which the budget limits.
TEST(GltfRig, CountsMeshesTimesWeights) {
  constexpr int weights = 600;
  const std::string text =
      R"({"drivers": [{"corrective": ["lower"], "examples": [{"rotations": [[0, 0, 0, 1]],
          "weights": {)" +
      listOf(weights, [](int i) { return "\"" + std::to_string(i + 2) + "\": 1"; }) + "}}]}]}";
  gltf::Model model = loaded(arm());
  addMeshes(model, 500);
  model.meshes.back().morphTargetCount = weights + 2;
  model.meshes.back().morphWeights.resize(weights + 2);
  model.memoryLeft = std::uint64_t{8} << 20;
  gltf::Model without = model;
  const Rig refused = gltf::applyRig(model, 0, text);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::limitExceeded);
  EXPECT_NE(refused.error().message.find("the morph targets of a rig"), std::string::npos)
      << refused.error().message;

  // Those without targets are not searched.
  for (std::size_t mesh = 0; mesh + 1 < without.meshes.size(); ++mesh)
    without.meshes[mesh].morphTargetCount = 0;
  const Rig rig = gltf::applyRig(without, 0, text);
  EXPECT_TRUE(rig.ok()) << rig.error().message;
}

/// Takes half a minute if each chain looks at each vertex.
TEST(GltfRig, ManyChainsThatMoveNoVertexTakeNoTime) {
  constexpr std::uint32_t count = 40'000;
  gltf::Model model = loaded(arm());
  gltf::Primitive& primitive = model.meshes[0].primitives[0];
  primitive.morphTargets.clear();
  primitive.vertexCount = count;
  primitive.positions = std::vector<float>(count * 3);
  gltf::Influences& set = primitive.influences[0];
  set.joints = std::vector<std::byte>(count * 4);
  ASSERT_EQ(set.weightType, ComponentType::float32);
  std::vector<float> weights(count * 4);
  for (std::size_t i = 0; i < count; ++i) weights[i * 4] = 1;
  const auto bytes = std::as_bytes(std::span(weights));
  set.weights = std::vector<std::byte>(bytes.begin(), bytes.end());
  const Rig rig = gltf::applyRig(model, 0, "{\"drivers\": [" + listOf(5000, [](int) {
                                             return R"({"chain": [2, 3], "segments": 2})";
                                           }) + "]}");
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  EXPECT_TRUE(componentsOf<std::uint16_t>(onlySet(firstPrimitive(model)).joints) ==
              std::vector<std::uint16_t>(std::size_t{count} * 4));
}

/// A vertex that one chain moves to its end may be on the next one.
TEST(GltfRig, ChainsBindOneAfterTheOther) {
  gltf::Model model = loaded(arm());
  const Rig rig = gltf::applyRig(model, 0, R"({"drivers": [
    {"chain": ["upper", "lower"], "segments": 2}, {"chain": ["lower", "hand"], "segments": 2}]})");
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  const gltf::Influences set = onlySet(firstPrimitive(model));
  const auto joints = componentsOf<std::uint16_t>(set.joints);
  const auto weights = componentsOf<float>(set.weights);
  const auto only = [&](std::size_t vertex, std::uint16_t joint) {
    float sum = 0;
    for (std::size_t i = vertex * 4; i < vertex * 4 + 4; ++i)
      if (joints[i] == joint) sum += weights[i];
    EXPECT_FLOAT_EQ(sum, 1) << "vertex " << vertex << ", joint " << joint;
  };
  only(0, 0);
  only(1, 1);
  only(2, 2);
  only(3, 3);
  only(4, 4);
  only(5, 5);  // in the middle of the first
}

TEST(GltfRig, CountsPrimitivesTimesChains) {
  gltf::Model model = loaded(arm());
  gltf::Mesh& mesh = model.meshes[0];
  mesh.primitives[0].morphTargets.clear();
  mesh.primitives[0].influences[0].joints = std::vector<std::byte>(6 * 4);
  for (int i = 0; i < 300; ++i) {
    mesh.primitives.push_back(mesh.primitives[0]);
    mesh.primitives.back().positions = std::vector<float>(mesh.primitives[0].positions.values());
  }
  model.memoryLeft = std::uint64_t{4} << 20;
  const Rig rig = gltf::applyRig(model, 0, "{\"drivers\": [" + listOf(1000, [](int) {
                                             return R"({"chain": [1, 3], "segments": 2})";
                                           }) + "]}");
  ASSERT_FALSE(rig.ok());
  EXPECT_EQ(rig.error().code, ErrorCode::limitExceeded);
}

TEST(GltfRig, NotesJointsBelowADrivenOne) {
  gltf::Model model = loaded(arm());
  const std::size_t before = model.notes.size();
  ASSERT_TRUE(gltf::applyRig(model, 0, R"({"drivers": [{"twist": "lower", "source": "upper",
                                           "axis": [1, 0, 0]}]})")
                  .ok());
  ASSERT_EQ(model.notes.size(), before + 1);
  EXPECT_EQ(
      model.notes.back(),
      "the rig of skin 0: 'twist' and 1 other joint below the driven joint 'lower' follow the "
      "node, not the driver");
}

TEST(GltfRig, ASingularBindMatrixIsAMistakeOnlyIfADriverReadsIt) {
  FileBuilder file = arm();
  file.json["skins"][0].erase("inverseBindMatrices");
  Floats zeros(5 * 16, 0.0f);
  for (std::size_t joint = 0; joint < 5; ++joint) {
    zeros[joint * 16 + 15] = 1;
    if (joint == 3) continue;
    for (std::size_t i = 0; i < 3; ++i) zeros[joint * 16 + 5 * i] = 1;
  }
  file.json["skins"][0]["inverseBindMatrices"] = file.addFloats(zeros, "MAT4");
  gltf::Model model = loaded(file);
  const Rig rig = gltf::applyRig(
      model, 0, R"({"drivers": [{"twist": "twist", "source": "hand", "axis": [1, 0, 0]}]})");
  ASSERT_FALSE(rig.ok());
  EXPECT_EQ(rig.error().message, "driver 0: the bind matrix of the joint 'hand' has no inverse");
  EXPECT_TRUE(gltf::applyRig(model, 0,
                             R"({"drivers": [{"twist": "twist", "source": "lower",
                                 "axis": [1, 0, 0]}]})")
                  .ok());
}

}  // namespace
}  // namespace dermis::test
