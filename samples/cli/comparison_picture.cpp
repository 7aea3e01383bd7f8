#include "comparison_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include <glm/geometric.hpp>

#include "compared_figures.h"
#include "kit/render/draw.h"
#include "kit/render/renderer.h"
#include "picture_sheet.h"

namespace dermis::cli {
namespace {

namespace render = samples::render;

/// Sizes for columns of usual width.
constexpr Sheet::Style titleStyle{27, sheetInk};
constexpr Sheet::Style remarkStyle{22, sheetPaleInk};
constexpr Sheet::Style nameStyle{26, sheetInk};
constexpr Sheet::Style numberStyle{23, sheetPaleInk};
constexpr float lineGap = 1.22f;
/// Free space at each border of a picture, as a fraction of it.
constexpr double cameraMargin = 0.07;

Sheet::Style scaled(Sheet::Style style, float scale) {
  style.height = std::round(style.height * scale);
  return style;
}

float linearOf(std::uint8_t encoded) {
  const float value = static_cast<float>(encoded) / 255;
  return value <= 0.04045f ? value / 12.92f : std::pow((value + 0.055f) / 1.055f, 2.4f);
}

/// A uniform background that is neither white nor black, because figures may be either.
render::LightingStyle styleOfPictures() {
  render::LightingStyle style;
  style.horizonColor = style.zenithColor = {linearOf(sheetPanel[0]), linearOf(sheetPanel[1]),
                                            linearOf(sheetPanel[2])};
  style.keyElevation = 62;  // short shadows: there is little space next to a figure
  return style;
}

/// Light from all directions, so that colors match the scale, and just enough light from one side
/// to make shapes visible.
render::LightingStyle styleOfHeatMaps() {
  render::LightingStyle style = styleOfPictures();
  style.keyColor = glm::vec3(0.45f);
  style.skyColor = glm::vec3(0.62f);
  style.bounceColor = glm::vec3(0.42f);
  style.rim = 0;
  return style;
}

/// Rounds up to a simple number (1, 1.2, 1.5, …) times a power of ten.
double roundedUp(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double factor : {1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0}) {
    if (factor * power >= value * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

/// The ratio of height to width of a picture that a box fills, within limits.
float heightForWidth(const Box& box, const render::CameraOptions& options) {
  const render::Camera camera = render::frameBoxes({&box, 1}, box, options, 1);
  const glm::vec3 up = glm::cross(camera.towardsEye, camera.right);
  glm::vec2 least(1e30f), most(-1e30f);
  for (int corner = 0; corner < 8; ++corner) {
    const glm::vec3 point((corner & 1) != 0 ? box.max[0] : box.min[0],
                          (corner & 2) != 0 ? box.max[1] : box.min[1],
                          (corner & 4) != 0 ? box.max[2] : box.min[2]);
    const glm::vec2 seen(glm::dot(point, camera.right), glm::dot(point, up));
    least = glm::min(least, seen);
    most = glm::max(most, seen);
  }
  const glm::vec2 side = most - least;
  return std::clamp(side.y / std::max(side.x, 1e-20f) * 1.04f, 0.42f, 1.45f);
}

class ComparisonDrawer {
 public:
  ComparisonDrawer(samples::OpenDevice& device, const ComparisonSheet& described,
                   const render::Font* font, std::vector<std::string>& notes,
                   const std::function<void()>& step)
      : device_(device),
        described_(described),
        notes_(notes),
        step_(step),
        sheet_(described.width, described.columns.size(), font) {
    for (const ComparisonColumn& column : described.columns) methods_.push_back(column.method);
  }

  Result<render::Picture> draw() {
    Result<render::Renderer> renderer = render::Renderer::create(*device_.device, {12, 24, 4});
    if (!renderer) return renderer.error();
    renderer_.emplace(std::move(*renderer));
    space(14);
    for (const ComparisonStrip& strip : described_.strips) {
      if (Result<void> drawn = drawStrip(strip); !drawn) return drawn.error();
    }
    if (!described_.footer.empty()) {
      space(16);
      sheet_.rule();
      space(14);
      write(described_.footer, remarkStyle);
    }
    space(14);
    return sheet_.take();
  }

 private:
  void space(float pixels) { sheet_.advance(std::round(pixels * sheet_.scale())); }

  /// Writes a text on its own line.
  void write(const std::string& text, const Sheet::Style& usual) {
    const Sheet::Style style = scaled(usual, sheet_.scale());
    sheet_.left(text, style);
    sheet_.advance(std::round(style.height * lineGap));
  }

  void writeTitle(const std::string& title, const std::string& remark) {
    space(16);
    sheet_.rule();
    space(18);
    const Sheet::Style style = scaled(titleStyle, sheet_.scale());
    sheet_.left(title, style);
    const Sheet::Style pale = scaled(remarkStyle, sheet_.scale());
    const float from = sheet_.width(title, style) + 24 * sheet_.scale();
    // All on one base line.
    const float lower = std::round((style.height - pale.height) * 0.8f);
    sheet_.advance(lower);
    if (!remark.empty() && from < sheet_.innerWidth() * 0.8f) sheet_.left(remark, pale, from);
    sheet_.advance(std::round(style.height * lineGap) - lower);
    space(6);
  }

  /// Writes names, and lines of numbers below them.
  void writeCaptions(const std::vector<std::vector<std::string>>& numbers) {
    const Sheet::Style name = scaled(nameStyle, sheet_.scale());
    const Sheet::Style number = scaled(numberStyle, sheet_.scale());
    space(10);
    std::vector<std::vector<std::string>> names;
    std::size_t nameLines = 1, numberLines = 0;
    for (std::size_t column = 0; column < methods_.size(); ++column) {
      names.push_back(brokenName(sheet_, methodName(methods_[column]), name));
      nameLines = std::max(nameLines, names.back().size());
      numberLines = std::max(numberLines, numbers[column].size());
    }
    writeLines(names, nameLines, name);
    writeLines(numbers, numberLines, number);
  }

  void writeLines(const std::vector<std::vector<std::string>>& texts, std::size_t lines,
                  const Sheet::Style& style) {
    for (std::size_t line = 0; line < lines; ++line) {
      for (std::size_t column = 0; column < texts.size(); ++column) {
        if (line < texts[column].size()) sheet_.centered(column, texts[column][line], style);
      }
      sheet_.advance(std::round(style.height * lineGap));
    }
  }

  Result<void> drawStrip(const ComparisonStrip& strip) {
    Result<ComparedFigures> figures =
        ComparedFigures::create(device_, *renderer_, *strip.scene, strip.pose, methods_);
    if (!figures) return figures.error();
    notes_.insert(notes_.end(), figures->notes().begin(), figures->notes().end());
    writeTitle(strip.title, strip.remark);
    if (Result<void> drawn = drawCells(strip, *figures, false); !drawn) return drawn;
    writeCaptions(numbersBelow(strip, *figures));
    return strip.hasHeatMap ? drawHeatStrip(strip, *figures) : Result<void>();
  }

  std::vector<std::vector<std::string>> numbersBelow(const ComparisonStrip& strip,
                                                     const ComparedFigures& figures) const {
    std::vector<std::vector<std::string>> numbers(methods_.size());
    for (std::size_t column = 0; column < methods_.size(); ++column) {
      if (strip.sections) {
        const double section = leastSection(*strip.scene->parts[0].primitive,
                                            figures.positions(column, 0), *strip.sections);
        numbers[column].push_back(fmt::format("{:.{}f} %", section * 100, section < 0.01 ? 1 : 0));
      }
      if (!strip.showsCost) continue;
      const std::vector<std::string>& cost = described_.columns[column].cost;
      numbers[column].insert(numbers[column].end(), cost.begin(), cost.end());
    }
    return numbers;
  }

  /// The distance that the last color stands for. If linear blending is shown, its largest distance
  /// is used, rounded up, so that pictures of different methods have the same scale.
  double hottest(const ComparedFigures& figures) const {
    double largest = 0, linear = 0;
    for (std::size_t column = 0; column < methods_.size(); ++column) {
      const double distance = figures.difference(column).largest;
      largest = std::max(largest, distance);
      if (methods_[column] == Method::linear) linear = distance;
    }
    const double share = (linear > 0 ? linear : largest) / figures.size();
    // The limit keeps rounding errors of float32, about a millionth, invisible.
    return roundedUp(std::max(share, 1e-4)) * figures.size();
  }

  Result<void> drawHeatStrip(const ComparisonStrip& strip, ComparedFigures& figures) {
    const double most = hottest(figures);
    if (Result<void> made = figures.makeHeatMaps(most); !made) return made;
    writeTitle(fmt::format("Difference from {}", methodName(Method::dualQuaternion)), "");
    writeScale(most, figures.size());
    if (Result<void> drawn = drawCells(strip, figures, true); !drawn) return drawn;
    std::vector<std::vector<std::string>> numbers;
    for (std::size_t column = 0; column < methods_.size(); ++column) {
      const FigureDifference& difference = figures.difference(column);
      numbers.push_back(
          {fmt::format("largest {:.2f} ‰", difference.largest / figures.size() * 1e3),
           fmt::format("rms {:.2f} ‰", difference.rootMeanSquare / figures.size() * 1e3)});
    }
    writeCaptions(numbers);
    return {};
  }

  void writeScale(double most, double size) {
    const float scale = sheet_.scale();
    const Sheet::Style style = scaled(remarkStyle, scale);
    std::vector<SheetColor> colors;
    for (int i = 0; i < 256; ++i) colors.push_back(render::heatColor(static_cast<float>(i) / 255));
    const float length = std::round(300 * scale), gap = std::round(12 * scale);
    sheet_.left("0", style);
    const float from = sheet_.width("0", style) + gap;
    sheet_.gradient(colors, from, length, style.height);
    sheet_.left(fmt::format("{:g} ‰ of the model's diagonal or more ({:.3g} model units)",
                            most / size * 1e3, most),
                style, from + length + gap);
    sheet_.advance(std::round(style.height * lineGap));
    space(6);
  }

  /// Draws the picture of each column, all with the same camera and light.
  Result<void> drawCells(const ComparisonStrip& strip, const ComparedFigures& figures,
                         bool asHeatMap) {
    render::FrameDescription description;
    description.width = sheet_.columnWidth();
    description.height = static_cast<std::uint32_t>(static_cast<float>(description.width) *
                                                    heightForWidth(figures.box(), strip.camera));
    description.shadows = {1024, 256, 16};
    Result<render::RenderFrame> frame = renderer_->createFrame(description);
    if (!frame) return frame.error();
    render::View view = viewOf(figures, strip.camera, description);
    view.style = asHeatMap ? styleOfHeatMaps() : styleOfPictures();
    for (std::size_t column = 0; column < methods_.size(); ++column) {
      std::vector<render::Draw> draws;
      if (Result<void> added =
              asHeatMap ? figures.addHeatMap(column, draws) : figures.addDraws(column, draws);
          !added)
        return added;
      view.draws = draws;
      if (Result<void> drawn = drawView(*frame, view); !drawn) return drawn;
      sheet_.paste(column, {description.width, description.height, frame->target().pixels()});
      step_();
    }
    sheet_.advance(static_cast<float>(description.height));
    return {};
  }

  static render::View viewOf(const ComparedFigures& figures, render::CameraOptions camera,
                             const render::FrameDescription& description) {
    const Box& box = figures.box();
    const float radius = render::radiusOf(box);
    render::View view;
    view.area.extent = {description.width, description.height};
    view.casters = box;
    // Slightly lower, because a flat sole would otherwise coincide with the ground.
    view.groundHeight = figures.floor() - 1e-3f * radius;
    view.groundRadius = 2.5f * radius;
    Box ground = box;
    for (const std::size_t axis : {0u, 2u}) {
      ground.min[axis] -= 4 * radius;
      ground.max[axis] += 4 * radius;
    }
    ground.min[1] = std::min(ground.min[1], *view.groundHeight);
    camera.margin = cameraMargin;
    view.camera = render::frameBoxes(
        {&box, 1}, ground, camera,
        static_cast<float>(description.width) / static_cast<float>(description.height));
    return view;
  }

  Result<void> drawView(render::RenderFrame& frame, const render::View& view) {
    return device_.device->run([&](VkCommandBuffer commandBuffer) {
      Result<void> done = renderer_->record(commandBuffer, frame, {&view, 1});
      if (done) frame.target().recordReadBack(*device_.device, commandBuffer);
      return done;
    });
  }

  samples::OpenDevice& device_;
  const ComparisonSheet& described_;
  std::vector<std::string>& notes_;
  const std::function<void()>& step_;
  Sheet sheet_;
  std::vector<Method> methods_;
  std::optional<render::Renderer> renderer_;
};

}  // namespace

std::size_t comparisonPictures(const ComparisonSheet& sheet) {
  std::size_t pictures = 0;
  for (const ComparisonStrip& strip : sheet.strips)
    pictures += sheet.columns.size() * (strip.hasHeatMap ? 2 : 1);
  return pictures;
}

Result<render::Picture> drawComparison(samples::OpenDevice& device, const ComparisonSheet& sheet,
                                       const render::Font* font, std::vector<std::string>& notes,
                                       const std::function<void()>& step) {
  return ComparisonDrawer(device, sheet, font, notes, step).draw();
}

Result<BuiltInScenes> loadBuiltInScenes(const MeshPreparation& preparation) {
  Result<Scene> bar = loadScene(embeddedBar, "bar.glb", preparation);
  if (!bar) return bar.error();
  Result<Scene> arm = loadScene(embeddedArm, "arm.glb", preparation);
  if (!arm) return arm.error();
  return BuiltInScenes{std::move(*bar), std::move(*arm)};
}

double middleOfClip(const Scene& scene) {
  return scene.model->clips[0].duration / 2;
}

std::vector<ComparisonStrip> builtInStrips(const BuiltInScenes& scenes) {
  std::vector<ComparisonStrip> strips(2);
  ComparisonStrip& bar = strips[0];
  bar.scene = &scenes.bar;
  bar.pose = scenePose(scenes.bar, 0, middleOfClip(scenes.bar));
  bar.title = "A bar twisted by 175°";
  bar.remark = "smallest cross-section area, relative to bind pose";
  bar.camera.azimuth = 18;
  bar.camera.elevation = 16;
  bar.sections = SectionRange{0.3, 0.7};
  ComparisonStrip& arm = strips[1];
  arm.scene = &scenes.arm;
  arm.pose = scenePose(scenes.arm, 0, middleOfClip(scenes.arm));
  arm.title = "An arm bent by 140°";
  arm.remark = "smallest cross-section area, relative to bind pose";
  arm.camera.azimuth = 18;
  arm.camera.elevation = 12;
  arm.sections = SectionRange{0.2, 0.45};
  return strips;
}

}  // namespace dermis::cli
