// `--rig`, and rigs in a file: the command skins with what the rig drives.
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/rig.h"
#include "dermis/verify.h"
#include "dermis_command.h"
#include "gltf_builder.h"
#include "ply.h"

namespace dermis::test {
namespace {

std::string seed(const std::string& name) {
  return std::string(sourceFolder) + "/tests/fuzz/seeds/" + name;
}

std::string contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The arm of the seeds, bent and twisted, with all kinds of drivers in rig.json and three of them
/// in the file.
class RigTest : public ::testing::Test {
 protected:
  void SetUp() override {
    Json json = Json::parse(contents(seed("rig.gltf")));
    json["nodes"][2]["rotation"] = {0, 0, 0.6, 0.8};
    json["nodes"][4]["rotation"] = {0.28, 0, 0, 0.96};
    json["meshes"][0]["weights"] = {0.5, 0.25};
    std::ofstream(model_) << json.dump();
  }

  CommandResult skin(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{"skin", model_, "-o", out_, "--device", "cpu"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return dermis(arguments);
  }

  /// What the rig should give in the rest pose, by functions of the library.
  std::vector<std::array<float, 3>> expected(const std::string& text) const {
    gltf::Model model = loaded(gltf::load(model_));
    const auto rig = gltf::applyRig(model, 0, text);
    EXPECT_TRUE(rig.ok()) << rig.error().message;
    const Result<PackedRig> packed = packRig(**rig);
    std::vector<JointMatrix> pose = gltf::pose(model, 0, noIndex, 0);
    const std::vector<JointMatrix> written = pose;
    std::vector<float> given = gltf::morphWeights(model, 0, noIndex, 0);
    std::vector<MorphWeight> morphs;
    for (std::uint32_t i = 0; i < given.size(); ++i) morphs.push_back({i, given[i]});
    const auto first = static_cast<std::uint32_t>(given.size());
    if (packed->givenWeights() == 0) given.clear();
    std::vector<float> weights(given.size() + packed->drivenWeights());
    pose.resize(written.size() + packed->drivenJoints());
    EXPECT_TRUE(
        evaluateRig(*packed, written, given, std::span(pose).subspan(written.size()), weights)
            .ok());
    for (std::uint32_t i = 0; i < packed->drivenWeights(); ++i)
      morphs.push_back({first + i, weights[given.size() + i]});
    const gltf::PrimitiveView view(model.meshes[0].primitives[0]);
    const auto skinned = reference::skin(view.mesh(), pose, Method::dualQuaternion, morphs);
    EXPECT_TRUE(skinned.ok());
    std::vector<std::array<float, 3>> positions;
    for (const reference::Double3& p : skinned->positions)
      positions.push_back(
          {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
    return positions;
  }

  void expectSkinned(const std::vector<std::array<float, 3>>& positions) const {
    const std::optional<Ply> ply = readPly(out_);
    ASSERT_TRUE(ply.has_value());
    ASSERT_EQ(ply->positions.size(), positions.size());
    for (std::size_t i = 0; i < positions.size(); ++i)
      for (std::size_t axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(ply->positions[i][axis], positions[i][axis], 1e-5) << "vertex " << i;
  }

  const std::string model_ = outFile("arm.gltf"), out_ = outFile("out.ply");
};

TEST_F(RigTest, MovesVerticesAsTheRigOfTheFileSays) {
  const CommandResult result = skin({});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(result.errors, "");
  expectSkinned(expected(loaded(gltf::load(model_)).skins[0].rig));
}

TEST_F(RigTest, MovesVerticesAsAnotherFileSays) {
  for (const char* device : {"cpu", "reference"}) {
    const CommandResult result =
        dermis({"skin", model_, "-o", out_, "--device", device, "--rig", seed("rig.json")});
    EXPECT_EQ(result.status, 0) << result.errors;
    expectSkinned(expected(contents(seed("rig.json"))));
  }
}

TEST_F(RigTest, NoneIgnoresTheRigOfTheFile) {
  EXPECT_EQ(skin({"--rig", "none"}).status, 0);
  expectSkinned(expected(R"({"drivers": []})"));
}

TEST_F(RigTest, IsListedByInfo) {
  const CommandResult result = dermis({"info", model_});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.output.find("rig    of skin 0: 5 joints and 1 morph weights driven by 1 twists, "
                               "1 correctives, 1 chains, 0 linear drivers"),
            std::string::npos)
      << result.output;
  for (const char* line :
       {"\n       drives joints 'twist', 'muscle'\n", "\n       morph targets 'smile', 'bent'\n",
        "\nskin   0: joints 'upper', 'lower', 'hand'\n"})
    EXPECT_NE(result.output.find(line), std::string::npos) << line << "in\n" << result.output;
}

TEST_F(RigTest, IsCompared) {
  const CommandResult result =
      dermis({"compare", model_, "--device", "reference", "--rig", seed("rig.json")});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.output.find("\ncurved "), std::string::npos) << result.output;
}

TEST_F(RigTest, IsVerified) {
  const CommandResult result =
      dermis({"verify", model_, "--device", "cpu", "--quick", "--rig", seed("rig.json")});
  EXPECT_EQ(result.status, 0) << result.output << result.errors;
  // The rest pose: 2 twist and linear joints, 3 of the chain, and 2 weights.
  EXPECT_NE(result.output.find("rig: 1 poses, 7 driven joints and morph weights compared; worst"),
            std::string::npos)
      << result.output;
}

TEST_F(RigTest, AMistakeNamesTheFileTheSkinAndTheDriver) {
  const std::string rig = outFile("rig.json");
  std::ofstream(rig) << R"({"drivers": [{"chain": ["upper", "hand"], "segments": 1}]})";
  const CommandResult result = skin({"--rig", rig});
  EXPECT_EQ(result.status, 3);
  EXPECT_NE(result.errors.find("skin 0: driver 0: segments is 1, which is not from 2 to 65535"),
            std::string::npos)
      << result.errors;
  expectOneErrorLine(result);
  expectOneErrorLine(skin({"--rig", outFile("absent.json")}));
}

TEST_F(RigTest, WhatIsBelowADrivenJointIsANote) {
  const std::string rig = outFile("rig.json");
  std::ofstream(rig)
      << R"({"drivers": [{"twist": "lower", "source": "upper", "axis": [1, 0, 0]}]})";
  const CommandResult result = skin({"--rig", rig});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.errors.find("rig.json': the rig of skin 0: 'twist' and 1 other joint below the "
                               "driven joint 'lower' follow"),
            std::string::npos)
      << result.errors;
}

TEST_F(RigTest, IsNotOverwritten) {
  const std::string rig = outFile("rig.ply");
  std::ofstream(rig) << contents(seed("rig.json"));
  const CommandResult result = dermis({"skin", model_, "-o", rig, "--device", "cpu", "--rig", rig});
  EXPECT_EQ(result.status, 2);
  EXPECT_EQ(contents(rig), contents(seed("rig.json")));
}

}  // namespace
}  // namespace dermis::test
