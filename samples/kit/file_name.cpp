#include "kit/file_name.h"

#include <fmt/format.h>

#ifdef _WIN32
#include <windows.h>
#else
#include <sys/stat.h>
#endif

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <system_error>
#include <utility>

namespace dermis::samples {
namespace {

/// A placeholder for a number in a name: "%", flags and digits, "d".
struct Place {
  std::size_t begin = 0, end = 0;
  std::string_view inside;  ///< between "%" and "d"

  bool isRight() const {
    return inside.size() == 2 && inside[0] == '0' && inside[1] >= '1' && inside[1] <= '9';
  }
};

std::optional<Place> nextPlace(std::string_view name, std::size_t from) {
  while ((from = name.find('%', from)) != std::string_view::npos) {
    const std::size_t end = name.find_first_not_of("0123456789+-#'.", ++from);
    if (end != std::string_view::npos && name[end] == 'd')
      return Place{from - 1, end + 1, name.substr(from, end - from)};
  }
  return std::nullopt;
}

/// The place that `frameName` replaces.
std::optional<Place> framePlace(std::string_view pattern) {
  std::optional<Place> place = nextPlace(pattern, 0);
  while (place && !place->isRight()) place = nextPlace(pattern, place->end);
  return place;
}

/// The number of the frame whose file or folder may have this name, if there is one: a number with
/// so many characters before and after it. Which ones is left to the file system, since it may
/// ignore case.
std::optional<std::uint32_t> frameNumber(std::string_view name, std::size_t before,
                                         std::size_t after) {
  if (name.size() <= before + after) return std::nullopt;
  const char* const end = name.data() + name.size() - after;
  std::uint32_t frame = 0;
  const auto [stop, error] = std::from_chars(name.data() + before, end, frame);
  if (error != std::errc() || stop != end) return std::nullopt;
  return frame;
}

/// Calls `check` with the name of each frame that may exist, until it fails. Lists the folder of
/// the placeholder, since most frames do not exist yet, and there may be billions of them.
Result<void> forEachFrame(const std::string& pattern, std::uint32_t frames,
                          const std::function<Result<void>(const std::string&)>& check) {
#ifdef _WIN32
  constexpr std::string_view separators = "/\\";
#else
  constexpr std::string_view separators = "/";
#endif
  const Place place = *framePlace(pattern);
  const std::size_t begin = pattern.find_last_of(separators, place.begin) + 1;
  const std::size_t end = std::min(pattern.find_first_of(separators, place.end), pattern.size());
  std::error_code error;
  std::filesystem::directory_iterator entry(
      begin == 0 ? "." : pathOf(std::string_view(pattern).substr(0, begin)), error);
  if (error == std::errc::no_such_file_or_directory) return {};
  for (; !error && entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    const std::u8string name = entry->path().filename().u8string();
    const auto frame =
        frameNumber(std::string(name.begin(), name.end()), place.begin - begin, end - place.end);
    if (!frame || *frame >= frames) continue;
    if (Result<void> good = check(*frameName(pattern, *frame)); !good) return good;
  }
  // A folder may be writable that cannot be listed.
  for (std::uint32_t frame = 0; error && frame < frames; ++frame)
    if (Result<void> good = check(*frameName(pattern, frame)); !good) return good;
  return {};
}

/// The device or volume, and the number of the file on it.
using FileIdentity = std::pair<std::uint64_t, std::uint64_t>;

/// Empty if there is no file.
std::optional<FileIdentity> identityOf(const std::filesystem::path& path) {
#ifdef _WIN32
  const HANDLE file =
      CreateFileW(path.c_str(), 0, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, nullptr,
                  OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, nullptr);
  if (file == INVALID_HANDLE_VALUE) return std::nullopt;
  BY_HANDLE_FILE_INFORMATION information{};
  const bool isKnown = GetFileInformationByHandle(file, &information) != 0;
  CloseHandle(file);
  if (!isKnown) return std::nullopt;
  return FileIdentity(information.dwVolumeSerialNumber,
                      std::uint64_t{information.nFileIndexHigh} << 32 | information.nFileIndexLow);
#else
  struct stat file {};
  if (stat(path.c_str(), &file) != 0) return std::nullopt;
  return FileIdentity(file.st_dev, file.st_ino);
#endif
}

/// Identifies the file of that name; the name itself if there is no file yet. Empty for devices and
/// FIFOs, which several outputs may share.
std::optional<std::string> writtenFile(const std::filesystem::path& path) {
  if (const std::optional<FileIdentity> file = identityOf(path)) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return std::nullopt;
    return fmt::format("{} {}", file->first, file->second);
  }
  std::error_code unknown;
  const std::filesystem::path whole = std::filesystem::weakly_canonical(path, unknown);
  return (unknown ? path : whole).string();
}

}  // namespace

std::filesystem::path pathOf(std::string_view name) {
  return std::u8string(name.begin(), name.end());
}

bool hasEnding(std::string_view name, std::string_view ending) {
  return name.size() > ending.size() &&
         std::equal(ending.begin(), ending.end(),
                    name.end() - static_cast<std::ptrdiff_t>(ending.size()), [](char a, char b) {
                      return a == (b >= 'A' && b <= 'Z' ? static_cast<char>(b - 'A' + 'a') : b);
                    });
}

std::optional<std::string> frameName(const std::string& pattern, std::uint32_t frame) {
  const std::optional<Place> place = framePlace(pattern);
  if (!place) return std::nullopt;
  return pattern.substr(0, place->begin) + fmt::format("{:0{}}", frame, place->inside[1] - '0') +
         pattern.substr(place->end);
}

bool hasWrongPattern(std::string_view name) {
  const std::optional<Place> place = nextPlace(name, 0);
  return place && (!place->isRight() || nextPlace(name, place->end));
}

Result<void> checkOutputFiles(std::span<const RequestedOutput> outputs,
                              std::span<const std::filesystem::path> inputs) {
  std::set<FileIdentity> read;
  for (const std::filesystem::path& input : inputs) {
    if (const std::optional<FileIdentity> file = identityOf(input)) read.insert(*file);
  }
  std::map<std::string, std::string_view> written;  // single files, and by which option
  const auto check = [&](std::string_view option, const std::string& name,
                         bool isFrame) -> Result<void> {
    const std::optional<FileIdentity> identity = identityOf(pathOf(name));
    if (identity && read.contains(*identity)) {
      return Error{ErrorCode::invalidArgument,
                   fmt::format("{} {} would overwrite an input file", option, name)};
    }
    if (isFrame && written.empty()) return {};
    const std::optional<std::string> file = writtenFile(pathOf(name));
    if (!file) return {};
    const auto other = written.find(*file);
    if (other != written.end()) {
      return Error{ErrorCode::invalidArgument,
                   fmt::format("{} {} is also the output of {}", option, name, other->second)};
    }
    if (!isFrame) written.emplace(*file, option);
    return {};
  };
  // Single files first: frames are then only looked up.
  for (const RequestedOutput& output : outputs) {
    if (output.name.empty() || framePlace(output.name)) continue;
    if (Result<void> good = check(output.option, output.name, false); !good) return good;
  }
  for (const RequestedOutput& output : outputs) {
    if (!framePlace(output.name)) continue;
    const auto checkFrame = [&](const std::string& name) {
      return check(output.option, name, true);
    };
    if (Result<void> good = forEachFrame(output.name, output.frames, checkFrame); !good)
      return good;
  }
  return {};
}

}  // namespace dermis::samples
