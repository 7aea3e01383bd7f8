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
#include <utility>
#include <vector>

#include "display.h"
#include "pictures.h"
#include "shader_folder.h"
#include "test_device.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using samples::render::Picture;

constexpr int width = 960, height = 600;

struct Part {
  std::uint32_t left = 0, top = 0, right = 0, bottom = 0;
};

// Beside the panel, below the methods' names, above the clip.
constexpr Part scene{300, 60, width, height - 70};
// Without the line between them.
constexpr Part leftScene{304, 60, 626, height - 70}, rightScene{634, 60, 956, height - 70};
constexpr Part wholePanel{0, 0, 300, height};

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
  Picture screenshot() {
    const std::string name = folder_ + "/dermis-viewer-1.png";
    press({"p"});
    waitUntil([&] { return std::filesystem::exists(name) || !viewer_->isRunning(); });
    std::optional<Picture> picture = readPng(name);
    std::filesystem::remove(name);
    if (!picture) {
      ADD_FAILURE() << "no screenshot; " << errors();
      return Picture{width, height, std::vector<std::uint8_t>(std::size_t{4} * width * height)};
    }
    EXPECT_EQ(picture->width, static_cast<std::uint32_t>(width));
    EXPECT_EQ(picture->height, static_cast<std::uint32_t>(height));
    return *picture;
  }

  Picture screenshotAfter(const std::vector<std::string>& keys) {
    press(keys);
    return screenshot();
  }

  void typePath(const std::string& path) {
    press({"o"});
    display_->type(path);
    press({"Return"});
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

  const Picture otherClip = screenshotAfter({"bracketright"});
  EXPECT_GT(changes(first, otherClip, scene), 1000);
  const Picture withoutPanel = screenshotAfter({"u"});
  EXPECT_GT(changes(otherClip, withoutPanel, wholePanel), 50'000);
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
  const Picture both = screenshotAfter({"shift+2", "m"});
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
  EXPECT_LT(changes(first, screenshotAfter({"shift+f"}), scene), 50) << "as at first";
  press({"q"});
  expectGoodEnd();
}

TEST_F(ViewerTest, SaysWhatIsWrongWithAFileAndGoesOn) {
  const std::string broken = folder_ + "/broken.gltf";
  std::ofstream(broken) << R"({"asset": {"version": "2.0"}, "scene": 7})";
  open({sampleModel("figure"), "--paused"});
  const Picture before = screenshot();
  typePath(broken);
  ASSERT_TRUE(waitUntil([&] { return errors().find("broken.gltf") != std::string::npos; }));
  EXPECT_EQ(errors().find('o' + broken), std::string::npos) << "the key's own letter";
  const Picture told = screenshot();
  EXPECT_GT(changes(before, told, {340, 50, 920, 120}), 5000) << "a message over the picture";
  EXPECT_LT(changes(before, told, {300, 200, width, 500}), 50) << "of what was there before";
  EXPECT_LT(changes(before, screenshotAfter({"Escape"}), scene), 50) << "the message is closed";

  typePath(sampleModel("bar"));
  EXPECT_TRUE(display_->focusWindow("bar.glb").has_value());
  EXPECT_GT(changes(before, screenshot(), scene), 10'000) << "another model";
  press({"q"});
  EXPECT_EQ(viewer_->wait(), 0);
  EXPECT_EQ(errors().find("Validation"), std::string::npos) << errors();
}

#ifdef DERMIS_RUNTIME_COMPILER
TEST_F(ViewerTest, ReloadsKernelsThatAreEdited) {
  const ShaderFolder shaders("viewer");
  open({sampleModel("figure"), "--paused", "--time", "0.3", "--shaders", shaders.path().string(),
        "--shader-cache", folder_ + "/cache"});
  const Picture first = screenshot();
  EXPECT_FALSE(std::filesystem::is_empty(folder_ + "/cache"));
  shaders.edit("skin.comp", ShaderFolder::storedPosition, ShaderFolder::movedPosition);
  ASSERT_TRUE(waitUntil([&] { return changes(first, screenshot(), scene) > 3000; }));
  const Picture moved = screenshot();
  EXPECT_GT(changes(first, moved, wholePanel), 100) << "what was done";

  const std::string line = std::to_string(
      shaders.edit("skin.comp", ShaderFolder::movedPosition, ShaderFolder::brokenPosition));
  ASSERT_TRUE(
      waitUntil([&] { return errors().find("skin.comp:" + line + ": ") != std::string::npos; }));
  const Picture told = screenshot();
  EXPECT_GT(changes(moved, told, {340, 50, 920, 120}), 5000) << "a message over the picture";
  EXPECT_LT(changes(moved, told, {300, 200, width, 500}), 50) << "of the old kernels";

  shaders.edit("skin.comp", ShaderFolder::brokenPosition, ShaderFolder::storedPosition);
  EXPECT_TRUE(waitUntil([&] { return changes(first, screenshot(), scene) < 50; }));
  press({"q"});
  EXPECT_EQ(viewer_->wait(), 0);
  EXPECT_EQ(errors().find("Validation"), std::string::npos) << errors();
}
#endif

// However many keys come within one frame.
TEST_F(ViewerTest, ReadsHastyFingers) {
  open({sampleModel("figure"), "--paused"});
  const Picture before = screenshot();
  const auto hurry = [&](const char* end) {
    display_->user({"key", "--delay", "0", "o", "a", "slash", "B", end, "j"});
  };
  hurry("Escape");
  const Picture joints = screenshot();
  EXPECT_GT(changes(before, joints, scene), 1000) << "j is no letter of the path any more";
  hurry("Return");
  EXPECT_TRUE(waitUntil([&] { return errors().find("'a/B'") != std::string::npos; })) << errors();
  EXPECT_LT(changes(before, screenshotAfter({"Escape"}), scene), 50) << "j once more";
  press({"q"});
  EXPECT_EQ(viewer_->wait(), 0);
}

TEST_F(ViewerTest, BeginsWithoutAModel) {
  open({"--empty"});
  const Picture empty = screenshot();
  EXPECT_GT(changes(empty, {400, 200, 860, 400}, empty, {401, 200, 861, 400}), 100)
      << "an invitation";
  EXPECT_EQ(changes(empty, screenshotAfter({"c", "j", "e", "space", "Tab", "1"}), scene), 0);
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
  const std::string name = folder_ + "/dermis-viewer-1.png";
  press({"p"});
  EXPECT_TRUE(waitUntil([&] { return std::filesystem::exists(name); }));
  const std::optional<Picture> picture = readPng(name);
  ASSERT_TRUE(picture);
  EXPECT_EQ(picture->width, 700u);
  EXPECT_EQ(picture->height, 500u);
  EXPECT_GT(changes(*picture, {400, 60, 600, 430}, *picture, {401, 60, 601, 430}), 500);
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
      {{"--empty", "--animation", "walk"}, "--empty excludes --animation"},
      {{sampleModel("bar"), "--animation", "zzz"}, "--animation: there is no clip 'zzz'"},
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
