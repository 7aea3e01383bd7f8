// Clips of one file for the model of another: which node each channel finds, and what is said about
// the others.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "gltf_builder.h"

namespace dermis::test {
namespace {

using Sentences = std::vector<std::string>;
using gltf::ChannelPath;

constexpr double wayOfHip = 5;

/// The triangle with named joints, and one clip.
FileBuilder figure() {
  FileBuilder file = skinnedTriangle();
  file.json["nodes"][0]["name"] = "body";
  file.json["nodes"][1]["name"] = "hip";
  file.json["nodes"][2]["name"] = "knee";
  file.json["nodes"][1]["translation"] = {0, 2, 0};
  return file;
}

/// Adds a clip that animates one property of a node, from zeros to `values` in one second.
void animate(FileBuilder& file, std::size_t node, const char* path, std::vector<float> values,
             const std::string& clip) {
  const bool isWeights = std::string(path) == "weights";
  const std::size_t components = values.size();
  values.insert(values.begin(), components, 0.0f);
  if (std::string(path) == "rotation") values[components - 1] = 1;
  const std::size_t input = file.addFloats({0, 1}, "SCALAR");
  const std::size_t output = file.addFloats(values, isWeights         ? "SCALAR"
                                                    : components == 4 ? "VEC4"
                                                                      : "VEC3");
  file.json["animations"].push_back(
      {{"name", clip},
       {"samplers", {{{"input", input}, {"output", output}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", node}, {"path", path}}}}}}});
}

/// Puts the channels of all clips into the first one.
void joinClips(FileBuilder& file) {
  Json& first = file.json["animations"][0];
  for (std::size_t i = 1; i < file.json["animations"].size(); ++i) {
    Json channel = file.json["animations"][i]["channels"][0];
    channel["sampler"] = first["samplers"].size();
    first["samplers"].push_back(file.json["animations"][i]["samplers"][0]);
    first["channels"].push_back(channel);
  }
  file.json["animations"] = Json::array({first});
}

/// Nodes with these names, and nothing else.
FileBuilder nodesNamed(const Sentences& names) {
  FileBuilder file;
  for (const std::string& name : names) file.json["nodes"].push_back({{"name", name}});
  return file;
}

/// A file without a mesh that moves the hip.
FileBuilder walk(const Sentences& names = {"knee", "hip"}) {
  FileBuilder file = nodesNamed(names);
  const auto hip = std::ranges::find(names, "hip") - names.begin();
  animate(file, static_cast<std::size_t>(hip), "translation", {wayOfHip, 0, 0}, "walk");
  return file;
}

/// The notes, or a failed expectation.
Sentences added(gltf::Model& model, const FileBuilder& file) {
  const Result<Sentences> notes = gltf::addClips(model, loaded(file));
  EXPECT_TRUE(notes.ok()) << (notes ? "" : notes.error().message);
  return notes ? *notes : Sentences{};
}

void expectOne(const Sentences& notes, const std::string& text) {
  ASSERT_EQ(notes.size(), 1u) << testing::PrintToString(notes);
  EXPECT_NE(notes[0].find(text), std::string::npos) << notes[0] << "\nwithout: " << text;
}

double xOf(const gltf::Model& model, std::uint32_t node, std::uint32_t clip, double time = 1) {
  return gltf::nodeGlobals(model, clip, time)[node][0][3];
}

TEST(GltfClips, FindNodesByName) {
  FileBuilder file = figure();
  animate(file, 2, "translation", {7, 0, 0}, "own");
  gltf::Model model = loaded(file);
  FileBuilder other = walk();
  animate(other, 0, "rotation", {0, 0, 1, 0}, "turn");
  EXPECT_EQ(added(model, other), Sentences{});

  ASSERT_EQ(model.clips.size(), 3u);
  EXPECT_EQ(model.clips[0].name, "own") << "the model's clip keeps its number";
  EXPECT_EQ(xOf(model, 2, 0), 7);
  EXPECT_EQ(model.clips[1].name, "walk");
  EXPECT_EQ(model.clips[1].duration, 1);
  EXPECT_EQ(xOf(model, 1, 1), wayOfHip) << "node 1 in both files, but not by that";
  EXPECT_EQ(xOf(model, 1, 1, 0.5), wayOfHip / 2);
  EXPECT_EQ(xOf(model, 2, 1), wayOfHip) << "the knee is below the hip";
  EXPECT_EQ(gltf::nodeGlobals(model, 2, 1)[2][0][0], -1) << "node 0 there is the knee here";
}

TEST(GltfClips, ChannelsStandInTheOrderOfTheModelsNodes) {
  FileBuilder file = figure();
  file.json["meshes"][0]["primitives"][0]["targets"] = {
      {{"POSITION", file.addFloats({0, 0, 0, 1, 0, 0, 0, 0, 0}, "VEC3")}}};
  gltf::Model model = loaded(file);
  FileBuilder other = figure();
  other.json["nodes"] = {{{"name", "knee"}}, {{"name", "hip"}}, {{"name", "body"}, {"mesh", 0}}};
  other.json.erase("skins");
  other.json.erase("scenes");
  other.json.erase("scene");
  other.json["meshes"] = file.json["meshes"];
  other.binary = file.binary;
  other.json["accessors"] = file.json["accessors"];
  other.json["bufferViews"] = file.json["bufferViews"];
  animate(other, 0, "scale", {2, 2, 2}, "all");
  animate(other, 1, "translation", {1, 0, 0}, "all");
  animate(other, 2, "weights", {0.5f}, "all");
  joinClips(other);
  EXPECT_EQ(added(model, other), Sentences{});

  const std::vector<gltf::Channel>& channels = model.clips.at(0).channels;
  ASSERT_EQ(channels.size(), 3u);
  const auto isBefore = [](const gltf::Channel& a, const gltf::Channel& b) {
    return std::pair(a.node, a.path) < std::pair(b.node, b.path);
  };
  EXPECT_TRUE(std::ranges::is_sorted(channels, isBefore)) << "as `morphWeights` needs them";
  EXPECT_EQ(gltf::morphWeights(model, 0, 0, 1), std::vector<float>{0.5f});
}

TEST(GltfClips, SayWhichNodesTheModelLacks) {
  gltf::Model model = loaded(figure());
  const std::string name = "tail\n" + std::string(1000, 'x');
  FileBuilder other = walk({name, "hip", "", "wing"});
  animate(other, 0, "translation", {1, 0, 0}, "wag");
  animate(other, 0, "rotation", {0, 0, 1, 0}, "wag again");
  animate(other, 2, "translation", {1, 0, 0}, "nameless");
  const Sentences notes = added(model, other);
  expectOne(notes, "node 0 'tail\\nxxx");
  EXPECT_NE(notes.at(0).find("'tail\\n" + std::string(74, 'x') + "...' is animated, but no node"),
            std::string::npos)
      << notes[0];
  EXPECT_TRUE(notes[0].ends_with("(and 1 more of this kind)")) << "one for each node: " << notes[0];
  ASSERT_EQ(model.clips.size(), 4u) << "clips keep their order";
  EXPECT_EQ(model.clips[1].name, "wag");
  EXPECT_TRUE(model.clips[1].channels.empty());
  EXPECT_EQ(model.clips[1].duration, 1);
  EXPECT_EQ(xOf(model, 1, 0), wayOfHip);
}

TEST(GltfClips, AreRefusedIfNothingMatches) {
  gltf::Model model = loaded(figure());
  FileBuilder other = nodesNamed({"mixamorig:Hips"});
  animate(other, 0, "translation", {1, 0, 0}, "walk");
  const Result<Sentences> unmatched = gltf::addClips(model, loaded(other));
  ASSERT_FALSE(unmatched.ok());
  EXPECT_EQ(unmatched.error().code, ErrorCode::invalidData);
  EXPECT_EQ(unmatched.error().message,
            "its animations move no node of the model: node 0 'mixamorig:Hips' is animated, but no "
            "node of the model has this name");
  const Result<Sentences> empty = gltf::addClips(model, loaded(figure()));
  ASSERT_FALSE(empty.ok());
  EXPECT_EQ(empty.error().code, ErrorCode::invalidData);
  EXPECT_EQ(empty.error().message, "it has no animations");
  EXPECT_TRUE(model.clips.empty());
}

TEST(GltfClips, PreferJoints) {
  FileBuilder file = figure();
  file.json["nodes"][0]["name"] = "hip";
  gltf::Model model = loaded(file);
  EXPECT_EQ(added(model, walk()), Sentences{});
  EXPECT_EQ(model.clips.at(0).channels.at(0).node, 1u) << "node 0 is no joint";

  // The same in the file of the clips: its skin has the second hip.
  FileBuilder other = nodesNamed({"hip", "knee", "hip"});
  other.json["skins"] = {{{"joints", {2}}}};
  animate(other, 0, "translation", {1, 0, 0}, "both");
  animate(other, 2, "translation", {9, 0, 0}, "both");
  joinClips(other);
  expectOne(added(model, other), "several animated nodes are named 'hip': only one of them is");
  ASSERT_EQ(model.clips.at(1).channels.size(), 1u);
  EXPECT_EQ(xOf(model, 1, 1), 9);
}

TEST(GltfClips, SayWhichOfSeveralJointsIsAnimated) {
  FileBuilder file = figure();
  file.json["nodes"][2]["name"] = "hip";
  gltf::Model model = loaded(file);
  expectOne(added(model, walk()), "several nodes of the model are named 'hip': node 1 is animated");
  EXPECT_EQ(model.clips.at(0).channels.at(0).node, 1u);
}

/// The triangle with morph targets.
FileBuilder withTargets(FileBuilder file, std::size_t count) {
  const std::size_t target = file.addFloats({1, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3");
  for (std::size_t i = 0; i < count; ++i)
    file.json["meshes"][0]["primitives"][0]["targets"].push_back({{"POSITION", target}});
  return file;
}

TEST(GltfClips, WeightsNeedTheSameNumberOfTargets) {
  FileBuilder other = withTargets(figure(), 2);
  animate(other, 0, "weights", {0.5f, 1}, "talk");
  animate(other, 1, "translation", {1, 0, 0}, "walk");

  gltf::Model same = loaded(withTargets(figure(), 2));
  EXPECT_EQ(added(same, other), Sentences{});
  EXPECT_EQ(gltf::morphWeights(same, 0, 0, 1), (std::vector<float>{0.5f, 1}));

  for (const std::size_t count : {1u, 3u}) {
    gltf::Model model = loaded(withTargets(figure(), count));
    expectOne(added(model, other),
              "node 0 'body': its mesh has 2 morph targets, that of the model "
              "has " +
                  std::to_string(count));
    EXPECT_EQ(gltf::morphWeights(model, 0, 0, 1), std::vector<float>(count));
  }
  gltf::Model none = loaded(figure());
  expectOne(added(none, other),
            "node 0 'body' is animated, but no node of the model with this name has morph targets");

  // A joint with the name of the mesh does not take its weights.
  FileBuilder file = withTargets(figure(), 2);
  file.json["nodes"][1]["name"] = "body";
  gltf::Model twoBodies = loaded(file);
  added(twoBodies, other);
  EXPECT_EQ(gltf::morphWeights(twoBodies, 0, 0, 1), (std::vector<float>{0.5f, 1}));
}

TEST(GltfClips, TranslationsOfAnotherUnitAreScaled) {
  for (const double unit : {100.0, 0.01, 2.5}) {
    gltf::Model model = loaded(figure());
    FileBuilder other = walk();
    other.json["nodes"][0]["translation"] = {0, unit, 0};
    other.json["nodes"][1]["translation"] = {0, 2 * unit, 0};
    animate(other, 1, "scale", {3, 3, 3}, "grow");
    const Sentences notes = added(model, other);
    if (unit == 2.5) {
      EXPECT_EQ(notes, Sentences{}) << "a taller figure";
      EXPECT_EQ(xOf(model, 1, 0), wayOfHip);
    } else {
      expectOne(notes, "times as far from their parents: translations are multiplied by");
      EXPECT_NEAR(xOf(model, 1, 0), wayOfHip / unit, 1e-6 * wayOfHip / unit);
    }
    EXPECT_EQ(gltf::nodeGlobals(model, 1, 1)[1][0][0], 3) << "scales have no unit";
  }
}

TEST(GltfClips, ReplaceAMatrix) {
  FileBuilder file = figure();
  file.json["nodes"][1].erase("translation");
  file.json["nodes"][1]["matrix"] = {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 2, 0, 1};
  gltf::Model model = loaded(file);
  expectOne(added(model, walk()), "node 1 'hip' of the model has a matrix, which has been decomp");
  const Transform hip = gltf::nodeGlobals(model, 0, 1)[1];
  EXPECT_EQ(hip[0][3], wayOfHip);
  EXPECT_NEAR(hip[1][0], 1, 1e-12) << "the rotation of the matrix stays";
}

TEST(GltfClips, AreLimitedByTheBudgetOfTheirFile) {
  gltf::Model model = loaded(figure());
  gltf::Model other = loaded(walk());
  other.memoryLeft = 0;
  const Result<Sentences> refused = gltf::addClips(model, std::move(other));
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::limitExceeded);
  EXPECT_TRUE(model.clips.empty());
}

TEST(GltfClips, AddTheFilesThatTheyWereReadFrom) {
  gltf::Model model = loaded(figure());
  gltf::Model other = loaded(walk());
  model.sideFiles = {"figure.bin"};
  other.sideFiles = {"walk.bin"};
  ASSERT_TRUE(gltf::addClips(model, std::move(other)).ok());
  EXPECT_EQ(model.sideFiles, (std::vector<std::filesystem::path>{"figure.bin", "walk.bin"}));
}

}  // namespace
}  // namespace dermis::test
