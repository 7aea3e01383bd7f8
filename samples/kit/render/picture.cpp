#include "kit/render/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "kit/file_name.h"
#include "kit/output_file.h"
#include "kit/render/stb_headers.h"

namespace dermis::samples::render {
namespace {

constexpr std::array<const char*, 3> fontFiles{
    "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
    "/usr/share/fonts/TTF/DejaVuSans.ttf",
    "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
};

/// Empty if the file cannot be read.
std::vector<unsigned char> readBytes(const std::string& name) {
  std::ifstream stream(name, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

bool isFont(const std::vector<unsigned char>& file) {
  stbtt_fontinfo info;
  const int offset = file.size() < 1024 ? -1 : stbtt_GetFontOffsetForIndex(file.data(), 0);
  return offset >= 0 && stbtt_InitFont(&info, file.data(), offset) != 0;
}

/// The code points of a UTF-8 text. A byte that does not start a code point becomes U+FFFD.
std::vector<int> codePoints(std::string_view text) {
  std::vector<int> points;
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = static_cast<unsigned char>(text[i++]);
    const int following = byte < 0x80   ? 0
                          : byte < 0xc0 ? -1
                          : byte < 0xe0 ? 1
                          : byte < 0xf0 ? 2
                                        : 3;
    int point = following < 0 ? 0xfffd : following == 0 ? byte : byte & (0x3f >> following);
    for (int k = 0; k < following && i < text.size(); ++k)
      point = point << 6 | (static_cast<unsigned char>(text[i++]) & 0x3f);
    points.push_back(point);
  }
  return points;
}

/// Blends a color into a pixel. `share` is from 0 to 255.
void mix(std::uint8_t* pixel, const std::uint8_t* color, unsigned share) {
  for (int i = 0; i < 3; ++i)
    pixel[i] = static_cast<std::uint8_t>((pixel[i] * (255 - share) + color[i] * share + 127) / 255);
}

stbtt_fontinfo infoOf(const std::vector<unsigned char>& file) {
  stbtt_fontinfo info;
  stbtt_InitFont(&info, file.data(), stbtt_GetFontOffsetForIndex(file.data(), 0));
  return info;
}

}  // namespace

Result<std::vector<std::byte>> encodePng(const Picture& picture) {
  constexpr int channels = 3;
  // stb uses `int` sizes, and stores one extra byte per row.
  const std::uint64_t rowBytes = std::uint64_t{picture.width} * channels + 1;
  if (rowBytes > std::numeric_limits<int>::max() / std::max(picture.height, 1u))
    return Error{ErrorCode::limitExceeded, "the picture is too large for a PNG"};
  std::vector<std::uint8_t> opaque;
  opaque.reserve(picture.pixels.size() / 4 * channels);
  for (std::size_t i = 0; i + 3 < picture.pixels.size(); i += 4)
    opaque.insert(opaque.end(), &picture.pixels[i], &picture.pixels[i] + channels);
  std::vector<std::byte> bytes;
  const auto append = [](void* context, void* data, int size) {
    const std::span more(static_cast<const std::byte*>(data), static_cast<std::size_t>(size));
    static_cast<std::vector<std::byte>*>(context)->assign(more.begin(), more.end());
  };
  if (stbi_write_png_to_func(append, &bytes, static_cast<int>(picture.width),
                             static_cast<int>(picture.height), channels, opaque.data(), 0) == 0)
    return Error{ErrorCode::limitExceeded,
                 "there is not enough memory to write the picture as PNG"};
  return bytes;
}

Result<std::string> findFontFile() {
  std::vector<const char*> names(fontFiles.begin(), fontFiles.end());
  if (const char* own = std::getenv("DERMIS_FONT"); own != nullptr)
    names.insert(names.begin(), own);
  for (const char* name : names) {
    if (isFont(readBytes(name))) return std::string(name);
  }
  return Error{ErrorCode::ioError,
               "there is no DejaVuSans.ttf on this machine (Debian: fonts-dejavu-core)"};
}

Result<Font> Font::load() {
  const Result<std::string> name = findFontFile();
  if (!name) return name.error();
  Font font;
  font.file_ = readBytes(*name);
  return font;
}

float Font::width(std::string_view text, float height) const {
  const stbtt_fontinfo info = infoOf(file_);
  int sum = 0;
  for (const int point : codePoints(text)) {
    int advance = 0, bearing = 0;
    stbtt_GetCodepointHMetrics(&info, point, &advance, &bearing);
    sum += advance;
  }
  return static_cast<float>(sum) * stbtt_ScaleForPixelHeight(&info, height);
}

void Font::draw(Picture& picture, std::string_view text, const Label& label) const {
  const stbtt_fontinfo info = infoOf(file_);
  const float scale = stbtt_ScaleForPixelHeight(&info, label.height);
  float x = label.x;
  for (const int point : codePoints(text)) {
    int advance = 0, bearing = 0, width = 0, height = 0, left = 0, top = 0;
    stbtt_GetCodepointHMetrics(&info, point, &advance, &bearing);
    unsigned char* shape = stbtt_GetCodepointBitmapSubpixel(&info, scale, scale, x - std::floor(x),
                                                            0, point, &width, &height, &left, &top);
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) {
        const int px = static_cast<int>(std::floor(x)) + left + column;
        const int py = static_cast<int>(std::lround(label.y)) + top + row;
        if (px < 0 || py < 0 || px >= static_cast<int>(picture.width) ||
            py >= static_cast<int>(picture.height))
          continue;
        const std::size_t place =
            static_cast<std::size_t>(py) * picture.width + static_cast<std::size_t>(px);
        mix(&picture.pixels[place * 4], label.color, shape[row * width + column]);
      }
    }
    stbtt_FreeBitmap(shape, nullptr);
    x += static_cast<float>(advance) * scale;
  }
}

namespace {

class PngWriter final : public PictureWriter {
 public:
  explicit PngWriter(std::string output) : output_(std::move(output)) {}

  Result<void> write(const Picture& picture) override {
    const Result<std::vector<std::byte>> bytes = encodePng(picture);
    if (!bytes) return bytes.error();
    return writeFile(pathOf(frameName(output_, frame_++).value_or(output_)), *bytes);
  }

  Result<void> finish() override { return {}; }

 private:
  std::string output_;
  std::uint32_t frame_ = 0;
};

}  // namespace

std::optional<PictureKind> pictureKind(std::string_view fileName) {
  for (const auto& [ending, kind] : {std::pair{".png", PictureKind::png},
                                     {".mp4", PictureKind::mp4},
                                     {".gif", PictureKind::gif},
                                     {".apng", PictureKind::apng}}) {
    if (hasEnding(fileName, ending)) return kind;
  }
  return std::nullopt;
}

std::unique_ptr<PictureWriter> writePngs(const std::string& output) {
  return std::make_unique<PngWriter>(output);
}

}  // namespace dermis::samples::render
