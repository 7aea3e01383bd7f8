// `--clips`: which clips the command finds in which file, and what it says about the others.

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "dermis_command.h"
#include "gltf_builder.h"
#include "ply.h"

namespace dermis::test {
namespace {

/// A clip that moves a node to `x` at once.
void addClip(FileBuilder& file, const std::string& name, std::size_t node, float x) {
  const std::size_t input = file.addFloats({0}, "SCALAR");
  const std::size_t output = file.addFloats({x, 0, 0}, "VEC3");
  file.json["animations"].push_back(
      {{"name", name},
       {"samplers", {{{"input", input}, {"output", output}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", node}, {"path", "translation"}}}}}}});
}

class ClipsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_ + "/other");
    FileBuilder figure = skinnedTriangle();
    figure.json["nodes"][1]["name"] = "hip";
    figure.json["nodes"][2]["name"] = "knee";
    addClip(figure, "idle", 1, 1);
    write("figure.gltf", figure);

    FileBuilder walk = motions();
    addClip(walk, "walk", 1, 2);
    addClip(walk, "idle", 1, 3);
    write("walk.gltf", walk);

    FileBuilder run = motions();
    addClip(run, "a:b", 1, 4);
    write("other/walk.gltf", run);

    FileBuilder jump = motions();
    addClip(jump, "jump", 1, 5);
    write("x:y.gltf", jump);
  }

  /// A file without a mesh: the hip and a tail.
  static FileBuilder motions() {
    FileBuilder file;
    file.json["nodes"] = {{{"name", "tail"}}, {{"name", "hip"}}};
    file.json["scenes"] = {{{"nodes", {0, 1}}}};
    return file;
  }

  std::string path(const std::string& name) const { return folder_ + "/" + name; }

  void write(const std::string& name, const FileBuilder& file) const {
    std::ofstream(path(name)) << file.text();
  }

  CommandResult skin(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{"skin",          path("figure.gltf"), "-o",
                                       path("out.ply"), "--device",          "cpu"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return dermis(arguments);
  }

  /// With `--animation`, and the clips of all files.
  CommandResult skinWith(const std::string& animation) const {
    return skin({"--clips", path("walk.gltf"), "--clips", path("other/walk.gltf"), "--clips",
                 path("x:y.gltf"), "--animation", animation});
  }

  /// Where the first vertex is then.
  float xOf(const std::string& animation) const {
    const CommandResult result = skinWith(animation);
    EXPECT_EQ(result.status, 0);
    EXPECT_EQ(result.errors, "");
    const std::optional<Ply> ply = readPly(path("out.ply"));
    return ply && !ply->positions.empty() ? ply->positions[0][0] : NAN;
  }

  std::string complaintOf(const std::string& animation) const {
    const CommandResult result = skinWith(animation);
    EXPECT_EQ(result.status, 2);
    return result.errors;
  }

  const std::string folder_ = outFile("folder");
};

TEST_F(ClipsTest, AreFoundByNumberNameAndFile) {
  const std::vector<float> byNumber{xOf("0"), xOf("1"), xOf("2"), xOf("3"), xOf("4")};
  EXPECT_EQ(byNumber, (std::vector<float>{1, 2, 3, 4, 5})) << "the model's clips come first";
  EXPECT_EQ(xOf("none"), 0);
  EXPECT_EQ(xOf("walk"), 2);
  EXPECT_EQ(xOf("figure.gltf:idle"), 1);
  EXPECT_EQ(xOf("walk.gltf:idle"), 3) << "the other walk.gltf has none";
  EXPECT_EQ(xOf(path("walk.gltf") + ":idle"), 3);
  EXPECT_EQ(xOf("a:b"), 4) << "a name with a colon";
  EXPECT_EQ(xOf("walk.gltf:a:b"), 4);
  EXPECT_EQ(xOf("x:y.gltf:jump"), 5);
  EXPECT_EQ(xOf(path("other/walk.gltf") + ":a:b"), 4);
}

TEST_F(ClipsTest, ANameInSeveralFilesNeedsTheFile) {
  EXPECT_EQ(complaintOf("idle"),
            "dermis: error: --animation: several clips are called 'idle': 0 of 'figure.gltf', 2 of "
            "'walk.gltf'; give a number or FILE:NAME (see dermis skin --help)\n");
  EXPECT_EQ(complaintOf("figure.gltf:walk"),
            "dermis: error: --animation: there is no clip 'figure.gltf:walk'; there are 5 clips "
            "(see dermis skin --help)\n");
}

TEST_F(ClipsTest, WhatDoesNotMatchIsNoted) {
  FileBuilder wag = motions();
  addClip(wag, "wag", 0, 5);
  addClip(wag, "step", 1, 6);
  write("wag.gltf", wag);
  for (const bool strict : {false, true}) {
    std::vector<std::string> options{"--clips", path("wag.gltf"), "--animation", "step"};
    if (strict) options.emplace_back("--strict");
    const CommandResult result = skin(options);
    EXPECT_EQ(result.status, 0) << "no fault of the file, strict or not";
    EXPECT_EQ(result.errors,
              "dermis: note: 'wag.gltf': node 0 'tail' is animated, but no node of the model has "
              "this name\n");
  }
}

TEST_F(ClipsTest, AFileWithoutAnythingForTheModelIsRefused) {
  FileBuilder tail = motions();
  addClip(tail, "wag", 0, 5);
  write("tail.gltf", tail);
  write("still.gltf", motions());
  std::ofstream(path("broken.gltf")) << "{";
  for (const auto& [name, complaint] :
       {std::pair{"tail.gltf", "'tail.gltf': its animations move no node of the model: node 0 "},
        {"still.gltf", "'still.gltf': it has no animations"},
        {"broken.gltf", "'broken.gltf': "},
        {"none.gltf", "there is no file '"}}) {
    const CommandResult result = skin({"--clips", path(name)});
    EXPECT_EQ(result.status, 3) << name;
    expectOneErrorLine(result);
    EXPECT_NE(result.errors.find(complaint), std::string::npos) << result.errors;
  }
}

TEST_F(ClipsTest, StrictRefusesFaultsOfTheirFiles) {
  FileBuilder early = motions();
  addClip(early, "early", 1, 5);
  early.json["nodes"][0]["rotation"] = {0, 0, 0, 0.5};
  write("early.gltf", early);
  const std::string fault = "'early.gltf': node 0: its rotation has a length of 0.5";
  const CommandResult lenient = skin({"--clips", path("early.gltf")});
  EXPECT_EQ(lenient.status, 0);
  EXPECT_NE(lenient.errors.find("dermis: note: " + fault), std::string::npos) << lenient.errors;
  const CommandResult strict = skin({"--clips", path("early.gltf"), "--strict"});
  EXPECT_EQ(strict.status, 3);
  EXPECT_NE(strict.errors.find("dermis: error: " + fault), std::string::npos) << strict.errors;
}

TEST_F(ClipsTest, InfoListsThem) {
  const std::string walk = path("walk.gltf");
  const CommandResult text = dermis({"info", "--clips", walk, path("figure.gltf")});
  EXPECT_EQ(text.status, 0);
  EXPECT_NE(text.output.find("clip   0 'idle': "), std::string::npos) << text.output;
  EXPECT_NE(text.output.find("clip   1 'walk' of '"), std::string::npos) << text.output;
  const CommandResult json = dermis({"info", path("figure.gltf"), "--clips", walk, "--json"});
  const nlohmann::json clips = nlohmann::json::parse(json.output)["clips"];
  ASSERT_EQ(clips.size(), 3u);
  EXPECT_FALSE(clips[0].contains("file"));
  EXPECT_EQ(clips[2]["name"], "idle");
  EXPECT_EQ(clips[2]["file"], walk);
}

TEST_F(ClipsTest, CompareShowsThem) {
  const CommandResult result = dermis({"compare", path("figure.gltf"), "--clips", path("walk.gltf"),
                                       "--animation", "walk", "--device", "reference"});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.output.find("clip 1 'walk' at "), std::string::npos) << result.output;
  const CommandResult builtIn = dermis({"compare", "-o", "a.png", "--clips", path("walk.gltf")});
  EXPECT_EQ(builtIn.status, 2);
  EXPECT_NE(builtIn.errors.find("--clips, --rig, --animation and --time need a MODEL"),
            std::string::npos)
      << builtIn.errors;
}

TEST_F(ClipsTest, FilesBesideThemAreNotOverwritten) {
  FileBuilder walk = motions();
  addClip(walk, "walk", 1, 2);
  const std::string binary = path("walk.ply");
  std::ofstream(binary, std::ios::binary)
      .write(reinterpret_cast<const char*>(walk.binary.data()),
             static_cast<std::streamsize>(walk.binary.size()));
  walk.json["buffers"] = {{{"byteLength", walk.binary.size()}, {"uri", "walk.ply"}}};
  write("side.gltf", walk);
  const CommandResult result = dermis(
      {"skin", path("figure.gltf"), "--clips", path("side.gltf"), "-o", binary, "--device", "cpu"});
  EXPECT_EQ(result.status, 2);
  EXPECT_NE(result.errors.find("would overwrite an input file"), std::string::npos)
      << result.errors;
  EXPECT_EQ(std::filesystem::file_size(binary), walk.binary.size());
}

}  // namespace
}  // namespace dermis::test
