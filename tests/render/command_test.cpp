// `dermis render`: the pictures of the sample models against references, and what the command says.

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "dermis_command.h"
#include "pictures.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

std::string sampleModel(const std::string& name) {
  return std::string(sampleModels) + "/" + name + ".glb";
}

CommandResult renderWith(const std::string& model, const std::string& out,
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
  const CommandResult result = renderWith(model, out, arguments);
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
  const CommandResult result = renderWith(sampleModel("arm"), outFile("frame%02d.png"),
                                          {"--frames", "3", "--fps", "4", "--time", "0.5"});
  ASSERT_EQ(result.status, 0) << result.errors;
  const auto first = readPng(outFile("frame00.png")), last = readPng(outFile("frame02.png"));
  ASSERT_TRUE(first && last);
  EXPECT_EQ(first->width, 320u);
  EXPECT_EQ(first->height, 180u);
  EXPECT_LT(comparePictures(*first, *last).worstSimilarity, 0.8) << "the arm has moved";
  EXPECT_FALSE(std::filesystem::exists(outFile("frame03.png")));
}

/// A folder with an ffmpeg that is a shell script.
std::string pretendedFfmpeg(const std::string& script) {
  const std::string folder = outFile("bin");
  std::filesystem::create_directories(folder);
  const std::string program = folder + "/ffmpeg";
  std::ofstream(program) << "#!/bin/sh\n" << script;
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  return folder;
}

/// One that writes down what it is given, and ends with a status.
std::string countingFfmpeg(int status) {
  return pretendedFfmpeg(
      "for last in \"$@\"; do :; done\necho \"$@\" >\"$(dirname \"$0\")/arguments\"\n"
      "wc -c >\"${last#file:}\"\nexit " +
      std::to_string(status) + "\n");
}

std::vector<std::string> pathWith(const std::string& folder) {
  return {"PATH=" + folder + ":/usr/bin:/bin"};
}

std::string textOf(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// An empty folder of the running test.
std::string emptyFolder() {
  const std::string folder = outFile("folder");
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

std::ptrdiff_t filesIn(const std::string& folder) {
  return std::distance(std::filesystem::directory_iterator(folder), {});
}

TEST(RenderCommandTest, GivesAFilmsPicturesToFfmpeg) {
  REQUIRE_DEVICE();
  const std::string programs = countingFfmpeg(0), folder = emptyFolder();
  const std::string film = folder + "/film.MP4", link = folder + "/link.mp4";
  std::ofstream(film) << "an older film";
  std::filesystem::create_symlink("film.MP4", link);
  for (const std::string& out : {film, link}) {
    const CommandResult result =
        renderWith(sampleModel("bar"), out, {"--frames", "2"}, pathWith(programs));
    ASSERT_EQ(result.status, 0) << result.errors;
    EXPECT_EQ(std::stoul(textOf(film)), 2u * 320 * 180 * 4);
    EXPECT_NE(textOf(programs + "/arguments").find("-s 320x180 -r 30"), std::string::npos);
    EXPECT_EQ(filesIn(folder), 2) << "no temporary file is left";
  }
  EXPECT_TRUE(std::filesystem::is_symlink(link));
}

// ffmpeg itself refuses to write some films where it cannot go back.
TEST(RenderCommandTest, FilmsAreWrittenThroughFifos) {
  REQUIRE_DEVICE();
  const std::string programs = countingFfmpeg(0), fifo = emptyFolder() + "/film.mp4";
  ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
  const CommandResult result = runCommand(
      {"/bin/sh", "-c", "\"$0\" \"$@\" & cat \"$4\"; wait", dermisProgram, "render",
       sampleModel("bar"), "-o", fifo, "--width", "320", "--height", "180", "--frames", "2"},
      pathWith(programs));
  EXPECT_EQ(result.output, std::to_string(2 * 320 * 180 * 4) + "\n") << result.errors;
  EXPECT_TRUE(std::filesystem::is_fifo(fifo));
}

/// Films that ffmpeg fails to make, in a folder with what stands there before.
class FailingFilm {
 public:
  explicit FailingFilm(std::string programs)
      : programs_(std::move(programs)), folder_(emptyFolder()) {
    std::ofstream(folder_ + "/film.gif") << "a good film";
    std::filesystem::create_symlink("film.gif", folder_ + "/link.gif");
    std::filesystem::create_directory(folder_ + "/folder.gif");
    std::filesystem::create_symlink("/dev/null", folder_ + "/device.gif");
    EXPECT_EQ(mkfifo((folder_ + "/fifo.gif").c_str(), 0600), 0);
  }

  void expectUntouched(const std::string& name) const {
    SCOPED_TRACE(name);
    const CommandResult result = renderWith(sampleModel("bar"), folder_ + "/" + name + ".gif",
                                            {"--frames", "2"}, pathWith(programs_));
    EXPECT_EQ(result.status, 5);
    expectOneErrorLine(result);
    EXPECT_EQ(filesIn(folder_), 5) << "nothing is removed, and nothing is left";
    EXPECT_EQ(textOf(folder_ + "/film.gif"), "a good film");
    EXPECT_TRUE(std::filesystem::is_symlink(folder_ + "/link.gif"));
    EXPECT_TRUE(std::filesystem::is_directory(folder_ + "/folder.gif"));
    EXPECT_TRUE(std::filesystem::is_symlink(folder_ + "/device.gif"));
    EXPECT_TRUE(std::filesystem::is_fifo(folder_ + "/fifo.gif"));
  }

 private:
  std::string programs_, folder_;
};

TEST(RenderCommandTest, AFilmThatFailsLeavesWhatStoodThere) {
  REQUIRE_DEVICE();
  const FailingFilm film(countingFfmpeg(1));
  for (const char* name : {"film", "fifo", "new"}) film.expectUntouched(name);
}

TEST(RenderCommandTest, AnFfmpegThatOpensNothingLeavesWhatStoodThere) {
  REQUIRE_DEVICE();
  const FailingFilm film(pretendedFfmpeg("exit 1\n"));
  for (const char* name : {"folder", "link", "device", "fifo"}) film.expectUntouched(name);
}

/// A killed process remains until its parent has asked how it ended; the system does this for one
/// that has no parent left.
bool endsSoon(pid_t process) {
  for (int i = 0; i < 3000; ++i) {
    const std::string state = textOf("/proc/" + std::to_string(process) + "/stat");
    if (kill(process, 0) != 0 || state.find(") Z ") != std::string::npos) return true;
    usleep(10000);
  }
  return false;
}

TEST(RenderCommandTest, ASignalEndsFfmpegAndLeavesTheOldFilm) {
  REQUIRE_DEVICE();
  const std::string programs = pretendedFfmpeg(
      "for last in \"$@\"; do :; done\necho half >\"${last#file:}\"\n"
      "echo $$ >\"$(dirname \"$0\")/process\"\nexec sleep 1000\n");
  std::filesystem::remove(programs + "/process");
  const std::string folder = emptyFolder(), film = folder + "/film.mp4";
  std::ofstream(film) << "a good film";
  const CommandResult result = runAndSignal(
      {dermisProgram, "render", sampleModel("bar"), "-o", film, "--width", "320", "--height", "180",
       "--frames", "99"},
      pathWith(programs), [&] { return !textOf(programs + "/process").empty(); }, SIGTERM);
  EXPECT_EQ(result.signal, SIGTERM) << result.status << result.errors;
  EXPECT_EQ(textOf(film), "a good film");
  EXPECT_EQ(filesIn(folder), 1);
  EXPECT_TRUE(endsSoon(std::stoi(textOf(programs + "/process")))) << "ffmpeg is still running";
}

// Before anything is read or drawn.
TEST(RenderCommandTest, NamesFfmpegWhereThereIsNone) {
  const CommandResult result =
      renderWith("no such model.glb", outFile("film.mp4"), {"--frames", "2"},
                 {"PATH=/nowhere", "VK_DRIVER_FILES=/nonexistent.json"});
  EXPECT_EQ(result.status, 5);
  expectOneErrorLine(result);
  EXPECT_NE(result.errors.find("ffmpeg"), std::string::npos) << result.errors;
  EXPECT_NE(result.errors.find("%04d.png"), std::string::npos) << result.errors;
}

TEST(RenderCommandTest, SaysWhatTheDeviceCannotDraw) {
  REQUIRE_DEVICE();
#ifndef DERMIS_SANITIZED  // a sanitizer's shadow memory is larger
  const CommandResult result = runCommand(
      {"/bin/sh", "-c", "ulimit -v 8000000; exec \"$0\" \"$@\"", dermisProgram, "render",
       sampleModel("bar"), "-o", outFile("huge.png"), "--width", "16384", "--height", "16384"});
  EXPECT_EQ(result.status, 5);
  expectOneErrorLine(result);
  EXPECT_NE(result.errors.find(" cannot draw a picture of 16384 x 16384 pixels: "),
            std::string::npos)
      << result.errors;
  EXPECT_NE(result.errors.find(" MiB, and "), std::string::npos) << result.errors;
#endif
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
