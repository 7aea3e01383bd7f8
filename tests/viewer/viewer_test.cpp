// dermis_viewer, as a user sees it: on a display without a screen (Xvfb), with keys pressed
// (xdotool) and pictures taken. Nothing here waits for a time: a screenshot is taken when the
// picture is at rest.

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "pictures.h"
#include "run_command.h"
#include "shader_folder.h"
#include "test_device.h"
#include "test_paths.h"
#include "viewer.h"

namespace dermis::test {
namespace {

using samples::render::Picture;

constexpr int width = 960, height = 600;

struct Part {
  std::uint32_t left = 0, top = 0, right = 0, bottom = 0;
};

// Beside the panel, below the methods' names.
constexpr Part scene{300, 60, width, height};
// Without the line between them.
constexpr Part leftScene{304, 60, 626, height}, rightScene{634, 60, 956, height};
constexpr Part wholePanel{0, 0, 300, height};
constexpr Part message{340, 60, 920, 90}, belowMessage{300, 200, width, height};

const std::uint8_t* pixelOf(const Picture& picture, std::uint32_t x, std::uint32_t y) {
  return &picture.pixels[(std::size_t{y} * picture.width + x) * 4];
}

bool differ(const std::uint8_t* a, const std::uint8_t* b) {
  for (int i = 0; i < 3; ++i) {
    if (std::abs(a[i] - b[i]) > 24) return true;
  }
  return false;
}

/// Pixels of a part that are of another color in another part of the same size.
int changes(const Picture& a, const Part& part, const Picture& b, const Part& other) {
  int count = 0;
  for (std::uint32_t y = part.top; y < part.bottom; ++y) {
    for (std::uint32_t x = part.left; x < part.right; ++x)
      count += differ(pixelOf(a, x, y),
                      pixelOf(b, x - part.left + other.left, y - part.top + other.top));
  }
  return count;
}

int changes(const Picture& a, const Picture& b, const Part& part) {
  return changes(a, part, b, part);
}

/// Asks again and again, until it is so. False: it was not so for minutes.
bool waitUntil(const std::function<bool()>& isSo) {
  // Long enough for a busy machine and a sanitizer.
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(4);
  while (!isSo()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return true;
}

std::string sampleModel(const std::string& name) {
  return std::string(sampleModels) + "/" + name + ".glb";
}

class ViewerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = ::testing::TempDir() + "viewerXXXXXX", reason;
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    if (testDevice(true, reason) != nullptr && openDisplay()) return;
    if (reason.empty()) reason = "there is no Xvfb that starts, or no xdotool";
    ASSERT_FALSE(isContinuousIntegration()) << reason;
    GTEST_SKIP() << reason;
  }

  void TearDown() override {
    if (server_ != nullptr) {
      kill(process_, SIGKILL);  // ends the viewer, too
      pclose(server_);
    }
    if (viewer_.valid()) viewer_.wait();
    if (!HasFailure()) std::filesystem::remove_all(folder_);
  }

  /// The server chooses a number that is free, and writes it when it is ready.
  bool openDisplay() {
    const std::string screen = std::to_string(width) + "x" + std::to_string(height) + "x24";
    const std::string command =
        "command -v xdotool >/dev/null && echo $$ && exec Xvfb -displayfd 1 -nolisten tcp "
        "-noreset -nocursor -fbdir " +
        folder_ + " -screen 0 " + screen + " 2>/dev/null";
    server_ = popen(command.c_str(), "r");
    int number = 0;
    if (std::fscanf(server_, "%d %d", &process_, &number) != 2) return false;
    setenv("DISPLAY", (":" + std::to_string(number)).c_str(), 1);
    setenv("SDL_VIDEODRIVER", "x11", 1);
    return true;
  }

  /// What the display shows. The server keeps it as a file in the format of xwd.
  Picture displayed() const {
    std::ifstream stream(folder_ + "/Xvfb_screen0", std::ios::binary);
    const std::vector<unsigned char> file{std::istreambuf_iterator<char>(stream), {}};
    const auto word = [&](std::size_t index) {
      return file[4 * index + 2] * 256u + file[4 * index + 3];  // big endian, and small
    };
    Picture picture{width, height, {}};
    const std::size_t pixels = word(0) + 12 * word(19);  // after header and colors
    for (std::size_t pixel = pixels; pixel + 4 <= file.size(); pixel += 4)
      picture.pixels.insert(picture.pixels.end(),
                            {file[pixel + 2], file[pixel + 1], file[pixel], 255});
    return picture;
  }

  /// xdotool with these arguments.
  static CommandResult user(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"/usr/bin/env", "timeout", "240", "xdotool"});
    return runCommand(arguments);
  }

  static void press(std::vector<std::string> keys) {
    keys.insert(keys.begin(), {"key", "--delay", "20"});
    user(std::move(keys));
  }

  /// Waits for a window with this title, and gives it the keyboard. Without a window manager nobody
  /// else does. Returns its number.
  static std::string focusWindow(const std::string& title) {
    std::istringstream lines(user({"search", "--sync", "--onlyvisible", "--name", title}).output);
    std::string window;
    while (lines >> window) continue;
    EXPECT_EQ(user({"windowfocus", "--sync", window}).status, 0) << "no window " << title;
    return window;
  }

  void start(std::vector<std::string> arguments) {
    arguments.insert(
        arguments.begin(),
        {"/usr/bin/env", "-C", folder_, "timeout", "240", dermisViewerProgram, "--validation",
         "--width", std::to_string(width), "--height", std::to_string(height)});
    viewer_ = std::async(std::launch::async,
                         [arguments = std::move(arguments)] { return runCommand(arguments); });
  }

  /// Starts it on the device of the tests, and waits for its window.
  void open(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--device", testDeviceOptions().device});
    start(std::move(arguments));
    window_ = focusWindow("Dermis");
  }

  /// By the viewer's own key, once its picture is at rest.
  Picture screenshotAfter(std::vector<std::string> keys) {
    const std::string name = folder_ + "/dermis-viewer.png";
    keys.emplace_back("p");
    press(std::move(keys));
    waitUntil([&] {
      return std::filesystem::exists(name) ||
             (viewer_.valid() &&
              viewer_.wait_for(std::chrono::seconds(0)) == std::future_status::ready);
    });
    std::optional<Picture> picture = readPng(name);
    std::filesystem::remove(name);
    if (picture) return *picture;
    ADD_FAILURE() << "no screenshot";
    return Picture{width, height, std::vector<std::uint8_t>(std::size_t{4} * width * height)};
  }
  Picture screenshot() { return screenshotAfter({}); }

  /// No message of the validation layer: those would be errors, and the status another.
  void quit() {
    press({"q"});
    expectGoodEnd();
  }
  void expectGoodEnd() {
    const CommandResult result = viewer_.get();
    EXPECT_EQ(result.status, 0);
    EXPECT_EQ(result.errors, "");
  }

  std::string folder_, window_;
  std::FILE* server_ = nullptr;  ///< the output of Xvfb
  int process_ = 0;              ///< of Xvfb
  std::future<CommandResult> viewer_;
};

TEST_F(ViewerTest, PlaysAndShowsWhatKeysAskFor) {
  open({sampleModel("figure"), "--paused", "--time", "0.3"});
  const Picture first = screenshot();
  EXPECT_GT(changes(first, {480, 60, 780, 530}, first, {481, 60, 781, 530}), 1000)
      << "there is something to be seen";

  const Picture stepped = screenshotAfter({"Right", "Right", "Right"});
  EXPECT_GT(changes(first, stepped, scene), 1000) << "the figure has moved";
  EXPECT_LT(changes(first, screenshotAfter({"Left", "Left", "Left"}), scene), 50) << "and back";

  const Picture joints = screenshotAfter({"j"});
  EXPECT_GT(changes(first, joints, scene), 1000) << "joints";
  EXPECT_LT(changes(first, screenshotAfter({"j"}), scene), 50);

  const Picture weights = screenshotAfter({"w"});
  EXPECT_GT(changes(first, weights, scene), 10'000) << "weights";
  EXPECT_GT(changes(weights, first, wholePanel), 1000) << "the scale of colors";
  EXPECT_GT(changes(weights, screenshotAfter({"Tab"}), scene), 1000) << "of the next joint";

  const Picture error = screenshotAfter({"e"});
  EXPECT_GT(changes(error, weights, scene), 3000) << "the error";
  EXPECT_GT(changes(error, first, scene), 10'000);
  EXPECT_LT(changes(error, screenshotAfter({"w", "e"}), scene), 50) << "the same error again";
  EXPECT_LT(changes(first, screenshotAfter({"e"}), scene), 50);

  EXPECT_GT(changes(first, screenshotAfter({"h"}), scene), 50'000) << "help";
  EXPECT_LT(changes(first, screenshotAfter({"Escape"}), scene), 50);

  const Picture otherClip = screenshotAfter({"ctrl+q", "Down"});
  EXPECT_GT(changes(first, otherClip, scene), 1000);
  quit();
}

TEST_F(ViewerTest, PlaysUntilStopped) {
  open({sampleModel("figure"), "--time", "0.3"});
  const Picture first = screenshot();
  EXPECT_TRUE(waitUntil([&] { return changes(first, screenshot(), scene) > 1000; }));
  const Picture stopped = screenshotAfter({"space"});
  EXPECT_EQ(changes(stopped, screenshot(), scene), 0);
  quit();
}

TEST_F(ViewerTest, ShowsTwoMethodsSideBySide) {
  open({sampleModel("arm"), "--paused", "--time", "1"});
  const Picture one = screenshot();
  const Picture linear = screenshotAfter({"1"});
  EXPECT_GT(changes(one, linear, scene), 300) << "an elbow that collapses";

  const Picture same = screenshotAfter({"c"});
  EXPECT_GT(changes(linear, same, scene), 3000);
  EXPECT_LT(changes(same, leftScene, same, rightScene), 50) << "the same method, the same camera";
  const Picture different = screenshotAfter({"2"});
  EXPECT_GT(changes(different, leftScene, different, rightScene), 200);
  EXPECT_LT(changes(same, different, rightScene), 50) << "only the first has changed";
  const Picture centers = screenshotAfter({"8"});
  EXPECT_GT(changes(different, centers, leftScene), 60);
  const Picture both = screenshotAfter({"shift+3"});
  EXPECT_GT(changes(centers, both, rightScene), 200);
  quit();
}

TEST_F(ViewerTest, TheMouseMovesTheCamera) {
  open({sampleModel("arm"), "--paused", "--time", "1"});
  const Picture first = screenshot();
  const auto drag = [&](const char* button) {
    user({"mousemove", "700", "300", "mousedown", button, "mousemove", "720", "310", "mousemove",
          "780", "330", "mouseup", button});
  };
  drag("1");
  const Picture turned = screenshot();
  EXPECT_GT(changes(first, turned, scene), 3000);
  drag("3");
  const Picture panned = screenshot();
  EXPECT_GT(changes(turned, panned, scene), 3000);
  user({"click", "4"});
  EXPECT_GT(changes(panned, screenshot(), scene), 1000) << "the wheel";
  EXPECT_LT(changes(first, screenshotAfter({"f"}), scene), 50) << "as at first";
  quit();
}

void drop(const std::string& path) {
  SDL_Event event{};
  event.drop.type = SDL_DROPFILE;
  event.drop.file = SDL_strdup(path.c_str());
  SDL_PushEvent(&event);
}

// In this process, because xdotool cannot drop files.
TEST_F(ViewerTest, OpensFilesThatAreDroppedAndSaysWhatIsWrongWithOne) {
  const std::string broken = folder_ + "/broken.gltf";
  std::ofstream(broken) << R"({"asset": {"version": "2.0"}, "scene": 7})";
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder_);
  {
    const auto window = viewer::Window::open(width, height, testDeviceOptions());
    ASSERT_TRUE(window) << window.error().message;
    viewer::ViewerOptions options;
    options.isPaused = true;  // and without a model
    viewer::Viewer program(options, **window);
    std::jthread user([&] {
      focusWindow("Dermis");
      const Picture empty = screenshot();
      EXPECT_GT(changes(empty, {500, 280, 760, 320}, empty, {501, 280, 761, 320}), 100)
          << "an invitation";
      EXPECT_EQ(changes(empty, screenshotAfter({"Tab", "Down", "Right", "space", "space"}), scene),
                0);
      drop(sampleModel("figure"));
      focusWindow("figure.glb");
      const Picture shown = screenshot();
      drop(broken);
      const Picture told = screenshot();
      EXPECT_GT(changes(shown, told, message), 5000) << "a message over the picture";
      EXPECT_LT(changes(shown, told, belowMessage), 50) << "of what was there before";
      EXPECT_LT(changes(shown, screenshotAfter({"Escape"}), scene), 50) << "the message is closed";
      drop(sampleModel("bar"));
      focusWindow("bar.glb");
      EXPECT_GT(changes(shown, screenshot(), scene), 10'000) << "another model";
      press({"q"});
    });
    const Result<samples::ExitStatus> status = program.run();
    user.join();
    ASSERT_TRUE(status);
    EXPECT_EQ(*status, samples::ExitStatus::done);
    for (const std::string& text : (*window)->device().device->takeValidationMessages())
      ADD_FAILURE() << text;
  }
  std::filesystem::current_path(before);
}

#ifdef DERMIS_RUNTIME_COMPILER
TEST_F(ViewerTest, ReloadsKernelsThatAreEdited) {
  const ShaderFolder shaders("viewer");
  open({sampleModel("figure"), "--paused", "--time", "0.3", "--shaders", shaders.path().string()});
  const Picture first = screenshot();
  shaders.edit("skin.comp", ShaderFolder::storedPosition, ShaderFolder::movedPosition);
  ASSERT_TRUE(waitUntil([&] { return changes(first, screenshot(), scene) > 3000; }));
  const Picture moved = screenshot();
  EXPECT_GT(changes(first, moved, wholePanel), 100) << "what was done";

  const std::string line = std::to_string(
      shaders.edit("skin.comp", ShaderFolder::movedPosition, ShaderFolder::brokenPosition));
  ASSERT_TRUE(waitUntil([&] { return changes(moved, screenshot(), message) > 5000; }));
  EXPECT_LT(changes(moved, screenshot(), belowMessage), 50) << "of the old kernels";
  shaders.edit("skin.comp", ShaderFolder::brokenPosition, ShaderFolder::storedPosition);
  EXPECT_TRUE(waitUntil([&] { return changes(first, screenshot(), scene) < 50; }));
  press({"q"});
  const CommandResult result = viewer_.get();
  EXPECT_EQ(result.status, 0);
  EXPECT_NE(result.errors.find("skin.comp:" + line + ": "), std::string::npos) << result.errors;
  EXPECT_EQ(result.errors.find("Validation"), std::string::npos) << result.errors;
}
#endif

TEST_F(ViewerTest, TheDisplayShowsWhatScreenshotsShowInAnySize) {
  open({sampleModel("figure"), "--paused", "--time", "0.3"});
  const auto expectSame = [&](const Part& part) {
    const Picture screenshotted = screenshot();
    EXPECT_TRUE(waitUntil([&] {
      const Picture shown = displayed();
      return changes(screenshotted, part, shown, part) == 0;
    }));
    return screenshotted;
  };
  expectSame(scene);
  user({"windowsize", "--sync", window_, "700", "500"});
  user({"windowmove", "--sync", window_, "0", "0"});
  const Picture picture = expectSame({300, 0, 700, 500});
  EXPECT_TRUE(picture.width == 700 && picture.height == 500);
  EXPECT_GT(changes(picture, {400, 60, 600, 430}, picture, {401, 60, 601, 430}), 500);
  quit();
}

TEST_F(ViewerTest, EndsByItselfAfterSomeFrames) {
  start(
      {sampleModel("figure"), "--frames", "5", "--screenshot", "last.png", "--compare", "linear"});
  expectGoodEnd();
  const std::optional<Picture> picture = readPng(folder_ + "/last.png");
  ASSERT_TRUE(picture);
  EXPECT_EQ(picture->width, static_cast<std::uint32_t>(width));
  EXPECT_GT(changes(*picture, leftScene, *picture, wholePanel), 50'000);
}

// Nobody is there to read what stands in the window.
TEST_F(ViewerTest, EndsWithTheFirstErrorOfItsOptionsOrAfterSomeFrames) {
  const std::string model = folder_ + "/texture.png";
  std::filesystem::copy_file(sampleModel("bar"), model);
  struct Case {
    std::vector<std::string> arguments;
    int status;
    std::string sentence;
  };
  const std::vector<Case> cases{
      {{"--method", "cubic"}, 2, "--method: there is no method 'cubic'"},
      {{"--compare", "cubic"}, 2, "--compare: there is no method 'cubic'"},
      {{"--time", ""}, 2, "--time has an empty value"},
      {{"--bogus"}, 2, "there is no option --bogus"},
      {{"--screenshot", "x.jpg"}, 2, "--screenshot must end in .png; it is 'x.jpg'"},
      {{model, "--screenshot", model}, 2, "--screenshot " + model + " would overwrite"},
      {{"nope.glb", "--frames", "2", "--screenshot", "never.png"},
       3,
       "there is no file 'nope.glb'"},
      {{"--device", "no such device"}, 4, ""},
      {{model, "--frames", "2", "--screenshot", "/nonexistent/x.png"},
       5,
       "/nonexistent/x.png cannot"},
  };
  for (const Case& wrong : cases) {
    start(wrong.arguments);
    const CommandResult result = viewer_.get();
    EXPECT_EQ(result.status, wrong.status) << result.errors;
    EXPECT_NE(result.errors.find("dermis_viewer: error: " + wrong.sentence), std::string::npos)
        << result.errors;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/never.png"));
}

}  // namespace
}  // namespace dermis::test
