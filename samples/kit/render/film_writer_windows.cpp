#include <fmt/format.h>

#include "kit/render/picture.h"

namespace dermis::samples::render {

Result<void> checkFilmProgram(const std::string& output) {
  return Error{ErrorCode::missingFeature,
               fmt::format("{}: films cannot be written on Windows; write numbered pictures "
                           "instead, with a name like "
                           "frame%04d.png",
                           output)};
}

Result<std::unique_ptr<PictureWriter>> writeFilm(const std::string& output, PictureKind,
                                                 std::uint32_t, std::uint32_t, double) {
  return checkFilmProgram(output).error();
}

}  // namespace dermis::samples::render
