// dermis_viewer, as a user sees it: on a display without a screen, with keys pressed and pictures
// taken. Nothing here waits for a time: a screenshot is taken when the picture is at rest.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "display.h"
#include "pictures.h"
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

/// Pixels that are red, yellow or orange: what is much, in a heat map.
int hotPixels(const Picture& picture, const Part& part) {
  int count = 0;
  for (std::uint32_t y = part.top; y < part.bottom; ++y) {
    for (std::uint32_t x = part.left; x < part.right; ++x) {
      const std::uint8_t* pixel = pixelOf(picture, x, y);
      count += pixel[0] > 180 && pixel[2] < 90;
    }
  }
  return count;
}

std::string textOf(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string sampleModel(const std::string& name) {
  return std::string(sampleModels) + "/" + name + ".glb";
}

class ViewerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string reason;
    if (testDevice(true, reason) != nullptr) {
      std::string pattern = ::testing::TempDir() + "viewerXXXXXX";
      ASSERT_NE(mkdtemp(pattern.data()), nullptr);
      folder_ = pattern;
      display_ = Display::open(folder_, width, height, reason);
    }
    if (display_ != nullptr) return;
    ASSERT_FALSE(isContinuousIntegration()) << reason;
    GTEST_SKIP() << reason;
  }

  void TearDown() override {
    viewer_.reset();
    display_.reset();
    if (!folder_.empty() && !HasFailure()) std::filesystem::remove_all(folder_);
  }

  void start(std::vector<std::string> arguments) {
    arguments.insert(
        arguments.begin(),
        {"env", "DISPLAY=" + display_->name(), "SDL_VIDEODRIVER=x11", dermisViewerProgram,
         "--validation", "--width", std::to_string(width), "--height", std::to_string(height)});
    const std::string device = testDeviceOptions().device;
    arguments.insert(arguments.end(), {"--device", device});
    viewer_ = std::make_unique<ChildProcess>(arguments, folder_, folder_ + "/output", errorFile());
  }

  /// Starts it, and waits for its window.
  void open(const std::vector<std::string>& arguments) {
    start(arguments);
    window_ = display_->focusWindow("Dermis").value_or("");
    ASSERT_FALSE(window_.empty()) << "no window; " << errors();
  }

  void press(const std::vector<std::string>& keys) { display_->press(keys); }

  /// By the viewer's own key, once its picture is at rest.
  Picture screenshot(std::uint32_t expectedWidth = width, std::uint32_t expectedHeight = height) {
    const std::string name = folder_ + "/dermis-viewer.png";
    press({"p"});
    waitUntil([&] {
      return std::filesystem::exists(name) || (viewer_ != nullptr && !viewer_->isRunning());
    });
    std::optional<Picture> picture = readPng(name);
    std::filesystem::remove(name);
    if (!picture) {
      ADD_FAILURE() << "no screenshot; " << errors();
      return Picture{width, height, std::vector<std::uint8_t>(std::size_t{4} * width * height)};
    }
    EXPECT_EQ(picture->width, expectedWidth);
    EXPECT_EQ(picture->height, expectedHeight);
    return *picture;
  }

  Picture screenshotAfter(const std::vector<std::string>& keys) {
    press(keys);
    return screenshot();
  }

  std::string errorFile() const { return folder_ + "/errors"; }
  std::string errors() const { return textOf(errorFile()); }

  /// No message of the validation layer: those would be errors, and the status another.
  void expectGoodEnd() {
    EXPECT_EQ(viewer_->wait(), 0) << errors();
    EXPECT_TRUE(errors().empty()) << errors();
  }

  std::string folder_, window_;
  std::unique_ptr<Display> display_;
  std::unique_ptr<ChildProcess> viewer_;
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
  EXPECT_GT(hotPixels(weights, scene), 300) << "of the hips";
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
  press({"q"});
  expectGoodEnd();
}

TEST_F(ViewerTest, PlaysUntilStopped) {
  open({sampleModel("figure"), "--time", "0.3"});
  const Picture first = screenshot();
  EXPECT_TRUE(waitUntil([&] { return changes(first, screenshot(), scene) > 1000; }));
  press({"space"});
  const Picture stopped = screenshot();
  EXPECT_EQ(changes(stopped, screenshot(), scene), 0);
  press({"q"});
  expectGoodEnd();
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
  EXPECT_GT(changes(same, different, leftScene), 200);

  // Centres of rotation are found first, and the right side is as it was.
  const Picture centres = screenshotAfter({"8"});
  EXPECT_GT(changes(different, centres, leftScene), 60);
  EXPECT_LT(changes(different, centres, rightScene), 50);
  const Picture both = screenshotAfter({"shift+3"});
  EXPECT_GT(changes(centres, both, rightScene), 200);
  press({"q"});
  expectGoodEnd();
}

TEST_F(ViewerTest, TheMouseMovesTheCamera) {
  open({sampleModel("arm"), "--paused", "--time", "1"});
  const Picture first = screenshot();
  const auto drag = [&](const char* button) {
    display_->user({"mousemove", "700", "300", "mousedown", button, "mousemove", "720", "310",
                    "mousemove", "780", "330", "mouseup", button});
  };
  drag("1");
  const Picture turned = screenshot();
  EXPECT_GT(changes(first, turned, scene), 3000);
  drag("3");
  const Picture panned = screenshot();
  EXPECT_GT(changes(turned, panned, scene), 3000);
  display_->user({"click", "4"});
  EXPECT_GT(changes(panned, screenshot(), scene), 1000) << "the wheel";
  EXPECT_LT(changes(first, screenshotAfter({"f"}), scene), 50) << "as at first";
  press({"q"});
  expectGoodEnd();
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
  setenv("DISPLAY", display_->name().c_str(), 1);
  setenv("SDL_VIDEODRIVER", "x11", 1);
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder_);
  {
    const auto window = viewer::Window::open(width, height, testDeviceOptions());
    ASSERT_TRUE(window) << window.error().message;
    viewer::ViewerOptions options;
    options.isPaused = true;
    viewer::Viewer program(options, **window);
    std::jthread user([&] {
      drop(sampleModel("figure"));
      EXPECT_TRUE(display_->focusWindow("figure.glb").has_value());
      const Picture shown = screenshot();
      drop(broken);
      const Picture told = screenshot();
      EXPECT_GT(changes(shown, told, message), 5000) << "a message over the picture";
      EXPECT_LT(changes(shown, told, belowMessage), 50) << "of what was there before";
      EXPECT_LT(changes(shown, screenshotAfter({"Escape"}), scene), 50) << "the message is closed";
      drop(sampleModel("bar"));
      EXPECT_TRUE(display_->focusWindow("bar.glb").has_value());
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
  ASSERT_TRUE(
      waitUntil([&] { return errors().find("skin.comp:" + line + ": ") != std::string::npos; }));
  const Picture told = screenshot();
  EXPECT_GT(changes(moved, told, message), 5000) << "a message over the picture";
  EXPECT_LT(changes(moved, told, belowMessage), 50) << "of the old kernels";

  shaders.edit("skin.comp", ShaderFolder::brokenPosition, ShaderFolder::storedPosition);
  EXPECT_TRUE(waitUntil([&] { return changes(first, screenshot(), scene) < 50; }));
  press({"q"});
  EXPECT_EQ(viewer_->wait(), 0);
  EXPECT_EQ(errors().find("Validation"), std::string::npos) << errors();
}
#endif

TEST_F(ViewerTest, BeginsWithoutAModel) {
  open({});
  const Picture empty = screenshot();
  EXPECT_GT(changes(empty, {500, 280, 760, 320}, empty, {501, 280, 761, 320}), 100)
      << "an invitation";
  EXPECT_EQ(changes(empty, screenshotAfter({"c", "j", "e", "space", "Tab", "1", "Down"}), scene),
            0);
  press({"q"});
  expectGoodEnd();
}

TEST_F(ViewerTest, TheDisplayShowsWhatScreenshotsShow) {
  open({sampleModel("figure"), "--paused", "--time", "0.3"});
  const Picture screenshotted = screenshot();
  int last = -1;
  EXPECT_TRUE(waitUntil([&] {
    const std::optional<Picture> shown = display_->picture();
    last = shown && shown->width == static_cast<std::uint32_t>(width)
               ? changes(*shown, screenshotted, {300, 0, width, 400})
               : -1;
    return last == 0;
  })) << last;
  press({"q"});
  expectGoodEnd();
}

TEST_F(ViewerTest, FollowsTheSizeOfItsWindow) {
  open({sampleModel("figure"), "--paused"});
  screenshot();
  display_->user({"windowsize", "--sync", window_, "700", "500"});
  const Picture picture = screenshot(700, 500);
  EXPECT_GT(changes(picture, {400, 60, 600, 430}, picture, {401, 60, 601, 430}), 500);
  press({"q"});
  expectGoodEnd();
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

TEST_F(ViewerTest, SaysWhatIsWrongWithItsOptions) {
  const std::string model = folder_ + "/texture.png";
  std::filesystem::copy_file(sampleModel("bar"), model);
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong{
      {{"--method", "cubic"}, "--method: there is no method 'cubic'"},
      {{"--compare", "cubic"}, "--compare: there is no method 'cubic'"},
      {{"--time", ""}, "--time has an empty value"},
      {{"--bogus"}, "there is no option --bogus"},
      {{"--screenshot", "x.jpg"}, "--screenshot must end in .png; it is 'x.jpg'"},
      {{model, "--screenshot", model}, "--screenshot " + model + " would overwrite"},
  };
  for (const auto& [arguments, sentence] : wrong) {
    start(arguments);
    EXPECT_EQ(viewer_->wait(), 2) << sentence;
    EXPECT_NE(errors().find("dermis_viewer: error: " + sentence), std::string::npos) << errors();
  }
  start({"--device", "no such device"});
  EXPECT_NE(viewer_->wait(), 0);
}

// Nobody is there to read what stands in the window.
TEST_F(ViewerTest, EndsWithTheFirstErrorAfterSomeFrames) {
  start({folder_ + "/nope.glb", "--frames", "2", "--screenshot", "never.png"});
  EXPECT_EQ(viewer_->wait(), 3) << errors();
  EXPECT_NE(errors().find("dermis_viewer: error: "), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/never.png"));
  start({sampleModel("bar"), "--frames", "2", "--screenshot", "/nonexistent/x.png"});
  EXPECT_EQ(viewer_->wait(), 5) << errors();
  EXPECT_NE(errors().find("/nonexistent/x.png cannot be written"), std::string::npos) << errors();
}

}  // namespace
}  // namespace dermis::test
