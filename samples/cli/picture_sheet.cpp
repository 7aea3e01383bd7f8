#include "picture_sheet.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace dermis::cli {
namespace {

using samples::render::Font;
using samples::render::Picture;

/// Lengths are given for columns of this width, on a sheet of at least this width.
constexpr float usualColumnWidth = 280, usualWidth = 1000;

/// Bytes that follow the first of a UTF-8 character.
bool isContinuation(char byte) {
  return (static_cast<unsigned char>(byte) & 0xc0) == 0x80;
}

}  // namespace

Sheet::Sheet(std::uint32_t width, std::size_t columns, const Font* font) : font_(font) {
  const auto count = static_cast<std::uint32_t>(columns);
  margin_ = width / 50;
  gutter_ = width / 150;
  columnWidth_ = (width - 2 * margin_ - (count - 1) * gutter_) / count;
  innerWidth_ = count * (columnWidth_ + gutter_) - gutter_;
  margin_ = (width - innerWidth_) / 2;
  scale_ = std::clamp(std::min(static_cast<float>(columnWidth_) / usualColumnWidth,
                               static_cast<float>(width) / usualWidth),
                      0.5f, 1.6f);
  picture_.width = width;
}

std::uint32_t Sheet::columnLeft(std::size_t column) const {
  return margin_ + static_cast<std::uint32_t>(column) * (columnWidth_ + gutter_);
}

void Sheet::need(std::uint32_t bottom) {
  if (bottom <= picture_.height) return;
  const std::size_t before = picture_.pixels.size();
  picture_.height = bottom;
  picture_.pixels.resize(std::size_t{bottom} * picture_.width * 4);
  for (std::size_t i = before; i < picture_.pixels.size(); i += 4) {
    std::ranges::copy(sheetPaper, &picture_.pixels[i]);
    picture_.pixels[i + 3] = 255;
  }
}

void Sheet::advance(float pixels) {
  y_ += pixels;
  need(static_cast<std::uint32_t>(std::ceil(y_)));
}

void Sheet::rule() {
  const auto row = static_cast<std::uint32_t>(y_);
  need(row + 1);
  for (std::uint32_t x = margin_; x < margin_ + innerWidth_; ++x)
    std::ranges::copy(sheetLine, &picture_.pixels[(std::size_t{row} * picture_.width + x) * 4]);
}

float Sheet::width(std::string_view text, const Style& style) const {
  return font_ == nullptr ? 0 : font_->width(text, style.height);
}

std::string Sheet::fitted(std::string_view text, const Style& style, float room) const {
  if (width(text, style) <= room) return std::string(text);
  std::string shorter(text);
  while (!shorter.empty() && width(shorter + "…", style) > room) {
    while (!shorter.empty() && isContinuation(shorter.back())) shorter.pop_back();
    if (!shorter.empty()) shorter.pop_back();
  }
  return shorter + "…";
}

void Sheet::left(std::string_view text, const Style& style, float from, float room) {
  if (font_ == nullptr) return;
  need(static_cast<std::uint32_t>(y_ + style.height) + 1);
  Font::Label label;
  label.x = static_cast<float>(margin_) + from;
  label.y = y_ + style.height * 0.8f;
  label.height = style.height;
  std::ranges::copy(style.color, label.color);
  font_->draw(picture_, fitted(text, style, room > 0 ? room : innerWidth() - from), label);
}

void Sheet::centered(std::size_t column, std::string_view text, Style style) {
  const auto room = static_cast<float>(columnWidth_);
  if (const float wide = width(text, style); wide > room) style.height *= room / wide;
  const float from = static_cast<float>(columnLeft(column) - margin_) +
                     std::max(room - width(text, style), 0.f) / 2;
  left(text, style, std::floor(from), room + 1);
}

void Sheet::paste(std::size_t column, const Picture& picture) {
  const auto top = static_cast<std::uint32_t>(y_);
  need(top + picture.height);
  const std::uint32_t from = columnLeft(column) + (columnWidth_ - picture.width) / 2;
  for (std::uint32_t row = 0; row < picture.height; ++row) {
    std::copy_n(&picture.pixels[std::size_t{row} * picture.width * 4],
                std::size_t{picture.width} * 4,
                &picture_.pixels[(std::size_t{top + row} * picture_.width + from) * 4]);
  }
}

void Sheet::gradient(const std::vector<SheetColor>& colors, float from, float length,
                     float height) {
  const auto top = static_cast<std::uint32_t>(y_);
  need(top + static_cast<std::uint32_t>(height));
  const auto first = margin_ + static_cast<std::uint32_t>(from);
  const auto last = std::min(first + static_cast<std::uint32_t>(length), picture_.width);
  for (std::uint32_t row = top; row < top + static_cast<std::uint32_t>(height); ++row) {
    for (std::uint32_t x = first; x < last; ++x) {
      const std::size_t index = std::size_t{x - first} * colors.size() / (last - first);
      std::ranges::copy(colors[index],
                        &picture_.pixels[(std::size_t{row} * picture_.width + x) * 4]);
    }
  }
}

Picture Sheet::take() {
  need(static_cast<std::uint32_t>(std::ceil(y_)));
  return std::exchange(picture_, {});
}

std::vector<std::string> brokenName(const Sheet& sheet, std::string_view name,
                                    const Sheet::Style& style) {
  const auto room = static_cast<float>(sheet.columnWidth());
  std::vector<std::string> lines{""};
  while (!name.empty()) {
    const std::size_t end = name.find('_');
    const std::string_view word = name.substr(0, end == std::string_view::npos ? end : end + 1);
    const std::string longer = lines.back() + std::string(word);
    if (!lines.back().empty() && sheet.width(longer, style) > room) {
      lines.emplace_back(word);
    } else {
      lines.back() = longer;
    }
    name.remove_prefix(word.size());
  }
  return lines;
}

}  // namespace dermis::cli
