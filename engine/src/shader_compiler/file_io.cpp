#include "shader_compiler/file_io.h"

#include <cerrno>
#include <fstream>
#include <random>
#include <sstream>
#include <system_error>

namespace dermis {
namespace {

// Beside the target, as a rename is atomic only within a file system; random, as other processes
// may write the same entry at the same time.
std::filesystem::path temporaryPathFor(const std::filesystem::path& path) {
  std::random_device random;
  std::ostringstream suffix;
  suffix << '.' << std::hex << random() << random() << ".tmp";
  std::filesystem::path temporary = path;
  temporary += suffix.str();
  return temporary;
}

Error cannotWrite(const std::filesystem::path& path, const std::string& reason) {
  return Error{ErrorCode::ioError, "cannot write '" + path.string() + "': " + reason};
}

}  // namespace

std::optional<std::string> readFile(const std::filesystem::path& path) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure)) return std::nullopt;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return std::nullopt;
  std::ostringstream contents;
  contents << stream.rdbuf();
  // An empty file puts nothing into `contents`, which sets its fail bit: only the source tells.
  if (stream.bad()) return std::nullopt;
  return std::move(contents).str();
}

Result<void> writeFileAtomically(const std::filesystem::path& path, std::string_view bytes) {
  const std::filesystem::path temporary = temporaryPathFor(path);
  errno = 0;
  std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  std::error_code failure;
  if (!stream) {
    const std::error_code reason(errno != 0 ? errno : EIO, std::generic_category());
    std::filesystem::remove(temporary, failure);
    return cannotWrite(path, reason.message());
  }
  std::filesystem::rename(temporary, path, failure);
  if (failure) {
    const std::string reason = failure.message();
    std::filesystem::remove(temporary, failure);
    return cannotWrite(path, reason);
  }
  return {};
}

}  // namespace dermis
