// A finished picture on the CPU: adding labels, and writing files: one picture, numbered pictures,
// or a film that ffmpeg encodes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
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

enum class PictureKind { png, mp4, gif, apng };

/// The kind that the ending of a file means; empty if it is unknown.
std::optional<PictureKind> pictureKind(std::string_view fileName);

class PictureWriter {
 public:
  virtual ~PictureWriter() = default;
  /// Fails with `ioError`.
  virtual Result<void> write(const Picture& picture) = 0;
  /// Call it after the last picture; the file is incomplete before. Fails with `ioError`.
  virtual Result<void> finish() = 0;
};

/// PNG files: OUT, or OUT with its placeholder replaced by the number of each picture.
std::unique_ptr<PictureWriter> writePngs(const std::string& output);

/// Fails with `missingFeature` if ffmpeg, which films need, is not in the PATH, and on Windows.
Result<void> checkFilmProgram(const std::string& output);

/// A film of pictures of one size. It replaces OUT only when it is finished. Fails as
/// `checkFilmProgram` does, and with `ioError`.
Result<std::unique_ptr<PictureWriter>> writeFilm(const std::string& output, PictureKind kind,
                                                 std::uint32_t width, std::uint32_t height,
                                                 double framesPerSecond);

}  // namespace dermis::samples::render
