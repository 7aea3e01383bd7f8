#include <fcntl.h>
#include <fmt/format.h>
#include <io.h>
#include <windows.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <system_error>
#include <utility>

#include "kit/file_name.h"
#include "kit/output_file.h"

namespace dermis::samples {
namespace {

// The handler runs in its own thread.
std::mutex mutex;
std::array<std::filesystem::path, 8> slots;  // empty: unused

BOOL WINAPI removeFiles(DWORD) {
  const std::scoped_lock lock(mutex);
  for (const std::filesystem::path& path : slots) {
    if (!path.empty()) DeleteFileW(path.c_str());
  }
  return FALSE;  // The next handler ends the program.
}

}  // namespace

void handleSignals() {
  SetConsoleCtrlHandler(removeFiles, TRUE);
}

UnfinishedFile::UnfinishedFile(const std::string& path) {
  const std::scoped_lock lock(mutex);
  for (std::size_t slot = 0; slot < slots.size(); ++slot) {
    if (!slots[slot].empty()) continue;
    slots[slot] = pathOf(path);
    slot_ = static_cast<int>(slot);
    return;
  }
}

UnfinishedFile::~UnfinishedFile() {
  const std::scoped_lock lock(mutex);
  if (slot_ >= 0) slots[static_cast<std::size_t>(slot_)].clear();
}

namespace {

Error cannotWrite(const std::filesystem::path& path, const std::string& reason) {
  return {ErrorCode::ioError, fmt::format("{} cannot be written: {}", path.string(), reason)};
}

Error cannotWrite(const std::filesystem::path& path, int reason) {
  return cannotWrite(path, std::generic_category().message(reason));
}

/// Uses the error of the last Windows function.
Error cannotWrite(const std::filesystem::path& path) {
  wchar_t* text = nullptr;
  const DWORD code = GetLastError();
  const DWORD length = FormatMessageW(
      FORMAT_MESSAGE_ALLOCATE_BUFFER | FORMAT_MESSAGE_FROM_SYSTEM | FORMAT_MESSAGE_IGNORE_INSERTS,
      nullptr, code, 0, reinterpret_cast<wchar_t*>(&text), 0, nullptr);
  std::string reason =
      length == 0 ? fmt::format("error {}", code) : std::filesystem::path(text).string();
  LocalFree(text);
  while (!reason.empty() &&
         (reason.back() == '\n' || reason.back() == '\r' || reason.back() == '.'))
    reason.pop_back();
  return cannotWrite(path, reason);
}

/// NUL, CON, a pipe. `std::filesystem::status` does not find them.
bool isDevice(const std::filesystem::path& path) {
  const HANDLE handle =
      CreateFileW(path.c_str(), 0, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr,
                  OPEN_EXISTING, FILE_ATTRIBUTE_NORMAL, nullptr);
  if (handle == INVALID_HANDLE_VALUE) return false;
  const DWORD type = GetFileType(handle);
  CloseHandle(handle);
  return type == FILE_TYPE_CHAR || type == FILE_TYPE_PIPE;
}

}  // namespace

Result<OutputTarget> findTarget(const std::filesystem::path& name) {
  OutputTarget target;
  target.name = name;
  target.path = name;
  std::error_code error;
  const std::filesystem::file_type type = std::filesystem::status(name, error).type();
  if (type == std::filesystem::file_type::directory) return cannotWrite(name, EISDIR);
  target.isThrough = isDevice(name);
  const DWORD attributes = GetFileAttributesW(name.c_str());
  if (attributes != INVALID_FILE_ATTRIBUTES && (attributes & FILE_ATTRIBUTE_READONLY) != 0)
    return cannotWrite(name, EACCES);
  return target;
}

namespace {

/// Opens a file. Returns -1 if that fails; `GetLastError` then returns the reason. It may be
/// removed while it is open: `UnfinishedFile` does so.
int openFile(const std::filesystem::path& path, DWORD creation) {
  const HANDLE handle = CreateFileW(path.c_str(), GENERIC_READ | GENERIC_WRITE,
                                    FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr,
                                    creation, FILE_ATTRIBUTE_NORMAL, nullptr);
  if (handle == INVALID_HANDLE_VALUE) return -1;
  return _open_osfhandle(reinterpret_cast<std::intptr_t>(handle), _O_BINARY | _O_RDWR);
}

/// 0 or the reason, as an `errno`.
int writeAll(int file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const auto size = static_cast<unsigned>(std::min<std::size_t>(bytes.size(), INT_MAX));
    const int written = _write(file, bytes.data(), size);
    if (written < 0) return errno;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

}  // namespace

Result<void> writeThrough(const OutputTarget& target, std::span<const std::byte> bytes) {
  const int file = openFile(target.path, OPEN_EXISTING);
  if (file < 0) return cannotWrite(target.name);
  const int failure = writeAll(file, bytes);
  _close(file);
  if (failure != 0) return cannotWrite(target.name, failure);
  return {};
}

Result<std::unique_ptr<OutputFile>> OutputFile::createFor(const OutputTarget& target) {
  if (target.isThrough) return cannotWrite(target.name, "it is a device");
  std::unique_ptr<OutputFile> made(
      new OutputFile(target, temporaryNameIn(target.path.parent_path())));
  made->file_ = openFile(pathOf(made->temporary_), CREATE_NEW);
  if (made->file_ < 0) return cannotWrite(target.name);
  made->isThere_ = true;
  return made;
}

OutputFile::~OutputFile() {
  if (file_ >= 0) _close(file_);
  if (isThere_) DeleteFileW(pathOf(temporary_).c_str());
}

Result<void> OutputFile::write(std::span<const std::byte> bytes) {
  const int failure = writeAll(file_, bytes);
  if (failure != 0) return cannotWrite(target_.name, failure);
  return {};
}

Result<void> OutputFile::commit() {
  if (_commit(file_) != 0) return cannotWrite(target_.name, errno);
  if (_close(std::exchange(file_, -1)) != 0) return cannotWrite(target_.name, errno);
  if (MoveFileExW(pathOf(temporary_).c_str(), target_.path.c_str(),
                  MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH) == 0)
    return cannotWrite(target_.name);
  isThere_ = false;
  return {};
}

}  // namespace dermis::samples
