// The files that a model consists of: opened only in its folder, read once, as far as needed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/memory_budget.h"

namespace dermis::gltf {

/// No file may be larger: a GLB cannot be, and no buffer has a reason to.
inline constexpr std::uint64_t largestFile = 0xffffffff;

using Bytes = std::shared_ptr<const std::vector<std::byte>>;

/// A regular file and its size. What else stands there is not opened: a pipe might never end.
struct FileToRead {
  std::filesystem::path path;
  std::uint64_t size = 0;
};

/// A path for messages: `string` is in the code page of the machine with some standard libraries on
/// Windows, and throws where that lacks a character.
std::string utf8(const std::filesystem::path& path);

/// Throws `Failure` with `ioError`: there is no such file, it is a folder, it may not be looked at.
/// `where` is the prefix of messages, with a colon, or empty.
FileToRead findFile(const std::filesystem::path& path, const std::string& where = {});

/// The file that a model is in, whole. Throws `Failure`: with `ioError`, and with `invalidData` or
/// `limitExceeded` if its size or its first bytes show that it cannot be one, before the rest is
/// read.
std::vector<std::byte> readModelFile(const FileToRead& file);

/// The files beside a model that it names by relative URIs.
class SideFiles {
 public:
  /// `folder` empty: there are none. What is read is counted in the budget, which must outlive this
  /// object.
  SideFiles(std::filesystem::path folder, MemoryBudget& budget);

  /// Where a URI leads, links followed, or a failure with `ioError`: it leads out of the folder, or
  /// to nothing that can be read.
  FileToRead find(std::string_view uri, const std::string& where) const;

  /// The first `needed` bytes of a file that was found, or all of it if there are fewer; perhaps
  /// more, if more of it was needed before.
  Bytes read(const FileToRead& file, std::uint64_t needed, const std::string& where);

  /// What was read.
  std::vector<std::filesystem::path> paths() const;

 private:
  std::filesystem::path folder_;  ///< as it was given
  MemoryBudget& budget_;
  std::map<std::filesystem::path, Bytes> read_;
};

/// `%20` to a space and so on. Throws `Failure` if a '%' is not followed by two hexadecimal
/// digits.
std::string decodePercent(std::string_view text, const std::string& where);

}  // namespace dermis::gltf
