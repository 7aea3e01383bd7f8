// A sheet that grows downwards: columns of pictures, with text above and below them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kit/render/picture.h"

namespace dermis::cli {

using SheetColor = std::array<std::uint8_t, 3>;  ///< sRGB

inline constexpr SheetColor sheetPaper{243, 244, 246};
inline constexpr SheetColor sheetPanel{203, 209, 216};  ///< behind pictures
inline constexpr SheetColor sheetInk{30, 35, 43};
inline constexpr SheetColor sheetPaleInk{94, 103, 115};
inline constexpr SheetColor sheetLine{208, 212, 218};

class Sheet {
 public:
  struct Style {
    float height = 20;  ///< pixels, as `samples::render::Font` counts them
    SheetColor color = sheetInk;
  };

  /// Without a font there is no text, but its space is kept. The font must outlive the sheet.
  Sheet(std::uint32_t width, std::size_t columns, const samples::render::Font* font);

  std::uint32_t columnWidth() const { return columnWidth_; }
  /// Factor for lengths if columns are narrower or wider than usual.
  float scale() const { return scale_; }

  /// Moves down by this number of pixels.
  void advance(float pixels);
  /// Draws a thin horizontal line.
  void rule();
  /// Writes at the left of a line; the text is cut off if there is no space.
  void left(std::string_view text, const Style& style, float from = 0, float room = 0);
  /// The width of a text; 0 without a font.
  float width(std::string_view text, const Style& style) const;
  /// Writes in the middle of a column, smaller if there is too little space.
  void centered(std::size_t column, std::string_view text, Style style);
  /// Pastes a picture, not wider than the column, in the middle of it.
  void paste(std::size_t column, const samples::render::Picture& picture);
  /// Draws a color gradient from left to right, in a line of text; `from` as in `left`.
  void gradient(const std::vector<SheetColor>& colors, float from, float length, float height);
  /// The width inside the margins.
  float innerWidth() const { return static_cast<float>(innerWidth_); }

  samples::render::Picture take();

 private:
  std::uint32_t columnLeft(std::size_t column) const;
  void need(std::uint32_t bottom);
  std::string fitted(std::string_view text, const Style& style, float room) const;

  const samples::render::Font* font_;
  samples::render::Picture picture_;
  std::uint32_t margin_, gutter_, columnWidth_, innerWidth_;
  float scale_, y_ = 0;
};

/// Splits a name into as few lines as possible, after underscores.
std::vector<std::string> brokenName(const Sheet& sheet, std::string_view name,
                                    const Sheet::Style& style);

}  // namespace dermis::cli
