#include "statistics_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string_view>

using namespace dermis;
using samples::render::Font;
using samples::render::Picture;

namespace crowd {
namespace {

using Color = std::array<std::uint8_t, 3>;

constexpr Color ground{15, 18, 23}, white{244, 246, 248}, gray{158, 168, 180};
constexpr Color skinnedColor{255, 176, 59}, notDueColor{88, 166, 214}, outOfViewColor{82, 91, 104};

/// A rectangle of whole pixels.
struct Area {
  int left = 0, top = 0, right = 0, bottom = 0;
};

void fill(Picture& picture, const Area& area, const Color& color, double opacity) {
  const auto limit = [](int value, std::uint32_t most) {
    return static_cast<std::uint32_t>(std::clamp(value, 0, static_cast<int>(most)));
  };
  for (std::uint32_t y = limit(area.top, picture.height); y < limit(area.bottom, picture.height);
       ++y) {
    for (std::uint32_t x = limit(area.left, picture.width); x < limit(area.right, picture.width);
         ++x) {
      std::uint8_t* pixel = &picture.pixels[(std::size_t{y} * picture.width + x) * 4];
      for (std::size_t i = 0; i < 3; ++i) {
        pixel[i] =
            static_cast<std::uint8_t>(std::lround(pixel[i] * (1 - opacity) + color[i] * opacity));
      }
    }
  }
}

/// 1234567: "1,234,567".
std::string grouped(std::uint64_t number) {
  std::string text = std::to_string(number);
  for (std::size_t end = text.size(); end > 3; end -= 3) text.insert(end - 3, 1, ',');
  return text;
}

std::string orDash(const std::optional<std::uint64_t>& number) {
  return number ? grouped(*number) : "–";
}

/// A duration with three digits.
std::string duration(const std::optional<double>& seconds) {
  if (!seconds) return "–";
  const double milliseconds = *seconds * 1e3;
  return fmt::format("{:.{}f} ms", milliseconds,
                     milliseconds < 10    ? 2
                     : milliseconds < 100 ? 1
                                          : 0);
}

struct Row {
  std::string name, value;
  std::optional<Color> key;  ///< of the bar
};

std::vector<Row> rowsOf(const PanelNumbers& numbers) {
  std::vector<Row> rows{{"skinned", orDash(numbers.skinned), skinnedColor},
                        {"not due yet", orDash(numbers.notDue), notDueColor},
                        {"out of view", grouped(numbers.outOfView), outOfViewColor}};
  rows.push_back({"vertices skinned", orDash(numbers.vertices), {}});
  rows.push_back({"dispatches", grouped(numbers.dispatches), {}});
  rows.push_back({"CPU, plan and record", duration(numbers.cpuSeconds), {}});
  rows.push_back({"GPU, skinning", duration(numbers.gpuSeconds), {}});
  return rows;
}

/// A bar of the instances: skinned, not due, out of view.
void drawBar(Picture& picture, const Area& area, const PanelNumbers& numbers) {
  const auto total = static_cast<double>(std::max<std::uint64_t>(numbers.instances, 1));
  fill(picture, area, outOfViewColor, 1);
  double sum = 0;
  const auto part = [&](std::uint64_t count, const Color& color) {
    const auto at = [&](double share) {
      return area.left + static_cast<int>(std::lround(share / total * (area.right - area.left)));
    };
    fill(picture, {at(sum), area.top, at(sum + static_cast<double>(count)), area.bottom}, color, 1);
    sum += static_cast<double>(count);
  };
  part(numbers.skinned.value_or(0), skinnedColor);
  part(numbers.notDue.value_or(0), notDueColor);
}

/// A column of text, and the position of its next line.
class Column {
 public:
  Column(Picture& picture, const Font& font, int left, int right, double top)
      : picture_(picture), font_(font), left_(left), right_(right), top_(top) {}

  void skip(double height) { top_ += height; }
  double top() const { return top_; }

  void line(std::string_view text, double height, const Color& color, double indent = 0) {
    font_.draw(picture_, text, label(left_ + indent, height, color));
    top_ += height;
  }
  /// Writes at both ends of the same line.
  void pair(const std::string& name, const std::string& value, double height, double indent) {
    const double width = font_.width(value, static_cast<float>(height));
    font_.draw(picture_, value, label(right_ - width, height, white));
    line(name, height, gray, indent);
  }

 private:
  Font::Label label(double x, double height, const Color& color) const {
    Font::Label label;
    label.x = static_cast<float>(std::round(x));
    label.y = static_cast<float>(std::round(top_ + 0.8 * height));
    label.height = static_cast<float>(height);
    std::copy(color.begin(), color.end(), label.color);
    return label;
  }

  Picture& picture_;
  const Font& font_;
  int left_, right_;
  double top_;
};

}  // namespace

void StatisticsPanel::draw(Picture& picture, const PanelNumbers& numbers) const {
  const double size = std::clamp(picture.height / 40.0, 8.0, 48.0);
  const int margin = static_cast<int>(std::lround(1.1 * size));
  const int padding = static_cast<int>(std::lround(0.9 * size));
  const int width = static_cast<int>(std::lround(16.5 * size));
  const std::vector<Row> rows = rowsOf(numbers);
  const double rowHeight = 1.28 * size;
  const double height = 2 * padding + 1.45 * size + 1.2 * size + 1.35 * size +
                        rowHeight * static_cast<double>(rows.size()) + 0.6 * size + 0.95 * size;
  const Area panel{margin, margin, margin + width, margin + static_cast<int>(std::lround(height))};
  fill(picture, panel, ground, 0.72);

  const int left = panel.left + padding, right = panel.right - padding;
  Column column(picture, font_, left, right, panel.top + padding);
  column.line(grouped(numbers.figures) + (numbers.figures == 1 ? " figure" : " figures"),
              1.4 * size, white);
  column.line(fmt::format("{} instances, {} vertices", grouped(numbers.instances),
                          grouped(numbers.figures * numbers.verticesOfFigure)),
              0.8 * size, gray);
  column.skip(0.55 * size);
  const int barTop = static_cast<int>(std::lround(column.top()));
  drawBar(picture, {left, barTop, right, barTop + static_cast<int>(std::lround(0.5 * size))},
          numbers);
  column.skip(1.0 * size);
  for (const Row& row : rows) {
    if (row.key) {
      const int top = static_cast<int>(std::lround(column.top() + 0.22 * size));
      const int side = static_cast<int>(std::lround(0.55 * size));
      fill(picture, {left, top, left + side, top + side}, *row.key, 1);
    }
    column.pair(row.name, row.value, size, row.key ? 0.95 * size : 0);
    column.skip(rowHeight - size);
  }
  column.skip(0.35 * size);
  column.line(numbers.device, 0.75 * size, gray);
}

}  // namespace crowd
