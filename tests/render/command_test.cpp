// `dermis render`: the pictures of the sample models against references, and what the command says.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "dermis_command.h"
#include "pictures.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

std::string sampleModel(const std::string& name) {
  return std::string(sampleModels) + "/" + name + ".glb";
}

CommandResult render(const std::string& model, const std::string& out,
                     const std::vector<std::string>& more = {},
                     const std::vector<std::string>& environment = {}) {
  std::vector<std::string> arguments{"render",  model, "-o",       out,
                                     "--width", "320", "--height", "180"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return dermis(arguments, environment);
}

void expectRenderedAsReference(const std::string& name, const std::string& model,
                               const std::vector<std::string>& arguments) {
  REQUIRE_DEVICE();
  const std::string out = outFile(name + ".png");
  const CommandResult result = render(model, out, arguments);
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(result.output.empty()) << result.output;
  const auto picture = readPng(out);
  ASSERT_TRUE(picture);
  expectAsReference(name, *picture);
}

TEST(RenderReferenceTest, WalkingFigure) {
  expectRenderedAsReference("walk", sampleModel("figure"), {"--time", "0.3"});
}
TEST(RenderReferenceTest, WavingFigureFromItsRight) {
  expectRenderedAsReference("wave", sampleModel("figure"),
                            {"--animation", "wave", "--time", "1.2", "--azimuth", "-60"});
}
TEST(RenderReferenceTest, BentArmByLinearBlending) {
  expectRenderedAsReference("arm", sampleModel("arm"), {"--time", "1", "--method", "linear"});
}
TEST(RenderReferenceTest, TwistedBarWithoutPerspective) {
  expectRenderedAsReference("bar", sampleModel("bar"), {"--time", "1", "--orthographic"});
}
TEST(RenderReferenceTest, Crowd) {
  expectRenderedAsReference("crowd", sampleModel("figure"),
                            {"--instances", "12", "--elevation", "25"});
}

TEST(RenderCommandTest, WritesNumberedPictures) {
  REQUIRE_DEVICE();
  const CommandResult result = render(sampleModel("arm"), outFile("frame%02d.png"),
                                      {"--frames", "3", "--fps", "4", "--time", "0.5"});
  ASSERT_EQ(result.status, 0) << result.errors;
  const auto first = readPng(outFile("frame00.png")), last = readPng(outFile("frame02.png"));
  ASSERT_TRUE(first && last);
  EXPECT_EQ(first->width, 320u);
  EXPECT_EQ(first->height, 180u);
  EXPECT_LT(comparePictures(*first, *last).worstSimilarity, 0.8) << "the arm has moved";
  EXPECT_FALSE(std::filesystem::exists(outFile("frame03.png")));
}

/// A folder with an ffmpeg that writes down what it is given.
std::string pretendedFfmpeg(int status) {
  const std::string folder = outFile("bin");
  std::filesystem::create_directories(folder);
  const std::string program = folder + "/ffmpeg";
  std::ofstream(program) << "#!/bin/sh\nfor last in \"$@\"; do :; done\necho \"$@\" >'" << folder
                         << "/arguments'\nwc -c >\"${last#file:}\"\nexit " << status << "\n";
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  return folder;
}

std::string textOf(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(RenderCommandTest, GivesAFilmsPicturesToFfmpeg) {
  REQUIRE_DEVICE();
  const std::string folder = pretendedFfmpeg(0);
  const std::string film = outFile("film.mp4");
  const CommandResult result =
      render(sampleModel("bar"), film, {"--frames", "2"}, {"PATH=" + folder + ":/usr/bin:/bin"});
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(std::stoul(textOf(film)), 2u * 320 * 180 * 4);
  EXPECT_NE(textOf(folder + "/arguments").find("-s 320x180 -r 30"), std::string::npos);
}

TEST(RenderCommandTest, LeavesNoHalfFilmBehind) {
  REQUIRE_DEVICE();
  const std::string folder = pretendedFfmpeg(1);
  const std::string film = outFile("film.gif");
  const CommandResult result =
      render(sampleModel("bar"), film, {"--frames", "2"}, {"PATH=" + folder + ":/usr/bin:/bin"});
  EXPECT_EQ(result.status, 5);
  expectOneErrorLine(result);
  EXPECT_FALSE(std::filesystem::exists(film));
}

TEST(RenderCommandTest, NamesFfmpegWhereThereIsNone) {
  REQUIRE_DEVICE();
  const CommandResult result =
      render(sampleModel("bar"), outFile("film.mp4"), {"--frames", "2"}, {"PATH=/nowhere"});
  EXPECT_EQ(result.status, 5);
  expectOneErrorLine(result);
  EXPECT_NE(result.errors.find("ffmpeg"), std::string::npos) << result.errors;
  EXPECT_NE(result.errors.find("%04d.png"), std::string::npos) << result.errors;
}

TEST(RenderCommandTest, RefusesWrongUsage) {
  const std::vector<std::vector<std::string>> wrong{
      {"-o", "a.jpg"},
      {"-o", "a.mp4"},
      {"-o", "a.png", "--frames", "2"},
      {"-o", "a%d.png", "--frames", "2"},
      {"-o", "a%02d.png"},
      {"-o", "a.png", "--instances", "0"},
      {"-o", "a.png", "--width", "0"},
      {"-o", "a.png", "--height", "100000"},
      {"-o", "a.png", "--elevation", "91"},
      {"-o", "a.png", "--azimuth", "nan"},
      {"-o", "a.png", "--method", "magic"},
      {"-o", "a.png", "--device", "cpu"},
      {"-o", "a.png", "--animation", "nothing"},
  };
  for (std::vector<std::string> arguments : wrong) {
    SCOPED_TRACE(arguments[1] + " " + arguments.back());
    arguments.insert(arguments.begin(), {"render", sampleModel("bar")});
    const CommandResult result = dermis(arguments);
    EXPECT_EQ(result.status, 2);
    expectOneErrorLine(result);
  }
}

}  // namespace
}  // namespace dermis::test
