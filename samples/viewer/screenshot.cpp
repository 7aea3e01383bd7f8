#include "screenshot.h"

#include <filesystem>
#include <fstream>
#include <system_error>

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
  const std::string part = name + ".part";
  std::ofstream file(part, std::ios::binary);
  for (const std::byte byte : *bytes) file.put(static_cast<char>(byte));
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(part, name, error);
  if (file && !error) return {};
  std::error_code ignored;
  std::filesystem::remove(part, ignored);
  return Error{ErrorCode::ioError, "'" + name + "' cannot be written"};
}

}  // namespace dermis::viewer
