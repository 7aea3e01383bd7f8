#include "kit/render/picture_writer.h"

#include <utility>
#include <vector>

#include "kit/file_name.h"
#include "kit/output_file.h"

namespace dermis::samples {
namespace {

using render::Picture;

class PngWriter final : public PictureWriter {
 public:
  explicit PngWriter(std::string output) : output_(std::move(output)) {}

  Result<void> write(const Picture& picture) override {
    const Result<std::vector<std::byte>> bytes = render::encodePng(picture);
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

}  // namespace dermis::samples
