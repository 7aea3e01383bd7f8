#include <fmt/format.h>

#include "picture_writer.h"

namespace dermis::samples {

Result<void> checkFilmProgram(const std::string& output) {
  return Error{ErrorCode::missingFeature,
               fmt::format("{}: films are not written on Windows; numbered pictures are: name them "
                           "like frame%04d.png",
                           output)};
}

Result<std::unique_ptr<PictureWriter>> writeFilm(const std::string& output, PictureKind,
                                                 std::uint32_t, std::uint32_t, double) {
  return checkFilmProgram(output).error();
}

}  // namespace dermis::samples
