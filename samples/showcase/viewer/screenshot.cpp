#include "screenshot.h"

#include <filesystem>
#include <system_error>

#include "kit/output_file.h"

namespace dermis::viewer {

std::string nextScreenshotName() {
  for (int number = 1;; ++number) {
    std::string name = "dermis-viewer-" + std::to_string(number) + ".png";
    std::error_code error;
    if (!std::filesystem::exists(name, error)) return name;
  }
}

Result<void> writeScreenshot(const samples::render::Picture& picture, const std::string& name) {
  const Result<std::vector<std::byte>> bytes = samples::render::encodePng(picture);
  if (!bytes) return bytes.error();
  return samples::writeFile(name, *bytes);
}

}  // namespace dermis::viewer
