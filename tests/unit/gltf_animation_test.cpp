// Clips: keys as they are read, and what lies between them, against numbers worked out by hand.
#include <cmath>
#include <limits>
#include <numbers>

#include "gltf_builder.h"

namespace dermis::test {
namespace {

using Floats = std::vector<float>;
using gltf::nodeGlobals;

// One channel that moves node 1.
FileBuilder animated(const Floats& times, const Floats& values, const char* path,
                     const char* interpolation) {
  FileBuilder file = skinnedTriangle();
  const bool rotation = std::string(path) == "rotation";
  const std::size_t input = file.addFloats(times, "SCALAR");
  const std::size_t output = file.addFloats(values, rotation ? "VEC4" : "VEC3");
  file.json["animations"] = {
      {{"name", "move"},
       {"samplers", {{{"input", input}, {"output", output}, {"interpolation", interpolation}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", path}}}}}}}};
  return file;
}

Json& sampler(FileBuilder& file) {
  return file.json["animations"][0]["samplers"][0];
}
Json& channel(FileBuilder& file) {
  return file.json["animations"][0]["channels"][0];
}

double xAt(const gltf::Model& model, double time) {
  return nodeGlobals(model, 0, time)[1][0][3];
}

// The angle about z by which node 1 is turned, in degrees.
double angleAt(const gltf::Model& model, double time) {
  const auto global = nodeGlobals(model, 0, time)[1];
  EXPECT_NEAR(std::hypot(global[0][0], global[1][0]), 1, 1e-14) << "not a rotation about z";
  EXPECT_NEAR(global[2][2], 1, 1e-14);
  return std::atan2(global[1][0], global[0][0]) * 180 / std::numbers::pi;
}

Floats turnAboutZ(std::initializer_list<double> degrees) {
  Floats values;
  for (const double angle : degrees) {
    const double half = angle * std::numbers::pi / 360;
    values.insert(values.end(),
                  {0, 0, static_cast<float>(std::sin(half)), static_cast<float>(std::cos(half))});
  }
  return values;
}

TEST(GltfAnimation, InterpolatesLinearly) {
  const gltf::Model model =
      loaded(animated({1, 2, 4}, {10, 0, 0, 20, 0, 0, -20, 0, 0}, "translation", "LINEAR"));
  EXPECT_EQ(xAt(model, -5), 10) << "before the first key";
  EXPECT_EQ(xAt(model, 1), 10) << "at the first key";
  EXPECT_EQ(xAt(model, 1.25), 12.5);
  EXPECT_EQ(xAt(model, 2), 20) << "at a key";
  EXPECT_EQ(xAt(model, 3), 0);
  EXPECT_EQ(xAt(model, 4), -20) << "at the last key";
  EXPECT_EQ(xAt(model, 99), -20) << "after the last key";
  EXPECT_EQ(xAt(model, std::numeric_limits<double>::infinity()), -20);
  EXPECT_EQ(xAt(model, std::numeric_limits<double>::quiet_NaN()), 10);
  EXPECT_EQ(model.clips.at(0).name, "move");
  EXPECT_EQ(model.clips.at(0).duration, 4);
}

TEST(GltfAnimation, Steps) {
  const gltf::Model model = loaded(animated({1, 2}, {10, 0, 0, 20, 0, 0}, "translation", "STEP"));
  EXPECT_EQ(xAt(model, 0), 10);
  EXPECT_EQ(xAt(model, 1), 10);
  EXPECT_EQ(xAt(model, 1.999), 10);
  EXPECT_EQ(xAt(model, 2), 20);
  EXPECT_EQ(xAt(model, 3), 20);
}

// glTF 2.0, appendix C.5. Keys 1 and 3, so that the tangents count twice. Between them, at t = ¼:
// (2/64 − 3/16 + 1)·10 + 2(1/64 − 2/16 + ¼)·4 + (−2/64 + 3/16)·20 + 2(1/64 − 1/16)·8
// = 8.4375 + 1.125 + 3.125 − 0.75 = 11.9375.
TEST(GltfAnimation, InterpolatesCubicSplines) {
  const gltf::Model model = loaded(animated({1, 3},
                                            {99, 0, 0, 10, 0, 0, 4, 0, 0,  // in, value, out
                                             8, 0, 0, 20, 0, 0, -99, 0, 0},
                                            "translation", "CUBICSPLINE"));
  EXPECT_EQ(xAt(model, 0), 10);
  EXPECT_EQ(xAt(model, 1), 10);
  EXPECT_DOUBLE_EQ(xAt(model, 1.5), 11.9375);
  // At t = ½: ½·10 + 2·⅛·4 + ½·20 − 2·⅛·8.
  EXPECT_DOUBLE_EQ(xAt(model, 2), 14);
  EXPECT_EQ(xAt(model, 3), 20);
  EXPECT_EQ(xAt(model, 4), 20);
}

TEST(GltfAnimation, NormalizesCubicRotations) {
  // From 0 to 90 degrees without tangents: halfway the mean of both, made a unit quaternion.
  Floats values(24);
  const Floats keys = turnAboutZ({0, 90});
  std::copy_n(keys.begin(), 4, values.begin() + 4);
  std::copy_n(keys.begin() + 4, 4, values.begin() + 16);
  const gltf::Model model = loaded(animated({0, 1}, values, "rotation", "CUBICSPLINE"));
  EXPECT_NEAR(angleAt(model, 0.5), 45, 1e-5);
  // At t = ¼ the weights are 0.84375 and 0.15625.
  const double sine = 0.15625 * std::sqrt(0.5);
  const double cosine = 0.84375 + 0.15625 * std::sqrt(0.5);
  EXPECT_NEAR(angleAt(model, 0.25), 2 * std::atan2(sine, cosine) * 180 / std::numbers::pi, 1e-5);
}

TEST(GltfAnimation, SlerpsAlongTheShorterArc) {
  const gltf::Model model =
      loaded(animated({0, 1, 2}, turnAboutZ({10, 100, 350}), "rotation", "LINEAR"));
  EXPECT_NEAR(angleAt(model, 0.5), 55, 1e-5);
  EXPECT_NEAR(angleAt(model, 0.25), 32.5, 1e-5) << "slerp, not a normalized lerp";
  // From 100 to 350: the quaternions point into opposite hemispheres, and the way is −110.
  EXPECT_NEAR(angleAt(model, 1.5), 45, 1e-5);
  EXPECT_NEAR(angleAt(model, 1.25), 72.5, 1e-5);
  EXPECT_NEAR(angleAt(model, 2), -10, 1e-5);
}

TEST(GltfAnimation, SlerpsBetweenEqualAndOppositeKeys) {
  Floats values = turnAboutZ({30, 30});
  for (std::size_t i = 4; i < 8; ++i) values[i] = -values[i];
  const gltf::Model model = loaded(animated({0, 1}, values, "rotation", "LINEAR"));
  for (const double time : {0.0, 0.3, 0.5, 1.0}) EXPECT_NEAR(angleAt(model, time), 30, 1e-5);
}

TEST(GltfAnimation, NormalizesRotationKeys) {
  Floats values = turnAboutZ({0, 90});
  for (float& value : values) value *= 3;
  const gltf::Model model =
      expectNoted(animated({0, 1}, values, "rotation", "LINEAR"),
                  "channel 0 output: the rotation of key 0 has a length of 3");
  EXPECT_NEAR(angleAt(model, 0.5), 45, 1e-5);
  EXPECT_FLOAT_EQ(model.clips[0].channels[0].values[3], 1.0f);
}

TEST(GltfAnimation, TakesARotationWithoutLengthForTheIdentity) {
  const gltf::Model model =
      loaded(animated({0, 1}, {0, 0, 0, 0, 0, 0, 0, 1}, "rotation", "LINEAR"));
  EXPECT_EQ(angleAt(model, 0), 0);
  EXPECT_EQ(model.notes.size(), 1u);
}

TEST(GltfAnimation, ReadsNormalizedRotations) {
  FileBuilder file = animated({0, 1}, Floats(8), "rotation", "LINEAR");
  sampler(file)["output"] =
      file.add<std::int8_t>({0, 0, 0, 127, 0, 0, 90, 90}, "VEC4", byteType, true);
  gltf::Model model = loaded(file);
  EXPECT_NEAR(angleAt(model, 1), 90, 1e-5);
  EXPECT_TRUE(model.notes.empty()) << "rounding to bytes is no fault: " << model.notes[0];
  sampler(file)["output"] =
      file.add<std::int16_t>({0, 0, 0, 32767, 0, 0, 23170, 23170}, "VEC4", shortType, true);
  EXPECT_NEAR(angleAt(loaded(file), 1), 90, 1e-5);
  sampler(file)["output"] =
      file.add<std::uint8_t>({0, 0, 0, 255, 0, 0, 180, 180}, "VEC4", unsignedByteType, true);
  EXPECT_NEAR(angleAt(loaded(file), 1), 90, 1e-5);
  sampler(file)["output"] = file.add<std::uint16_t>({0, 0, 0, 65535, 0, 0, 46340, 46340}, "VEC4",
                                                    unsignedShortType, true);
  EXPECT_NEAR(angleAt(loaded(file), 1), 90, 1e-5);
  // A spline of bytes: in-tangent, value, out-tangent for each key.
  sampler(file)["interpolation"] = "CUBICSPLINE";
  sampler(file)["output"] = file.add<std::int8_t>(
      {0, 0, 0, 0, 0, 0, 0, 127, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 90, 90, 0, 0, 0, 0}, "VEC4",
      byteType, true);
  EXPECT_NEAR(angleAt(loaded(file), 0.5), 45, 1e-5);
}

TEST(GltfAnimation, ReadsScaleAndWeights) {
  gltf::Model model = loaded(animated({0, 2}, {1, 1, 1, 3, 1, 1}, "scale", "LINEAR"));
  EXPECT_EQ(nodeGlobals(model, 0, 1)[1][0][0], 2);

  FileBuilder file = animated({0, 2}, Floats(6), "scale", "LINEAR");
  file.primitive()["targets"] = {{{"POSITION", 0}}, {{"POSITION", 0}}, {{"POSITION", 0}}};
  channel(file)["target"] = {{"node", 0}, {"path", "weights"}};
  sampler(file)["output"] =
      file.add<std::uint8_t>({0, 51, 255, 1, 2, 3}, "SCALAR", unsignedByteType, true);
  model = loaded(file);
  const gltf::Channel& weights = model.clips.at(0).channels.at(0);
  EXPECT_EQ(weights.path, gltf::ChannelPath::weights);
  EXPECT_EQ(weights.components, 3u);
  EXPECT_EQ(weights.values, (Floats{0, 0.2f, 1, 1 / 255.0f, 2 / 255.0f, 3 / 255.0f}));
  nodeGlobals(model, 0, 1);
}

TEST(GltfAnimation, TakesLinearWhereNothingIsSaid) {
  FileBuilder file = animated({0, 1}, {0, 0, 0, 1, 0, 0}, "translation", "LINEAR");
  sampler(file).erase("interpolation");
  EXPECT_EQ(xAt(loaded(file), 0.5), 0.5);
}

TEST(GltfAnimation, HoldsASingleKey) {
  const gltf::Model model = loaded(animated({5}, {7, 0, 0}, "translation", "LINEAR"));
  for (const double time : {0.0, 5.0, 9.0}) EXPECT_EQ(xAt(model, time), 7);
}

TEST(GltfAnimation, LeavesOtherNodesAtRest) {
  const gltf::Model model = loaded(animated({0, 1}, {5, 0, 0, 6, 0, 0}, "translation", "LINEAR"));
  const auto globals = nodeGlobals(model, 0, 1);
  EXPECT_EQ(globals[2][0][3], 6) << "a child follows";
  EXPECT_EQ(globals[2][1][3], 1);
  EXPECT_EQ(globals[0][0][3], 0);
  EXPECT_EQ(nodeGlobals(model, noIndex, 1)[1][0][3], 0) << "the rest pose";
  EXPECT_EQ(nodeGlobals(model, 77, 1)[1][0][3], 0) << "a clip that does not exist";
}

// The specification forbids it; three.js takes the matrix apart, and so does Dermis, with a note.
TEST(GltfAnimation, TakesApartTheMatrixOfANodeThatMoves) {
  FileBuilder file = animated({0, 1}, {5, 0, 0, 6, 0, 0}, "translation", "LINEAR");
  // A quarter turn about z, scaled by 2, 3 and, mirrored, 4.
  file.json["nodes"][1]["matrix"] = {0, 2, 0, 0, -3, 0, 0, 0, 0, 0, -4, 0, 1, 2, 3, 1};
  const gltf::Model model = loaded(file);
  EXPECT_NE(model.notes.at(0).find("node 1 has a matrix"), std::string::npos);
  const auto global = nodeGlobals(model, 0, 0)[1];
  const double expected[3][4] = {{0, -3, 0, 5}, {2, 0, 0, 0}, {0, 0, -4, 0}};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      EXPECT_NEAR(global[row][column], expected[row][column], 1e-14) << row << ' ' << column;
    }
  }
  EXPECT_EQ(nodeGlobals(model, noIndex, 0)[1][2][3], 3);
}

TEST(GltfAnimation, TakesApartEveryQuarterTurn) {
  // All 24 rotations of a cube reach every branch of the conversion.
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      if (a == b) continue;
      for (int signs = 0; signs < 4; ++signs) {
        double column[3][3] = {};
        column[0][a] = signs & 1 ? -1 : 1;
        column[1][b] = signs & 2 ? -1 : 1;
        for (int i = 0; i < 3; ++i) {
          column[2][i] = column[0][(i + 1) % 3] * column[1][(i + 2) % 3] -
                         column[0][(i + 2) % 3] * column[1][(i + 1) % 3];
        }
        FileBuilder file = animated({0, 1}, Floats(6), "translation", "LINEAR");
        Json matrix = Json::array();
        for (int i = 0; i < 4; ++i) {
          for (int j = 0; j < 4; ++j) {
            matrix.push_back(i < 3 && j < 3 ? column[i][j] : (i == 3 && j == 3 ? 1.0 : 0.0));
          }
        }
        file.json["nodes"][1]["matrix"] = matrix;
        const auto global = nodeGlobals(loaded(file), 0, 0)[1];
        for (std::size_t i = 0; i < 3; ++i) {
          for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(global[j][i], column[i][j], 1e-14);
        }
      }
    }
  }
}

TEST(GltfAnimation, LeavesOutChannelsThatItDoesNotKnow) {
  FileBuilder file = animated({0, 1}, {0, 0, 0, 1, 0, 0}, "translation", "LINEAR");
  Json other = channel(file);
  other["target"] = {{"path", "pointer"}, {"extensions", {{"KHR_animation_pointer", {}}}}};
  file.json["animations"][0]["channels"] = {other, channel(file)};
  gltf::Model model = loaded(file);
  EXPECT_EQ(model.clips.at(0).channels.size(), 1u);
  EXPECT_EQ(xAt(model, 1), 1);
  EXPECT_EQ(model.notes.at(0), "1 animation channel left out: an unknown target");
}

// The accessor of the times has no bytes: a placeholder, of which nothing can be made.
TEST(GltfAnimation, LeavesOutChannelsWithoutTimes) {
  FileBuilder file = animated({0, 1}, {0, 0, 0, 1, 0, 0}, "translation", "LINEAR");
  file.json["accessors"][sampler(file)["input"].get<std::size_t>()].erase("bufferView");
  const gltf::Model model = loaded(file);
  EXPECT_TRUE(model.clips.at(0).channels.empty());
  EXPECT_NE(model.notes.at(0).find("animation 0 channel 0: its times"), std::string::npos);
}

TEST(GltfAnimation, FindsClipsByNumberAndName) {
  FileBuilder file = animated({0, 1}, {0, 0, 0, 1, 0, 0}, "translation", "LINEAR");
  Json& animations = file.json["animations"];
  for (const char* name : {"run", "0", "7", "run"}) {
    Json animation = animations[0];
    animation["name"] = name;
    animations.push_back(animation);
  }
  const gltf::Model model = loaded(file);
  EXPECT_EQ(gltf::findClip(model, "move"), 0u);
  EXPECT_EQ(gltf::findClip(model, "run"), 1u) << "the first of two";
  EXPECT_EQ(gltf::findClip(model, "0"), 0u) << "a number goes before a name";
  EXPECT_EQ(gltf::findClip(model, "4"), 4u);
  EXPECT_EQ(gltf::findClip(model, "7"), 3u) << "no clip 7, but one of that name";
  EXPECT_EQ(gltf::findClip(model, "walk"), std::nullopt);
  EXPECT_EQ(gltf::findClip(model, ""), std::nullopt);
  EXPECT_EQ(gltf::findClip(model, "99999999999999999999"), std::nullopt);
}

TEST(GltfAnimation, RefusesBadTimes) {
  const auto withTimes = [](Floats times) {
    return animated(times, Floats(times.size() * 3), "translation", "LINEAR");
  };
  const float infinity = std::numeric_limits<float>::infinity();
  expectInvalid(withTimes({0, 2, 1}), "animation 0 channel 0 input: key 2 of accessor 3 is at 1");
  expectInvalid(withTimes({0, infinity}), "key 1 of accessor 3 is at inf, which is not finite");
  expectInvalid(withTimes({std::numeric_limits<float>::quiet_NaN()}), "which is not finite");

  FileBuilder file = withTimes({0, 1});
  sampler(file)["input"] = file.add<std::uint16_t>({0, 1}, "SCALAR", unsignedShortType);
  expectInvalid(file, "input: accessor 5 is SCALAR of unsigned short, not SCALAR of float");
  sampler(file)["input"] = sampler(file)["output"];
  expectInvalid(file, "input: accessor 4 is VEC3 of float, not SCALAR");
}

TEST(GltfAnimation, RefusesBadValues) {
  expectInvalid(
      animated({0, 1}, Floats(9), "translation", "LINEAR"),
      "animation 0 channel 0 output: accessor 4 has 3 elements, but there must be 2 for 2 keys");
  expectInvalid(animated({0, 1}, Floats(6), "translation", "CUBICSPLINE"),
                "accessor 4 has 2 elements, but there must be 6 for 2 keys");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  expectInvalid(animated({0, 1}, {0, 0, 0, 0, nan, 0}, "translation", "LINEAR"),
                "output: element 1 of accessor 4 is not finite");
  FileBuilder file = animated({0, 1}, Floats(6), "translation", "LINEAR");
  channel(file)["target"]["path"] = "rotation";
  expectInvalid(file, "output: accessor 4 is VEC3 of float, not VEC4");
  sampler(file)["output"] = file.add(std::vector<std::int8_t>(8), "VEC4", byteType);
  expectInvalid(file, "output: accessor 5 is VEC4 of byte, not VEC4 of float or normalized byte");
  channel(file)["target"]["path"] = "scale";
  sampler(file)["output"] = file.add(std::vector<std::uint32_t>(6), "VEC3", unsignedIntType);
  expectInvalid(file, "output: accessor 6 is VEC3 of unsigned int, not VEC3 of float");
}

TEST(GltfAnimation, ReadsKeysThatBreakRules) {
  // Equal times are a jump to the later key.
  gltf::Model model = expectNoted(
      animated({0, 1, 1, 2}, {0, 0, 0, 1, 0, 0, 5, 0, 0, 7, 0, 0}, "translation", "LINEAR"),
      "key 2 of accessor 3 is at 1 seconds after 1: times must ascend");
  EXPECT_EQ(xAt(model, 0.5), 0.5);
  EXPECT_EQ(xAt(model, 1), 5);
  EXPECT_EQ(xAt(model, 1.5), 6);
  model = expectNoted(animated({-1, 1}, {0, 0, 0, 4, 0, 0}, "translation", "LINEAR"),
                      "key 0 of accessor 3 is at -1 seconds, which is negative");
  EXPECT_EQ(xAt(model, 0), 2);
  EXPECT_EQ(model.clips[0].duration, 1);
  model = expectNoted(animated({-2, -1}, {0, 0, 0, 4, 0, 0}, "translation", "LINEAR"),
                      "key 0 of accessor 3 is at -2 seconds, which is negative");
  EXPECT_EQ(xAt(model, 0), 4);
  EXPECT_EQ(model.clips[0].duration, 0);
  model = expectNoted(animated({3}, {9, 9, 9, 7, 0, 0, 9, 9, 9}, "translation", "CUBICSPLINE"),
                      "animation 0 channel 0: a CUBICSPLINE needs at least two keys");
  EXPECT_EQ(xAt(model, 0), 7);
  EXPECT_EQ(xAt(model, 5), 7);
  FileBuilder file = animated({0, 1}, Floats(6), "translation", "LINEAR");
  sampler(file)["output"] = file.add<std::int8_t>({0, 0, 0, 127, 0, 0}, "VEC3", byteType, true);
  EXPECT_EQ(xAt(expectNoted(file, "output: accessor 5 is VEC3 of normalized byte, not VEC3"), 1),
            1);
  sampler(file)["output"] = file.add<std::int16_t>({0, 0, 0, 300, 0, 0}, "VEC3", shortType);
  EXPECT_EQ(xAt(expectNoted(file, "output: accessor 6 is VEC3 of short, not VEC3"), 1), 300);
  // Nothing can be made of no keys at all.
  file.json["accessors"][sampler(file)["input"].get<std::size_t>()]["count"] = 0;
  sampler(file)["output"] = file.addAccessor(
      {{"bufferView", 4}, {"componentType", floatType}, {"count", 0}, {"type", "VEC3"}});
  EXPECT_TRUE(expectNoted(file, "accessor 3: count is 0").clips.at(0).channels.empty());
}

TEST(GltfAnimation, LeavesOutChannelsWithoutEffect) {
  FileBuilder file = animated({0, 1}, {0, 0, 0, 1, 0, 0}, "translation", "LINEAR");
  file.json["animations"][0]["channels"].push_back(Json(channel(file)));
  EXPECT_EQ(expectNoted(file, "animation 0 channel 1: another channel already animates")
                .clips[0]
                .channels.size(),
            1u);
  channel(file)["target"] = {{"node", 1}, {"path", "weights"}};
  EXPECT_EQ(expectNoted(file, "animation 0 channel 0: node 1 has no mesh, so there are no weights")
                .clips[0]
                .channels.size(),
            1u);
  channel(file)["target"]["node"] = 0;
  expectNoted(file, "animation 0 channel 0: mesh 0 of node 0 has no morph targets");
}

TEST(GltfAnimation, UsesTheFirstOfTwoChannelsWithOneTarget) {
  FileBuilder file = animated({0, 1}, {0, 0, 0, 1, 0, 0}, "translation", "LINEAR");
  file.json["animations"][0]["channels"].push_back(Json(channel(file)));
  file.json["animations"][0]["samplers"].push_back(Json(sampler(file)));
  file.json["animations"][0]["samplers"][1]["output"] = file.addFloats({0, 0, 0, 9, 0, 0}, "VEC3");
  file.json["animations"][0]["channels"][1]["sampler"] = 1;
  EXPECT_EQ(xAt(expectNoted(file, "animation 0 channel 1: another channel already animates"), 1),
            1);
}

TEST(GltfAnimation, RefusesBadTargets) {
  FileBuilder file = animated({0, 1}, Floats(6), "translation", "LINEAR");
  channel(file)["target"]["node"] = 3;
  expectInvalid(file, "animation 0 channel 0 target: node is 3, and the file has 3 nodes");
  channel(file)["target"]["node"] = 1;
  channel(file)["target"].erase("path");
  expectInvalid(file, "animation 0 channel 0 target: it has no path");
  channel(file).erase("target");
  expectInvalid(file, "animation 0 channel 0: it has no target");
}

TEST(GltfAnimation, RefusesBadDescriptions) {
  FileBuilder file = animated({0, 1}, Floats(6), "translation", "LINEAR");
  channel(file)["sampler"] = 1;
  expectInvalid(file, "animation 0 channel 0: sampler is 1, and the animation has 1 samplers");
  channel(file).erase("sampler");
  expectInvalid(file, "animation 0 channel 0: it has no sampler");
  channel(file)["sampler"] = 0;
  sampler(file)["interpolation"] = "SMOOTH";
  expectInvalid(file, "animation 0 sampler 0: interpolation is 'SMOOTH'");
  sampler(file).erase("interpolation");
  sampler(file)["output"] = 44;
  expectInvalid(file, "animation 0 sampler 0: output is 44");
  sampler(file).erase("input");
  expectInvalid(file, "animation 0 sampler 0: it has no input");
  file.json["animations"][0].erase("samplers");
  expectInvalid(file, "animation 0: it has no samplers");
  file.json["animations"][0]["samplers"] = Json::array();
  file.json["animations"][0].erase("channels");
  expectInvalid(file, "animation 0: it has no channels");
  file.json["animations"][0]["channels"] = Json::array();
  EXPECT_EQ(expectNoted(file, "animation 0: samplers is an empty array").clips.size(), 1u);
}

}  // namespace
}  // namespace dermis::test
