// A finished picture on the CPU: labels on it, and its file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/result.h"

namespace dermis::samples::render {

struct Picture {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> pixels;  ///< red, green, blue, alpha, in sRGB; from the top
};

/// The bytes of a PNG file, without alpha. Fails with `limitExceeded`.
Result<std::vector<std::byte>> encodePng(const Picture& picture);

/// The file of the typeface that labels are set in: DejaVu Sans (Debian's fonts-dejavu-core), or
/// what DERMIS_FONT in the environment names. Fails with `ioError` if there is none.
Result<std::string> findFontFile();

/// A typeface, for labels.
class Font {
 public:
  /// Of `findFontFile`. Fails with `ioError` if there is none: a picture then has no labels.
  static Result<Font> load();

  /// Pixels that a line of text takes.
  float width(std::string_view text, float height) const;

  struct Label {
    float x = 0, y = 0;  ///< pixels: the left end of the base line
    float height = 20;   ///< pixels from the lowest to the highest of all letters
    std::uint8_t color[3] = {255, 255, 255};
  };
  /// Writes a line of UTF-8 onto a picture; what lies outside is cut off.
  void draw(Picture& picture, std::string_view text, const Label& label) const;

 private:
  std::vector<unsigned char> file_;
};

}  // namespace dermis::samples::render
