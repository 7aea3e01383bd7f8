// The film of a crowd: the pictures asked for, and what is kept from an earlier frame where it must
// be.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
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
  std::vector<std::string> arguments{dermisCrowdFilmProgram,
                                     "--output",
                                     out,
                                     "--figures",
                                     std::to_string(figures),
                                     "--width",
                                     "320",
                                     "--height",
                                     "180"};
  arguments.insert(arguments.end(), added.begin(), added.end());
  return arguments;
}

CommandResult film(const std::string& out, std::uint32_t figures,
                   const std::vector<std::string>& added,
                   const std::vector<std::string>& environment = {}) {
  return runCommand(filmCommand(out, figures, added), environment);
}

bool isBlank(const Picture& picture) {
  const auto [least, most] = std::ranges::minmax(picture.pixels);
  return most - least < 100;
}

TEST(CrowdFilmTest, DrawsThePicturesAskedFor) {
  REQUIRE_DEVICE();
  const CommandResult result = film(outFile("frame%02d.png"), 12, {"--frames", "5", "--validate"});
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(result.errors.empty()) << result.errors;
  std::vector<Picture> pictures;
  for (int frame = 0; frame < 5; ++frame) {
    const std::string name = outFile("frame0" + std::to_string(frame) + ".png");
    const auto picture = readPng(name);
    ASSERT_TRUE(picture) << name;
    EXPECT_EQ(picture->width, 320u);
    EXPECT_EQ(picture->height, 180u);
    EXPECT_FALSE(isBlank(*picture));
    if (!pictures.empty()) {
      EXPECT_NE(picture->pixels, pictures.back().pixels) << frame;
    }
    pictures.push_back(*picture);
    std::filesystem::remove(name);
  }
  EXPECT_FALSE(std::filesystem::exists(outFile("frame05.png")));
}

/// A figure that is not due is drawn where it is now, in the pose that it had: as near to what it
/// would look like that no eye sees it.
TEST(CrowdFilmTest, WhatIsNotDueLooksAsIfItWere) {
  REQUIRE_DEVICE();
  ASSERT_EQ(film(outFile("kept%01d.png"), 60, {"--frames", "4", "--time", "19"}).status, 0);
  ASSERT_EQ(film(outFile("new.png"), 60, {"--time", "19.1"}).status, 0);
  const auto kept = readPng(outFile("kept3.png")), first = readPng(outFile("kept0.png")),
             fresh = readPng(outFile("new.png"));
  ASSERT_TRUE(kept && first && fresh);
  EXPECT_NE(kept->pixels, fresh->pixels) << "all figures are skinned in each frame";
  const PictureDifference difference = comparePictures(*kept, *fresh);
  EXPECT_GT(difference.similarity, 0.95);
  EXPECT_LT(difference.worstColor, 40);
  EXPECT_LT(comparePictures(*first, *fresh).similarity, 0.9) << "the time between them is seen";
}

TEST(CrowdFilmTest, LooksAsTheReferenceDoes) {
  REQUIRE_DEVICE();
  const std::string out = outFile("film.png");
  ASSERT_EQ(film(out, 100, {"--time", "9"}).status, 0);
  const auto picture = readPng(out);
  ASSERT_TRUE(picture);
  expectAsReference("film", *picture);
}

TEST(CrowdFilmTest, ShowsOnATerminalHowFarItIs) {
  REQUIRE_DEVICE();
  REQUIRE_TERMINAL();
  const CommandResult result =
      runOnTerminal(filmCommand(outFile("frame%01d.png"), 1, {"--frames", "2"}));
  EXPECT_EQ(result.status, 0);
  EXPECT_EQ(result.errors, "\rrendering: 1 of 2\rrendering: 2 of 2\r\x1b[K");
}

/// A shell script in the place of ffmpeg writes down its arguments and the size of what it is
/// given.
TEST(CrowdFilmTest, GivesItsPicturesToFfmpeg) {
  REQUIRE_DEVICE();
  const std::string folder = outFile("bin"), out = outFile("film.mp4");
  std::filesystem::create_directories(folder);
  std::ofstream(folder + "/ffmpeg")
      << "#!/bin/sh\nfor last in \"$@\"; do :; done\necho \"$@\" >\"$(dirname \"$0\")/arguments\"\n"
         "wc -c >\"${last#file:}\"\n";
  std::filesystem::permissions(folder + "/ffmpeg", std::filesystem::perms::owner_all);
  const CommandResult result =
      film(out, 2, {"--frames", "4", "--fps", "12"}, {"PATH=" + folder + ":/usr/bin:/bin"});
  ASSERT_EQ(result.status, 0) << result.errors;
  const auto textOf = [](const std::string& path) {
    std::ifstream file(path);
    return std::string{std::istreambuf_iterator<char>(file), {}};
  };
  EXPECT_EQ(std::stoul(textOf(out)), 4u * 320 * 180 * 4);
  EXPECT_NE(textOf(folder + "/arguments").find("-s 320x180 -r 12"), std::string::npos);
}

TEST(CrowdFilmTest, EndsAsTheDermisCommandDoes) {
  struct Case {
    std::vector<std::string> arguments;
    int status;
  };
  const std::string model = outFile("model.png");
  std::filesystem::copy_file(std::string(sampleModels) + "/bar.glb", model,
                             std::filesystem::copy_options::overwrite_existing);
  const std::vector<Case> cases{
      {{}, 2},
      {{"-o", "a.jpg"}, 2},
      {{"-o", "a%d.png"}, 2},
      {{"-o", "a.png", "--frames", "2"}, 2},
      {{"-o", "a.png", "--width", "10"}, 2},
      {{"-o", "a.mp4", "--fps", "nan"}, 2},
      {{"-o", "a.mp4", "--time", "-1"}, 2},
      {{"-o", model, "--model", model}, 2},
      {{"-o", "a.png", "--model", "no such model.glb"}, 3},
      {{"-o", outFile("a.png"), "--device", "no such device"}, 4},
      {{"-o", outFile("a.mp4"), "--frames", "2"}, 5},
  };
  for (const Case& each : cases) {
    SCOPED_TRACE(::testing::PrintToString(each.arguments));
    std::vector<std::string> command{dermisCrowdFilmProgram};
    command.insert(command.end(), each.arguments.begin(), each.arguments.end());
    const CommandResult result = runCommand(command, {"PATH=/nowhere"});
    EXPECT_EQ(result.status, each.status);
    EXPECT_TRUE(result.errors.starts_with("dermis_crowd_film: error: ")) << result.errors;
    EXPECT_EQ(std::ranges::count(result.errors, '\n'), 1) << result.errors;
    EXPECT_EQ(result.errors.find("ffmpeg") != std::string::npos, each.status == 5) << result.errors;
    EXPECT_TRUE(result.output.empty());
  }
}

}  // namespace
}  // namespace dermis::test
