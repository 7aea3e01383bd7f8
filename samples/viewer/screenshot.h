// Pictures of the window as files.
#pragma once

#include <string>

#include "dermis/result.h"
#include "render/picture.h"

namespace dermis::viewer {

/// "dermis-viewer-1.png" in the folder that the program was started in, or the first number that
/// is free.
std::string nextScreenshotName();

/// A PNG. It is there as a whole or not at all. Fails with `ioError`.
Result<void> writeScreenshot(const samples::render::Picture& picture, const std::string& name);

}  // namespace dermis::viewer
