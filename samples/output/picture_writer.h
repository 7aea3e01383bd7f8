// Pictures on their way into files: one, numbered ones, or a film that ffmpeg makes of them.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "dermis/result.h"
#include "render/picture.h"

namespace dermis::samples {

enum class PictureKind { png, mp4, gif, apng };

/// What a file's ending means, or nothing.
std::optional<PictureKind> pictureKind(std::string_view fileName);

class PictureWriter {
 public:
  virtual ~PictureWriter() = default;
  /// Fails with `ioError`.
  virtual Result<void> write(const render::Picture& picture) = 0;
  /// After the last picture: the file is not whole before. Fails with `ioError`.
  virtual Result<void> finish() = 0;
};

/// PNG files: OUT, or OUT with the number of each in the place for it.
std::unique_ptr<PictureWriter> writePngs(const std::string& output);

/// Fails with `missingFeature` if there is no ffmpeg in the PATH, which films need, and on Windows.
Result<void> checkFilmProgram(const std::string& output);

/// A film of pictures of one size. It replaces what stands at OUT when it is finished, and not
/// before. Fails like `checkFilmProgram`, and with `ioError`.
Result<std::unique_ptr<PictureWriter>> writeFilm(const std::string& output, PictureKind kind,
                                                 std::uint32_t width, std::uint32_t height,
                                                 double framesPerSecond);

}  // namespace dermis::samples
