// The picture of `dermis compare`: the built-in case against theory, pixel by pixel, and against a
// reference.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "compared_figures.h"
#include "comparison_picture.h"
#include "dermis/verify.h"
#include "drawing_device.h"
#include "kit/render/draw.h"
#include "kit/render/renderer.h"
#include "picture_sheet.h"
#include "pictures.h"

namespace dermis::test {
namespace {

namespace render = samples::render;

constexpr std::uint32_t sheetWidth = 320, sheetHeight = 120;
constexpr std::array twoMethods{Method::linear, Method::dualQuaternion};

/// Rows from the first to the last that is not the background, in a column of pixels.
std::uint32_t thickness(const render::Picture& picture, const render::Picture& background,
                        std::uint32_t column) {
  std::uint32_t first = sheetHeight, last = 0;
  for (std::uint32_t row = 0; row < sheetHeight; ++row) {
    const std::size_t pixel = (std::size_t{row} * sheetWidth + column) * 4;
    for (std::size_t i = pixel; i < pixel + 3; ++i) {
      if (std::abs(picture.pixels[i] - background.pixels[i]) <= 2) continue;
      first = std::min(first, row);
      last = std::max(last, row);
    }
  }
  return first > last ? 0 : last - first + 1;
}

/// Means over what is not the background, in linear light.
std::array<double, 3> meanColor(const render::Picture& picture, const render::Picture& background) {
  std::array<double, 3> sums{};
  double count = 0;
  for (std::size_t i = 0; i + 3 < picture.pixels.size(); i += 4) {
    if (std::equal(&picture.pixels[i], &picture.pixels[i] + 3, &background.pixels[i])) continue;
    ++count;
    for (std::size_t channel = 0; channel < 3; ++channel)
      sums[channel] += std::pow(picture.pixels[i + channel] / 255.0, 2.2);
  }
  for (double& sum : sums) sum /= std::max(count, 1.0);
  return sums;
}

/// Degrees around the axis of grays.
double hueOf(const std::array<double, 3>& color) {
  return std::atan2(std::numbers::sqrt3 * (color[1] - color[2]),
                    2 * color[0] - color[1] - color[2]) *
         180 / std::numbers::pi;
}

class ComparisonTest : public DrawingTest {
 protected:
  void SetUp() override {
    DrawingTest::SetUp();
    if (!renderer_) return;
    cli::MeshPreparation preparation;
    preparation.centersOfRotation = true;
    Result<cli::BuiltInScenes> scenes = cli::loadBuiltInScenes(preparation);
    ASSERT_TRUE(scenes) << scenes.error().message;
    scenes_.emplace(std::move(*scenes));
    strips_ = cli::builtInStrips(*scenes_);
  }

  cli::ComparedFigures figuresOf(const cli::ComparisonStrip& strip,
                                 std::span<const Method> methods) {
    Result<cli::ComparedFigures> figures = cli::ComparedFigures::create(
        *drawingDevice(), *renderer_, *strip.scene, strip.pose, methods);
    EXPECT_TRUE(figures) << figures.error().message;
    return std::move(*figures);
  }

  /// From the front, without a ground.
  render::Picture draw(const Box& box, std::span<const render::Draw> draws) {
    render::FrameDescription description{sheetWidth, sheetHeight, 1, {512, 64, 4}};
    Result<render::RenderFrame> frame = renderer_->createFrame(description);
    EXPECT_TRUE(frame);
    render::View view;
    view.area.extent = {sheetWidth, sheetHeight};
    view.casters = box;
    view.style.rim = 0;
    view.style.keyColor = view.style.skyColor = glm::vec3(0.5f);
    render::CameraOptions camera;
    camera.isOrthographic = true;
    camera.azimuth = camera.elevation = 0;
    view.camera =
        render::frameBoxes({&box, 1}, box, camera, static_cast<float>(sheetWidth) / sheetHeight);
    view.draws = draws;
    const VkCommandBuffer commandBuffer = device().allocateCommandBuffer();
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    device().functions().BeginCommandBuffer(commandBuffer, &begin);
    EXPECT_TRUE(renderer_->record(commandBuffer, *frame, {&view, 1}));
    frame->target().recordReadBack(device(), commandBuffer);
    device().functions().EndCommandBuffer(commandBuffer);
    EXPECT_TRUE(device().submitAndWait(commandBuffer));
    device().freeCommandBuffer(commandBuffer);
    return {sheetWidth, sheetHeight, frame->target().pixels()};
  }

  /// Of the built-in case.
  cli::ComparisonSheet sheetOf(std::vector<Method> methods) {
    cli::ComparisonSheet sheet;
    sheet.width = 640;
    for (const Method method : methods)
      sheet.columns.push_back({method, {"1.00 × linear's time", "12.3 ns a vertex"}});
    sheet.strips = strips_;
    sheet.strips.back().showsCost = sheet.strips.back().hasHeatMap = true;
    sheet.footer = "Time: of nobody";
    return sheet;
  }

  render::Picture drawSheet(const cli::ComparisonSheet& sheet, const render::Font* font) {
    std::vector<std::string> notes;
    std::size_t pictures = 0;
    Result<render::Picture> picture =
        cli::drawComparison(*drawingDevice(), sheet, font, notes, [&pictures] { ++pictures; });
    EXPECT_TRUE(picture) << picture.error().message;
    EXPECT_EQ(pictures, cli::comparisonPictures(sheet));
    return picture ? std::move(*picture) : render::Picture{};
  }

  std::optional<cli::BuiltInScenes> scenes_;
  std::vector<cli::ComparisonStrip> strips_;
};

// The candy wrapper: cos(175° / 2) of the radius is left by linear blending, all of it by dual
// quaternions.
TEST_F(ComparisonTest, TheMiddleOfTheTwistedBarIsPlainlyThinnerByLinearBlending) {
  const cli::ComparedFigures figures = figuresOf(strips_[0], twoMethods);
  const render::Picture background = draw(figures.box(), {});
  std::array<std::uint32_t, 2> middle{}, end{};
  for (std::size_t method = 0; method < twoMethods.size(); ++method) {
    std::vector<render::Draw> draws;
    ASSERT_TRUE(figures.addDraws(method, draws));
    const render::Picture picture = draw(figures.box(), draws);
    middle[method] = thickness(picture, background, sheetWidth / 2);
    end[method] = thickness(picture, background, sheetWidth / 8);
  }
  EXPECT_GT(end[1], sheetHeight / 3);
  EXPECT_EQ(end[0], end[1]);
  EXPECT_NEAR(middle[1], end[1], 2);
  EXPECT_LT(middle[0], 0.15 * middle[1]);
}

TEST_F(ComparisonTest, SectionsAreThoseOfTheory) {
  const double degree = std::numbers::pi / 180;
  const cli::ComparedFigures bar = figuresOf(strips_[0], twoMethods);
  const cli::ComparedFigures arm = figuresOf(strips_[1], twoMethods);
  const auto section = [](const cli::ComparisonStrip& strip, const cli::ComparedFigures& figures,
                          std::size_t method) {
    return cli::leastSection(*strip.scene->parts[0].primitive, figures.positions(method, 0),
                             *strip.sections);
  };
  // A twist shrinks a section both ways, a bend only in the plane of the bend.
  EXPECT_NEAR(section(strips_[0], bar, 0), std::pow(std::cos(87.5 * degree), 2), 1e-4);
  EXPECT_NEAR(section(strips_[0], bar, 1), 1, 0.02);
  EXPECT_NEAR(section(strips_[1], arm, 0), std::cos(70 * degree), 0.01);
  EXPECT_NEAR(section(strips_[1], arm, 1), 1, 0.02);
  // As they are, nothing is lost; where no plane meets the mesh, neither.
  const gltf::Primitive& rest = *strips_[0].scene->parts[0].primitive;
  EXPECT_NEAR(cli::leastSection(rest, rest.positions, {0.3, 0.7}), 1, 1e-9);
  EXPECT_EQ(cli::leastSection(rest, rest.positions, {5, 6}), 1);
}

TEST_F(ComparisonTest, DistancesAreThoseOfTheReference) {
  const cli::ComparisonStrip& strip = strips_[1];
  constexpr std::array methods{Method::linear, Method::dualQuaternion, Method::centerOfRotation};
  const cli::ComparedFigures figures = figuresOf(strip, methods);
  const cli::ScenePart& part = strip.scene->parts[0];
  const auto skinned = [&](Method method) {
    return reference::skin(part.mesh->view(), strip.pose.pose(part), method)->positions;
  };
  const std::vector<reference::Double3> base = skinned(Method::dualQuaternion);
  for (std::size_t method = 0; method < methods.size(); ++method) {
    SCOPED_TRACE(methodName(methods[method]));
    const std::vector<reference::Double3> other = skinned(methods[method]);
    double largest = 0, squares = 0;
    for (std::size_t vertex = 0; vertex < base.size(); ++vertex) {
      const double distance =
          std::hypot(base[vertex][0] - other[vertex][0], base[vertex][1] - other[vertex][1],
                     base[vertex][2] - other[vertex][2]);
      largest = std::max(largest, distance);
      squares += distance * distance;
    }
    EXPECT_NEAR(figures.difference(method).largest, largest, 1e-5);
    EXPECT_NEAR(figures.difference(method).rootMeanSquare,
                std::sqrt(squares / static_cast<double>(base.size())), 1e-6);
  }
  EXPECT_EQ(figures.difference(1).largest, 0) << "its own distance";
  EXPECT_GT(figures.difference(0).largest, 0.01);
}

TEST_F(ComparisonTest, TheHeatMapOfDualQuaternionsIsColdEverywhere) {
  cli::ComparedFigures figures = figuresOf(strips_[1], twoMethods);
  ASSERT_TRUE(figures.makeHeatMaps(figures.difference(0).largest));
  const render::Picture background = draw(figures.box(), {});
  std::array<std::size_t, 2> warm{}, all{};
  for (std::size_t method = 0; method < twoMethods.size(); ++method) {
    std::vector<render::Draw> draws;
    ASSERT_TRUE(figures.addHeatMap(method, draws));
    const render::Picture picture = draw(figures.box(), draws);
    for (std::size_t i = 0; i < picture.pixels.size(); i += 4) {
      const std::uint8_t* pixel = &picture.pixels[i];
      if (std::equal(pixel, pixel + 3, &background.pixels[i])) continue;
      ++all[method];
      // Slate is blue before it is green, and red last of all.
      if (pixel[0] > pixel[2] || pixel[1] > pixel[2] + 2) ++warm[method];
    }
  }
  EXPECT_GT(all[1], 2000u);
  EXPECT_EQ(warm[1], 0u);
  EXPECT_GT(warm[0], 200u) << "linear blending is far away at the elbow";
}

TEST_F(ComparisonTest, TheScaleHasTheColorsOfTheSurface) {
  cli::ComparedFigures figures = figuresOf(strips_[0], twoMethods);
  ASSERT_TRUE(figures.makeHeatMaps(1));
  std::vector<render::Draw> draws;
  ASSERT_TRUE(figures.addHeatMap(1, draws));
  const render::Picture background = draw(figures.box(), {});
  const std::uint32_t vertices = scenes_->bar.parts[0].primitive->vertexCount;
  Result<samples::MappedBuffer> values = samples::MappedBuffer::create(
      device(), vertices * sizeof(float), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  ASSERT_TRUE(values);
  draws[0].values.buffer = values->handle();
  for (const float value : {0.f, 0.25f, 0.5f, 0.6f, 0.75f, 1.f}) {
    std::fill_n(reinterpret_cast<float*>(values->bytes().data()), vertices, value);
    const std::array<std::uint8_t, 3> scale = render::heatColor(value);
    const render::Picture one{1, 1, {scale[0], scale[1], scale[2], 255}}, black{1, 1, {0, 0, 0, 0}};
    const double off =
        hueOf(meanColor(draw(figures.box(), draws), background)) - hueOf(meanColor(one, black));
    EXPECT_LT(std::abs(std::remainder(off, 360)), 6) << value;
  }
}

TEST_F(ComparisonTest, LooksAsTheReferenceDoes) {
  Result<render::Font> font = render::Font::load();
  if (!font) {
    ASSERT_FALSE(isContinuousIntegration()) << font.error().message;
    GTEST_SKIP() << font.error().message;
  }
  expectAsReference(
      "comparison",
      drawSheet(sheetOf({Method::linear, Method::dualQuaternion, Method::centerOfRotation}),
                &*font),
      {.worstSimilarity = 0.6, .worstColor = 12});
}

TEST_F(ComparisonTest, WithoutATypefaceThePictureHasNoWords) {
  Result<render::Font> font = render::Font::load();
  if (!font) GTEST_SKIP() << font.error().message;
  cli::ComparisonSheet sheet = sheetOf({Method::linear});
  sheet.strips.pop_back();
  const render::Picture with = drawSheet(sheet, &*font), without = drawSheet(sheet, nullptr);
  EXPECT_EQ(with.height, without.height);
  const auto ink = [](const render::Picture& picture) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < picture.pixels.size(); i += 4)
      count += std::ranges::equal(std::span(&picture.pixels[i], 3), cli::sheetInk);
    return count;
  };
  EXPECT_GT(ink(with), 50u);
  EXPECT_EQ(ink(without), 0u);
}

TEST(SheetTest, NamesBreakBehindUnderscoresAndWordsAreCutShort) {
  Result<render::Font> font = render::Font::load();
  if (!font) GTEST_SKIP() << font.error().message;
  const cli::Sheet wide(2000, 4, &*font), narrow(600, 4, &*font);
  const cli::Sheet::Style style{24, cli::sheetInk};
  EXPECT_EQ(cli::brokenName(wide, "quaternion_translation", style),
            std::vector<std::string>{"quaternion_translation"});
  EXPECT_EQ(cli::brokenName(narrow, "quaternion_translation", style),
            (std::vector<std::string>{"quaternion_", "translation"}));
  EXPECT_EQ(cli::brokenName(narrow, "linear", style), std::vector<std::string>{"linear"});

  cli::Sheet sheet(400, 1, &*font);
  std::string longName(500, 'M');
  longName += "ü";
  sheet.left(longName, style);
  sheet.advance(30);
  const render::Picture picture = sheet.take();
  for (std::uint32_t row = 0; row < picture.height; ++row) {
    for (std::uint32_t x = 392; x < 400; ++x) {
      EXPECT_TRUE(std::ranges::equal(
          std::span(&picture.pixels[(std::size_t{row} * 400 + x) * 4], 3), cli::sheetPaper))
          << "the margin stays free";
    }
  }
}

}  // namespace
}  // namespace dermis::test
