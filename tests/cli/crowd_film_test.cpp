// The crowd sample's film: the pictures asked for, verified beside, and what is kept from an
// earlier frame where it must be.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dermis_command.h"
#include "pictures.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using samples::render::Picture;

std::vector<std::string> filmCommand(const std::string& out, std::uint32_t figures,
                                     const std::vector<std::string>& added) {
  std::vector<std::string> arguments{
      dermisCrowdProgram, "--film", out,        "--figures", std::to_string(figures),
      "--width",          "320",    "--height", "180"};
  arguments.insert(arguments.end(), added.begin(), added.end());
  return arguments;
}

CommandResult film(const std::string& out, std::uint32_t figures,
                   const std::vector<std::string>& added,
                   const std::vector<std::string>& environment = {}) {
  return runCommand(filmCommand(out, figures, added), environment);
}

/// Of the right half, where no statistics stand.
Picture rightHalf(const Picture& picture) {
  Picture half{picture.width / 2, picture.height, {}};
  for (std::size_t row = 0; row < picture.height; ++row) {
    const auto first = picture.pixels.begin() +
                       static_cast<std::ptrdiff_t>((row * picture.width + picture.width / 2) * 4);
    half.pixels.insert(half.pixels.end(), first, first + std::ptrdiff_t{4} * half.width);
  }
  return half;
}

bool isBlank(const Picture& picture) {
  const auto [least, most] = std::ranges::minmax(picture.pixels);
  return most - least < 100;
}

TEST(CrowdFilmTest, DrawsThePicturesAskedForAndVerifiesThem) {
  REQUIRE_DEVICE();
  for (const std::string inFlight : {"1", "3"}) {
    const CommandResult result =
        film(outFile("frame%02d.png"), 24,
             {"--frames", "5", "--check-every", "1", "--validate", "--frames-in-flight", inFlight});
    ASSERT_EQ(result.status, 0) << result.errors;
    EXPECT_TRUE(result.errors.empty()) << result.errors;
    EXPECT_NE(result.output.find("are inside their bounds"), std::string::npos) << result.output;
    std::vector<Picture> pictures;
    for (int frame = 0; frame < 5; ++frame) {
      const std::string name = outFile("frame0" + std::to_string(frame) + ".png");
      const auto picture = readPng(name);
      ASSERT_TRUE(picture) << name;
      EXPECT_EQ(picture->width, 320u);
      EXPECT_EQ(picture->height, 180u);
      EXPECT_FALSE(isBlank(rightHalf(*picture)));
      if (!pictures.empty()) {
        EXPECT_NE(rightHalf(*picture).pixels, rightHalf(pictures.back()).pixels) << frame;
      }
      pictures.push_back(*picture);
      std::filesystem::remove(name);
    }
    EXPECT_FALSE(std::filesystem::exists(outFile("frame05.png")));
  }
}

/// A figure that is not due is drawn where it is now, in the pose that it had: as near to what it
/// would look like that no eye sees it.
TEST(CrowdFilmTest, WhatIsNotDueLooksAsIfItWere) {
  REQUIRE_DEVICE();
  const std::string json = outFile("film.json");
  ASSERT_EQ(film(outFile("kept%01d.png"), 150,
                 {"--frames", "4", "--time", "19", "--json", json, "--no-verify"})
                .status,
            0);
  ASSERT_EQ(film(outFile("new.png"), 150, {"--time", "19.1", "--no-verify"}).status, 0);
  std::ifstream file(json);
  const nlohmann::json report = nlohmann::json::parse(file);
  EXPECT_GT(report["totals"]["withinInterval"].get<int>(), 100);
  const auto kept = readPng(outFile("kept3.png")), first = readPng(outFile("kept0.png")),
             fresh = readPng(outFile("new.png"));
  ASSERT_TRUE(kept && first && fresh);
  const PictureDifference difference = comparePictures(rightHalf(*kept), rightHalf(*fresh));
  EXPECT_GT(difference.similarity, 0.95);
  EXPECT_LT(difference.worstColor, 40);
  EXPECT_LT(comparePictures(rightHalf(*first), rightHalf(*fresh)).similarity, 0.9)
      << "the time between them is seen";
}

TEST(CrowdFilmTest, LooksAsTheReferenceDoes) {
  REQUIRE_DEVICE();
  const std::string out = outFile("film.png");
  ASSERT_EQ(film(out, 100, {"--time", "9", "--no-verify"}).status, 0);
  const auto picture = readPng(out);
  ASSERT_TRUE(picture);
  expectAsReference("film", rightHalf(*picture));
}

TEST(CrowdFilmTest, ShowsOnATerminalHowFarItIs) {
  REQUIRE_DEVICE();
  REQUIRE_TERMINAL();
  const auto errors = [&](const std::string& out, const std::vector<std::string>& added) {
    const CommandResult result = runOnTerminal(filmCommand(out, 1, added));
    EXPECT_EQ(result.status, 0);
    return result.errors;
  };
  EXPECT_EQ(errors(outFile("frame%01d.png"), {"--frames", "2"}),
            "\rrendering: 1 of 2\rrendering: 2 of 2\r\x1b[K");
  const std::string passes = errors(outFile("one.png"), {});
  EXPECT_TRUE(passes.starts_with("\rrendering: 1 of 27\rrendering: 2 of 27\r")) << passes;
  EXPECT_TRUE(passes.ends_with("\rrendering: 27 of 27\r\x1b[K")) << passes;
}

TEST(CrowdFilmTest, LooksTheSameWhoeverCulls) {
  REQUIRE_DEVICE();
  ASSERT_EQ(film(outFile("cpu%01d.png"), 24, {"--frames", "3"}).status, 0);
  ASSERT_EQ(film(outFile("gpu%01d.png"), 24, {"--frames", "3", "--gpu-culling"}).status, 0);
  const auto cpu = readPng(outFile("cpu2.png")), gpu = readPng(outFile("gpu2.png"));
  ASSERT_TRUE(cpu && gpu);
  EXPECT_GT(comparePictures(rightHalf(*cpu), rightHalf(*gpu)).similarity, 0.97);
}

TEST(CrowdFilmTest, NamesFfmpegWhereThereIsNone) {
  const CommandResult result =
      film(outFile("film.mp4"), 24, {"--frames", "2", "--model", "no such model.glb"},
           {"PATH=/nowhere"});
  EXPECT_EQ(result.status, 5);
  EXPECT_NE(result.errors.find("ffmpeg"), std::string::npos) << result.errors;
  EXPECT_NE(result.errors.find("%04d.png"), std::string::npos) << result.errors;
}

TEST(CrowdFilmTest, RefusesWrongUsage) {
  const std::vector<std::vector<std::string>> wrong{
      {"--film", "a.jpg"},
      {"--film", ""},
      {"--film", "a%d.png"},
      {"--film", "a.png", "--frames", "2"},
      {"--film", "a.png", "--width", "10"},
      {"--film", "a.png", "--height", "100000"},
      {"--film", "a.mp4", "--fps", "0"},
      {"--film", "a.mp4", "--fps", "nan"},
      {"--film", "a.mp4", "--time", "-1"},
      {"--film", "a.mp4", "--time", "nan"},
      {"--width", "320"},
      {"--height", "180"},
      {"--fps", "24"},
      {"--time", "3"},
  };
  for (std::vector<std::string> arguments : wrong) {
    SCOPED_TRACE(::testing::PrintToString(arguments));
    arguments.insert(arguments.begin(), dermisCrowdProgram);
    const CommandResult result = runCommand(arguments);
    EXPECT_EQ(result.status, 2);
    EXPECT_TRUE(result.errors.starts_with("dermis_crowd: error: ")) << result.errors;
    EXPECT_EQ(std::ranges::count(result.errors, '\n'), 1) << result.errors;
    EXPECT_TRUE(result.output.empty());
  }
}

}  // namespace
}  // namespace dermis::test
