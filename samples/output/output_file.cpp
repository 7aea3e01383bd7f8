#include "output_file.h"

#include <fmt/format.h>

#include <fstream>
#include <system_error>

namespace dermis::samples {

Result<void> writeFile(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  const Error failure{ErrorCode::ioError, fmt::format("{} cannot be written", path.string())};
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  if (!file) return failure;
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (file) return {};
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) std::filesystem::remove(path, error);
  return failure;
}

}  // namespace dermis::samples
