// Screenshots of the window.
#pragma once

#include <string>

#include "dermis/result.h"
#include "kit/render/picture.h"

namespace dermis::viewer {

/// "dermis-viewer-1.png" in the current folder, or the first unused number.
std::string nextScreenshotName();

/// Writes a PNG file completely or not at all. Fails with `ioError`.
Result<void> writeScreenshot(const samples::render::Picture& picture, const std::string& name);

}  // namespace dermis::viewer
