// A finished picture on the CPU: adding labels, and writing files.
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
  std::vector<std::uint8_t> pixels;  ///< red, green, blue, alpha, in sRGB; top row first
};

/// The bytes of a PNG file, without alpha. Fails with `limitExceeded`.
Result<std::vector<std::byte>> encodePng(const Picture& picture);

/// The font file for labels: the file that DERMIS_FONT in the environment names, or DejaVu Sans
/// (Debian's fonts-dejavu-core). Fails with `ioError` if there is none.
Result<std::string> findFontFile();

/// A font for labels.
class Font {
 public:
  /// Loads the file of `findFontFile`. Fails with `ioError` if there is none: then pictures have no
  /// labels.
  static Result<Font> load();

  /// The width of a line of text, in pixels.
  float width(std::string_view text, float height) const;

  struct Label {
    float x = 0, y = 0;  ///< pixels: the left end of the base line
    float height = 20;   ///< pixels from the lowest to the highest point of all letters
    std::uint8_t color[3] = {255, 255, 255};
  };
  /// Draws a line of UTF-8 text onto a picture. Parts outside the picture are cut off.
  void draw(Picture& picture, std::string_view text, const Label& label) const;

 private:
  std::vector<unsigned char> file_;
};

}  // namespace dermis::samples::render
