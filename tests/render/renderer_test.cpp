// The renderer by itself, with the validation layer on: drawing from what Dermis has skinned, and
// whether what it draws is there, whole, and the right side out.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "drawing_device.h"
#include "drawn_scene.h"
#include "kit/render/renderer.h"
#include "pictures.h"
#include "test_data.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

namespace render = samples::render;

constexpr std::uint32_t width = 320, height = 180;

class RendererTest : public DrawingTest {
 protected:
  void SetUp() override {
    DrawingTest::SetUp();
    if (!renderer_) return;
    render::FrameDescription description;
    description.width = width;
    description.height = height;
    description.views = 2;
    description.shadows = {512, 128, 6};
    Result<render::RenderFrame> frame = renderer_->createFrame(description);
    ASSERT_TRUE(frame) << frame.error().message;
    frame_.emplace(std::move(*frame));
  }

  /// Skins where there is a scene, and draws in the same command buffer.
  render::Picture draw(cli::DrawnScene* scene, std::vector<render::View> views) {
    const samples::VulkanFunctions& functions = device().functions();
    const VkCommandBuffer commandBuffer = device().allocateCommandBuffer();
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    functions.BeginCommandBuffer(commandBuffer, &begin);
    if (scene != nullptr) {
      EXPECT_TRUE(scene->recordSkinning(commandBuffer));
    }
    const Result<void> done = renderer_->record(commandBuffer, *frame_, views);
    EXPECT_TRUE(done) << done.error().message;
    frame_->target().recordReadBack(device(), commandBuffer);
    functions.EndCommandBuffer(commandBuffer);
    EXPECT_TRUE(device().submitAndWait(commandBuffer));
    device().freeCommandBuffer(commandBuffer);
    return {width, height, frame_->target().pixels()};
  }

  /// The pose, and the box around it.
  std::optional<Box> pose(cli::DrawnScene& drawn, const cli::Scene& scene, double time) {
    EXPECT_TRUE(drawn.beginFrame());
    const std::uint32_t clip = scene.model->clips.empty() ? noIndex : 0;
    EXPECT_TRUE(drawn.setPose(0, cli::scenePose(scene, clip, time)));
    (void)draw(&drawn, {});
    EXPECT_TRUE(drawn.beginFrame());
    const Result<std::optional<Box>> box = drawn.bounds(0);
    return box ? *box : std::nullopt;
  }

  /// Seen a little from below, where there is no ground: only the model and what is behind it.
  render::View viewOf(const Box& box, double azimuth) {
    render::View view;
    view.area.extent = {width, height};
    view.casters = box;
    render::CameraOptions camera;
    camera.azimuth = azimuth;
    camera.elevation = -8;
    view.camera = render::frameBoxes({&box, 1}, box, camera, static_cast<float>(width) / height);
    return view;
  }

  std::optional<render::RenderFrame> frame_;
};

/// Which pixels are not the background.
std::vector<bool> silhouette(const render::Picture& picture, const render::Picture& background) {
  std::vector<bool> inside(picture.pixels.size() / 4);
  for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
    if (std::abs(picture.pixels[i] - background.pixels[i]) > 2) inside[i / 4] = true;
  }
  return inside;
}

double meanOver(const render::Picture& picture, const std::vector<bool>& inside) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < inside.size(); ++i) {
    if (!inside[i]) continue;
    for (std::size_t channel = 0; channel < 3; ++channel) sum += picture.pixels[i * 4 + channel];
    count += 3;
  }
  return count > 0 ? sum / count : 0;
}

struct Margins {
  std::uint32_t left = width, right = width, top = height, bottom = height;
};

Margins marginsOf(const std::vector<bool>& inside) {
  Margins margins;
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      if (!inside[std::size_t{y} * width + x]) continue;
      margins.left = std::min(margins.left, x);
      margins.right = std::min(margins.right, width - 1 - x);
      margins.top = std::min(margins.top, y);
      margins.bottom = std::min(margins.bottom, height - 1 - y);
    }
  }
  return margins;
}

Result<cli::Scene> sceneOf(const std::filesystem::path& path) {
  cli::MeshPreparation preparation;
  preparation.images = true;
  return cli::loadScene(path, preparation);
}

TEST_F(RendererTest, DrawsTwoViewsAHeatMapAndNothingElse) {
  const Result<cli::Scene> scene = sceneOf(std::string(sampleModels) + "/arm.glb");
  ASSERT_TRUE(scene);
  Result<cli::DrawnScene> drawn =
      cli::DrawnScene::create(*drawingDevice(), *renderer_, *scene, 1, Method::dualQuaternion);
  ASSERT_TRUE(drawn) << drawn.error().message;
  const std::optional<Box> box = pose(*drawn, *scene, 1);
  ASSERT_TRUE(box);
  std::vector<render::Draw> draws;
  ASSERT_TRUE(drawn->addDraws(0, {}, draws));
  std::vector<render::Draw> hot = draws;
  const std::uint32_t vertices = scene->parts[0].primitive->vertexCount;
  Result<samples::MappedBuffer> values = samples::MappedBuffer::create(
      device(), vertices * sizeof(float), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  ASSERT_TRUE(values);
  std::fill_n(reinterpret_cast<float*>(values->bytes().data()), vertices, 1.0f);
  for (render::Draw& draw : hot) draw.values = {values->handle(), 0, sizeof(float)};

  render::View left = viewOf(*box, 30), right = left;
  left.area = {{0, 0}, {width / 2, height}};
  right.area = {{static_cast<std::int32_t>(width / 2), 0}, {width / 2, height}};
  left.camera = right.camera =
      render::frameBoxes({&*box, 1}, *box, {}, static_cast<float>(width / 2) / height);
  left.draws = draws;
  right.draws = hot;
  const render::Picture empty = [&] {
    render::View a = left, b = right;
    a.draws = b.draws = {};
    return draw(nullptr, {a, b});
  }();
  const render::Picture picture = draw(nullptr, {left, right});
  const std::vector<bool> inside = silhouette(picture, empty);
  double reds[2] = {0, 0};
  std::size_t counts[2] = {0, 0};
  for (std::size_t i = 0; i < inside.size(); ++i) {
    const std::size_t side = i % width < width / 2 ? 0 : 1;
    if (!inside[i]) continue;
    ++counts[side];
    reds[side] += picture.pixels[i * 4] - picture.pixels[i * 4 + 1];
  }
  EXPECT_GT(counts[0], 1000u);
  EXPECT_NEAR(static_cast<double>(counts[0]), static_cast<double>(counts[1]), 30);
  EXPECT_GT(reds[1] / static_cast<double>(counts[1]), 80) << "what is much is red";
  EXPECT_LT(reds[0] / static_cast<double>(counts[0]), 60) << "skin is not";
}

TEST_F(RendererTest, RefusesWhatItCannotDraw) {
  const Result<cli::Scene> scene = sceneOf(std::string(sampleModels) + "/bar.glb");
  ASSERT_TRUE(scene);
  Result<cli::DrawnScene> drawn =
      cli::DrawnScene::create(*drawingDevice(), *renderer_, *scene, 1, Method::linear);
  ASSERT_TRUE(drawn);
  const std::optional<Box> box = pose(*drawn, *scene, 0);
  ASSERT_TRUE(box);
  std::vector<render::Draw> draws;
  ASSERT_TRUE(drawn->addDraws(0, {}, draws));
  draws[0].positions.format = VertexFormat::snorm16x4;
  render::View view = viewOf(*box, 0);
  view.draws = draws;
  const VkCommandBuffer commandBuffer = device().allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  device().functions().BeginCommandBuffer(commandBuffer, &begin);
  const Result<void> odd = renderer_->record(commandBuffer, *frame_, {&view, 1});
  ASSERT_FALSE(odd);
  EXPECT_EQ(odd.error().code, ErrorCode::invalidArgument);
  EXPECT_NE(odd.error().message.find("snorm16x4"), std::string::npos) << odd.error().message;
  const std::vector<render::View> many(3, viewOf(*box, 0));
  EXPECT_FALSE(renderer_->record(commandBuffer, *frame_, many));
  device().functions().EndCommandBuffer(commandBuffer);
  device().freeCommandBuffer(commandBuffer);
}

/// Closed models, or nearly: what is wound the wrong way, or has normals that point inwards, is
/// dark from where the light comes.
void expectGoodPicture(const Margins& margins, std::size_t pixels, double lit, double shaded) {
  EXPECT_GT(pixels, width * height / 200) << "something is there";
  EXPECT_LT(pixels, width * height * 3 / 4);
  for (const std::uint32_t margin : {margins.left, margins.right, margins.top, margins.bottom})
    EXPECT_GE(margin, height / 20) << "all of it";
  // Of the box around it, whose corners need not be filled.
  EXPECT_TRUE(margins.left + margins.right < width / 2 || margins.top + margins.bottom < height / 2)
      << "as large as it can be";
  EXPECT_GT(lit, 1.5 * shaded) << "the right side out";
}

TEST_F(RendererTest, RealModelsAreWholeAndTheRightSideOut) {
  const std::optional<std::filesystem::path> data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  std::size_t seen = 0;
  for (const char* name :
       {"CesiumMan/glTF-Binary/CesiumMan.glb", "Fox/glTF-Binary/Fox.glb", "Fox/glTF/Fox.gltf",
        "RiggedFigure/glTF-Binary/RiggedFigure.glb", "RiggedSimple/glTF-Binary/RiggedSimple.glb",
        "RecursiveSkeletons/glTF-Binary/RecursiveSkeletons.glb", "Mannequiny/mannequiny-0.3.0.glb",
        "QuaterniusWasp/Wasp.glb", "LuantiDevtest/gltf_spider_animated.gltf",
        "GdxPbrTest/pbrTest.gltf", "BlenderIO_SkinnedCylinder/03_skinned_cylinder.gltf"}) {
    SCOPED_TRACE(name);
    if (!std::filesystem::exists(*data / "models" / name)) continue;
    const Result<cli::Scene> scene = sceneOf(*data / "models" / name);
    ASSERT_TRUE(scene) << scene.error().message;
    Result<cli::DrawnScene> drawn =
        cli::DrawnScene::create(*drawingDevice(), *renderer_, *scene, 1, Method::dualQuaternion);
    ASSERT_TRUE(drawn) << drawn.error().message;
    EXPECT_TRUE(drawn->notes().empty()) << drawn->notes().front();
    const std::optional<Box> box = pose(*drawn, *scene, 0.4);
    ASSERT_TRUE(box);
    std::vector<render::Draw> draws;
    ASSERT_TRUE(drawn->addDraws(0, {}, draws));
    render::View view = viewOf(*box, 40);
    // Light from the camera's side alone, then from the other side alone.
    view.style.skyColor = view.style.bounceColor = glm::vec3(0.02f);
    view.style.rim = 0;
    view.style.keyAzimuth = 0;
    view.style.keyElevation = 10;
    const render::Picture background = draw(nullptr, {view});
    view.draws = draws;
    const render::Picture front = draw(nullptr, {view});
    view.style.keyAzimuth = 180;
    const render::Picture back = draw(nullptr, {view});
    const std::vector<bool> inside = silhouette(back, background);
    expectGoodPicture(marginsOf(inside), static_cast<std::size_t>(std::ranges::count(inside, true)),
                      meanOver(front, inside), meanOver(back, inside));
    ++seen;
  }
  EXPECT_GE(seen, 10u);
}

TEST_F(RendererTest, LabelsArePartOfThePicture) {
  Result<render::Font> font = render::Font::load();
  if (!font) {
    ASSERT_FALSE(isContinuousIntegration()) << font.error().message;
    GTEST_SKIP() << font.error().message;
  }
  render::Picture picture{64, 32, std::vector<std::uint8_t>(64 * 32 * 4, 0)};
  font->draw(picture, "dq °", {4, 24, 24, {255, 200, 100}});
  std::size_t bright = 0;
  for (std::size_t i = 0; i < picture.pixels.size(); i += 4) bright += picture.pixels[i] > 200;
  EXPECT_GT(bright, 40u);
  EXPECT_LT(bright, 600u);
  EXPECT_GT(font->width("dq", 24), font->width("d", 24));
  // What lies outside is cut off.
  font->draw(picture, "far away", {-1000, 500, 400, {}});
  const Result<std::vector<std::byte>> png = render::encodePng(picture);
  ASSERT_TRUE(png);
  EXPECT_TRUE(render::decodeImage(*png));
}

TEST(TextureTest, BrokenImagesAreErrors) {
  EXPECT_FALSE(render::decodeImage({}));
  render::Picture picture{16, 16, std::vector<std::uint8_t>(16 * 16 * 4, 90)};
  const std::vector<std::byte> png = *render::encodePng(picture);
  for (std::size_t length = 0; length < png.size(); length += 7)
    (void)render::decodeImage(std::span(png).first(length));
  std::vector<std::byte> huge = png;
  huge[17] = std::byte{0x7f};  // the width, beyond anything
  const auto result = render::decodeImage(huge);
  ASSERT_FALSE(result);
}

// A few kilobytes may hold a picture of 256 MiB: it is not decoded to find that out.
TEST(TextureTest, PixelsAreSpentOnTheBudgetOfTheirFile) {
  const render::Picture picture{2048, 2048, std::vector<std::uint8_t>(2048 * 2048 * 4, 90)};
  const std::vector<std::byte> png = *render::encodePng(picture);
  const std::uint64_t size = picture.pixels.size(), whole = 4 * size + 1;
  std::uint64_t left = whole;
  for (std::uint64_t count = 1; count <= whole / size; ++count) {
    EXPECT_TRUE(render::decodeImage(png, &left));
    EXPECT_EQ(left, whole - count * size);
  }
  const auto beyond = render::decodeImage(png, &left);
  ASSERT_FALSE(beyond);
  EXPECT_EQ(beyond.error().code, ErrorCode::limitExceeded);
  EXPECT_NE(beyond.error().message.find("2048 x 2048 pixels take more memory"), std::string::npos);
}

}  // namespace
}  // namespace dermis::test
