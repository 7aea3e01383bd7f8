// Writes pictures to files: one picture, numbered pictures, or a film that ffmpeg encodes.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "dermis/result.h"
#include "kit/render/picture.h"

namespace dermis::samples {

enum class PictureKind { png, mp4, gif, apng };

/// The kind that the ending of a file means; empty if it is unknown.
std::optional<PictureKind> pictureKind(std::string_view fileName);

class PictureWriter {
 public:
  virtual ~PictureWriter() = default;
  /// Fails with `ioError`.
  virtual Result<void> write(const render::Picture& picture) = 0;
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

}  // namespace dermis::samples
