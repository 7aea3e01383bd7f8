// Reads the files of a model: side files only inside the folder of the model, and each file only as
// far as needed.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "gltf/memory_budget.h"

namespace dermis::gltf {

/// Maximum bytes that are read of a file: 4 GiB, or what an object may have on 32-bit systems.
inline constexpr std::uint64_t largestFile =
    std::min<std::uint64_t>(std::uint64_t{1} << 32, std::numeric_limits<std::ptrdiff_t>::max());

using Bytes = std::shared_ptr<const std::vector<std::byte>>;

/// A regular file and its size. Other kinds of files are not opened: a pipe might never end.
struct FileToRead {
  std::filesystem::path path;
  std::uint64_t size = 0;
  std::string name;  ///< for messages, in quotes
};

/// A path for messages. `path::string` uses the code page of the machine with some standard
/// libraries on Windows, and throws if that lacks a character.
std::string utf8(const std::filesystem::path& path);

/// Throws `Failure` with `ioError` if there is no such file, it is a folder, or access is denied.
/// `name` is the file's name in messages, in quotes, and `where` their prefix, with a colon, or
/// empty.
FileToRead findFile(const std::filesystem::path& path, const std::string& name,
                    const std::string& where = {});

/// Reads the whole file of a model. Throws `Failure`: with `ioError`, or with `invalidData` or
/// `limitExceeded` if its size or its first bytes show, before the rest is read, that it cannot be
/// a model.
std::vector<std::byte> readModelFile(const FileToRead& file);

/// The side files that a model names by relative URIs.
class SideFiles {
 public:
  /// If `folder` is empty, there are no side files. Bytes that are read are counted in the budget,
  /// which must outlive this object.
  SideFiles(std::filesystem::path folder, MemoryBudget& budget);

  /// Resolves a URI to a file, following links. Throws `Failure` with `ioError` if the file is
  /// outside the folder or cannot be read.
  FileToRead find(std::string_view uri, const std::string& where) const;

  /// Returns the first `needed` bytes of a found file, or all of them if there are fewer. May
  /// return more if more were needed before.
  Bytes read(const FileToRead& file, std::uint64_t needed, const std::string& where);

  /// The files that were read.
  std::vector<std::filesystem::path> paths() const;

 private:
  std::filesystem::path folder_;  ///< as given to the constructor
  MemoryBudget& budget_;
  std::map<std::filesystem::path, Bytes> read_;
};

/// Decodes `%20` to a space and so on. Throws `Failure` if a '%' is not followed by two hexadecimal
/// digits.
std::string decodePercent(std::string_view text, const std::string& where);

}  // namespace dermis::gltf
