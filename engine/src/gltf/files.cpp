#include "gltf/files.h"

#ifdef _WIN32
#include <windows.h>
#endif

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <system_error>
#include <utility>

#include "gltf/container.h"
#include "gltf/failure.h"

namespace dermis::gltf {
namespace {

constexpr std::uint8_t notHexadecimal = 0xff;

std::uint8_t hexadecimalDigit(char character) {
  if (character >= '0' && character <= '9') return static_cast<std::uint8_t>(character - '0');
  if (character >= 'a' && character <= 'f') return static_cast<std::uint8_t>(character - 'a' + 10);
  if (character >= 'A' && character <= 'F') return static_cast<std::uint8_t>(character - 'A' + 10);
  return notHexadecimal;
}

// RFC 3986: a scheme is a letter followed by letters, digits, '+', '-' or '.', up to a colon.
bool hasScheme(std::string_view uri) {
  const std::size_t colon = uri.find(':');
  return colon != std::string_view::npos && uri.find('/') > colon;
}

// The path of a side file relative to the folder, without "..". Throws `Failure` if it leaves the
// folder.
std::filesystem::path relativePath(std::string_view uri, const std::string& where) {
  const auto refuse = [&](std::string_view name, const char* reason) {
    fail(ErrorCode::ioError, join(where, ": ", inQuotes(name), " ", reason));
  };
  constexpr const char* notRelative = "is not a relative file name";
  if (hasScheme(uri)) refuse(uri, notRelative);
  const std::string text = decodePercent(uri, where);
  if (text.empty()) refuse(text, "is not a file name");
  if (text.find('\0') != std::string::npos) refuse(text, "contains a zero byte");
  // Windows would take it for a separator.
  if (text.find('\\') != std::string::npos)
    refuse(text, "contains a backslash; in a URI, a slash separates folders");
  // On Windows, a colon names a drive or another stream of a file.
  constexpr bool isWindows = std::filesystem::path::preferred_separator != '/';
  const std::filesystem::path path(std::u8string(text.begin(), text.end()));
  if (hasScheme(text) || path.has_root_path() || (isWindows && text.find(':') != std::string::npos))
    refuse(text, notRelative);
  const std::filesystem::path relative = path.lexically_normal();
  if (*relative.begin() == "..") refuse(text, "is outside the file's folder and is not opened");
  return relative;
}

bool isInside(const std::filesystem::path& file, const std::filesystem::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), file.begin(), file.end()).first ==
         folder.end();
}

/// Resolves all links.
std::filesystem::path realPath(const std::filesystem::path& path, std::error_code& error) {
#ifdef _WIN32
  // Not std::filesystem::canonical: GCC's does not resolve links on Windows.
  const HANDLE file =
      CreateFileW(path.c_str(), 0, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr,
                  OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, nullptr);
  std::wstring name(32768, L'\0');  // the maximum length on Windows
  DWORD length = 0;
  if (file != INVALID_HANDLE_VALUE) {
    length = GetFinalPathNameByHandleW(file, name.data(), static_cast<DWORD>(name.size()),
                                       FILE_NAME_NORMALIZED);
  }
  error = {};
  if (length == 0 || length >= name.size())
    error = {static_cast<int>(GetLastError()), std::system_category()};
  if (file != INVALID_HANDLE_VALUE) CloseHandle(file);
  name.resize(error ? 0 : length);
  return name;
#else
  return std::filesystem::canonical(path, error);
#endif
}

std::ifstream open(const FileToRead& file, const std::string& where) {
  errno = 0;
  std::ifstream stream(file.path, std::ios::binary);
  if (stream) return stream;
  const std::string reason =
      errno == 0 ? std::string() : ": " + std::generic_category().message(errno);
  fail(ErrorCode::ioError, join(where, ": ", file.name, " cannot be opened", reason));
}

// Reads at most `count` bytes, fewer if the file ends.
std::vector<std::byte> readBytes(std::ifstream& stream, std::uint64_t count,
                                 const std::string& name, const std::string& where) {
  std::vector<std::byte> bytes(static_cast<std::size_t>(count));
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(count));
  if (stream.bad()) fail(ErrorCode::ioError, join(where, ": reading ", name, " failed"));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  return bytes;
}

void checkSize(std::uint64_t size, const std::string& where) {
  if (size <= largestFile) return;
  fail(ErrorCode::limitExceeded,
       join(where, ": the file has ", size, " bytes; the maximum is ", largestFile));
}

}  // namespace

std::string utf8(const std::filesystem::path& path) {
  const std::u8string text = path.u8string();
  return std::string(text.begin(), text.end());
}

FileToRead findFile(const std::filesystem::path& path, const std::string& name,
                    const std::string& where) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  const auto refuse = [&](const auto&... what) { fail(ErrorCode::ioError, join(where, what...)); };
  if (status.type() == std::filesystem::file_type::not_found) refuse("there is no file ", name);
  if (error) refuse(name, " cannot be opened: ", error.message());
  if (status.type() == std::filesystem::file_type::directory) refuse(name, " is a folder");
  if (status.type() != std::filesystem::file_type::regular)
    refuse(name, " is a pipe, a socket or a device, not a file");
  const std::uint64_t size = std::filesystem::file_size(path, error);
  if (error) refuse(name, " cannot be opened: ", error.message());
  return {path, size, name};
}

std::vector<std::byte> readModelFile(const FileToRead& file) {
  const std::string where = "the file";
  std::ifstream stream = open(file, where);
  const std::vector<std::byte> start =
      readBytes(stream, std::min<std::uint64_t>(file.size, containerStart), file.name, where);
  checkStart(start, file.size);
  checkSize(file.size, where);
  stream.clear();
  stream.seekg(0);
  return readBytes(stream, file.size, file.name, where);
}

SideFiles::SideFiles(std::filesystem::path folder, MemoryBudget& budget)
    : folder_(std::move(folder)), budget_(budget) {}

FileToRead SideFiles::find(std::string_view uri, const std::string& where) const {
  const std::filesystem::path relative = relativePath(uri, where);
  const std::string name = inQuotes(utf8(relative));
  if (folder_.empty())
    fail(ErrorCode::ioError,
         join(where, ": ", name,
              " cannot be read: the model was loaded from memory, without a folder"));
  const FileToRead named = findFile(folder_ / relative, name, where + ": ");
  // Links are resolved here, once, so that the opened path has none. It must still be in the
  // folder.
  std::error_code error;
  const std::filesystem::path folder = realPath(folder_, error);
  const std::filesystem::path real = error ? std::filesystem::path() : realPath(named.path, error);
  if (error) {
    fail(ErrorCode::ioError, join(where, ": ", name, " cannot be opened: ", error.message()));
  }
  if (!isInside(real, folder)) {
    fail(ErrorCode::ioError,
         join(where, ": ", name,
              " leads outside the file's folder through a symbolic link and is not opened"));
  }
  return {real, named.size, name};
}

Bytes SideFiles::read(const FileToRead& file, std::uint64_t needed, const std::string& where) {
  const std::uint64_t count = std::min(needed, file.size);
  Bytes& known = read_[file.path];
  const std::uint64_t before = known == nullptr ? 0 : known->size();
  if (known != nullptr && before >= count) return known;
  checkSize(count, where);
  budget_.addFile(count - before);
  spend(budget_, count, 1, where);
  std::ifstream stream = open(file, where);
  known =
      std::make_shared<const std::vector<std::byte>>(readBytes(stream, count, file.name, where));
  return known;
}

std::vector<std::filesystem::path> SideFiles::paths() const {
  std::vector<std::filesystem::path> paths;
  for (const auto& [path, bytes] : read_)
    if (bytes != nullptr) paths.push_back(path);  // null if reading failed
  return paths;
}

std::string decodePercent(std::string_view text, const std::string& where) {
  std::string decoded;
  decoded.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded.push_back(text[i]);
      continue;
    }
    const std::uint8_t high = i + 2 < text.size() ? hexadecimalDigit(text[i + 1]) : notHexadecimal;
    const std::uint8_t low = i + 2 < text.size() ? hexadecimalDigit(text[i + 2]) : notHexadecimal;
    if (high == notHexadecimal || low == notHexadecimal) {
      failInvalid(where, ": character ", i, " of its uri is a '%' without two digits");
    }
    decoded.push_back(static_cast<char>(high << 4 | low));
    i += 2;
  }
  return decoded;
}

}  // namespace dermis::gltf
