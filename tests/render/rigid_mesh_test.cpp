// `dermis render` draws rigid meshes that hang on a skeleton, with clips of other files, too.

#include <gtest/gtest.h>

#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "dermis_command.h"
#include "gltf_builder.h"
#include "pictures.h"

namespace dermis::test {
namespace {

/// A box as a primitive: 8 vertices, flat shading.
Json boxOf(FileBuilder& file, std::vector<float> min, std::vector<float> max, int material) {
  std::vector<float> positions;
  for (int corner = 0; corner < 8; ++corner) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      positions.push_back((corner >> axis & 1) != 0 ? max[axis] : min[axis]);
  }
  const std::vector<std::uint16_t> indices{0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
  return {{"attributes", {{"POSITION", file.addFloats(positions, "VEC3")}}},
          {"indices", file.add(indices, "SCALAR", unsignedShortType)},
          {"material", material}};
}

void addInfluences(FileBuilder& file, Json& box, std::uint8_t joint) {
  std::vector<std::uint8_t> joints, weights;
  for (int corner = 0; corner < 8; ++corner) {
    joints.insert(joints.end(), {joint, 0, 0, 0});
    weights.insert(weights.end(), {255, 0, 0, 0});
  }
  box["attributes"]["JOINTS_0"] = file.add(joints, "VEC4", unsignedByteType);
  box["attributes"]["WEIGHTS_0"] = file.add(weights, "VEC4", unsignedByteType, true);
}

void animate(FileBuilder& file, std::size_t node, const char* path, const char* type,
             const std::vector<float>& values) {
  Json& clip = file.json["animations"][0];
  const std::size_t input = file.addFloats({0}, "SCALAR");
  clip["channels"].push_back(
      {{"sampler", clip["samplers"].size()}, {"target", {{"node", node}, {"path", path}}}});
  clip["samplers"].push_back({{"input", input}, {"output", file.addFloats(values, type)}});
}

constexpr int root = 1, hand = 2, grip = 3, sword = 4;

/// A blue arm, lifted by a clip, whose second joint holds a red sword. The grip between them is no
/// joint, but is also animated. With `swordsSkin` the sword is skinned to a single joint instead of
/// hanging on one.
FileBuilder armed(bool swordsSkin = false) {
  FileBuilder file;
  file.json["materials"] = {
      {{"pbrMetallicRoughness", {{"baseColorFactor", {0.1, 0.2, 0.8, 1}}}}},
      {{"pbrMetallicRoughness", {{"baseColorFactor", {0.8, 0.05, 0.05, 1}}}}}};
  Json upper = boxOf(file, {-0.2f, 0, -0.2f}, {0.2f, 1, 0.2f}, 0);
  Json lower = boxOf(file, {-0.2f, 1, -0.2f}, {0.2f, 2, 0.2f}, 0);
  Json blade = boxOf(file, {-0.1f, -0.1f, 0}, {0.1f, 0.1f, 1.5f}, 1);
  addInfluences(file, upper, 0);
  addInfluences(file, lower, 1);
  if (swordsSkin) addInfluences(file, blade, 0);
  file.json["meshes"] = {{{"primitives", {upper, lower}}}, {{"primitives", {blade}}}};
  const std::vector<float> matrices{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,
                                    1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1};
  file.json["skins"] = {
      {{"joints", {root, hand}}, {"inverseBindMatrices", file.addFloats(matrices, "MAT4")}}};
  file.json["nodes"] = {{{"mesh", 0}, {"skin", 0}},
                        {{"name", "root"}, {"children", {hand}}},
                        {{"name", "hand"}, {"children", {grip}}, {"translation", {0, 1, 0}}},
                        {{"name", "grip"}, {"children", {sword}}, {"translation", {0, 1, 0}}},
                        {{"mesh", 1}, {"scale", {1, 0.5, 1}}}};
  if (swordsSkin) {
    file.json["skins"].push_back({{"joints", {sword}}});
    file.json["nodes"][sword]["skin"] = 1;
  }
  file.json["scenes"] = {{{"nodes", {0, root}}}};
  file.json["animations"] = {{{"name", "lift"}, {"samplers", Json::array()}}};
  animate(file, hand, "rotation", "VEC4", {0, 0, 0.383f, 0.924f});
  animate(file, grip, "translation", "VEC3", {0.3f, 1, 0});
  return file;
}

std::optional<samples::render::Picture> picturesOf(const std::string& name, const FileBuilder& file,
                                                   const std::vector<std::string>& more = {}) {
  const std::string model = outFile(name + ".gltf"), out = outFile(name + ".png");
  std::ofstream(model) << file.text();
  std::vector<std::string> arguments{"render",   model, "-o",        out,  "--width", "240",
                                     "--height", "180", "--azimuth", "40", "--strict"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const CommandResult result = dermis(arguments);
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(result.errors, "") << "nothing is left out";
  return readPng(out);
}

TEST(RenderRigidMeshTest, MovesWithItsJointAndItsNodes) {
  REQUIRE_DEVICE();
  const auto rigid = picturesOf("rigid", armed()), skinned = picturesOf("skinned", armed(true));
  ASSERT_TRUE(rigid && skinned);
  EXPECT_TRUE(rigid->pixels == skinned->pixels);
  expectAsReference("sword", *rigid);
}

TEST(RenderRigidMeshTest, MovesByAClipOfAnotherFile) {
  REQUIRE_DEVICE();
  FileBuilder figure = armed(), clips = armed();
  figure.json.erase("animations");
  clips.json = {{"asset", clips.json["asset"]},
                {"nodes", {{{"name", "grip"}}, {{"name", "hand"}}}},
                {"scenes", {{{"nodes", {0, 1}}}}},
                {"accessors", clips.json["accessors"]},
                {"bufferViews", clips.json["bufferViews"]},
                {"animations", clips.json["animations"]}};
  clips.json["animations"][0]["channels"][0]["target"]["node"] = 1;
  clips.json["animations"][0]["channels"][1]["target"]["node"] = 0;
  const std::string file = outFile("clips.gltf");
  std::ofstream(file) << clips.text();
  const auto own = picturesOf("own", armed()),
             others = picturesOf("others", figure, {"--clips", file});
  ASSERT_TRUE(own && others);
  EXPECT_TRUE(own->pixels == others->pixels);
}

}  // namespace
}  // namespace dermis::test
