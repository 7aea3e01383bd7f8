// Writes files atomically: whole or not at all. All programs write files this way.
//
// A file is written under a temporary name next to its target, synchronized, and then renamed. If
// anything fails before that, the old file is unchanged. Symbolic links are followed: the link
// stays, and the file that it names is replaced. A new file gets the permissions that the umask
// leaves; a replaced file keeps its permissions. Standard output and files that are not regular
// (devices, FIFOs) are written directly ("written through"). On Windows a replaced file gets the
// permissions of a new one, and a link is replaced.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "dermis/result.h"
#include "kit/unfinished.h"

namespace dermis::samples {

/// Replaces a file. Fails with `ioError`.
Result<void> writeFile(const std::filesystem::path& path, std::span<const std::byte> bytes);
Result<void> writeFile(const std::filesystem::path& path, const std::string& text);

/// The place that output is written to.
struct OutputTarget {
  std::filesystem::path name;           ///< as the user gave it
  std::filesystem::path path;           ///< with symbolic links followed
  std::optional<unsigned> permissions;  ///< of the file that is replaced
  bool isThrough = false;               ///< not a regular file: it is written through
  int stream = -1;  ///< descriptor of standard output or error, if the target is one of them
};

/// A file that another program writes, under a temporary name. It is removed unless `commit` is
/// called.
class OutputFile {
 public:
  /// Creates an empty file: next to the target or, if the target is written through, in the folder
  /// for temporary files. Fails with `ioError`, on Windows also if the target is a device.
  static Result<std::unique_ptr<OutputFile>> create(const std::filesystem::path& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& temporaryName() const { return temporary_; }
  /// Fails with `ioError`.
  Result<void> write(std::span<const std::byte> bytes);
  /// Moves the file to its target. Fails with `ioError`.
  Result<void> commit();

 private:
  friend Result<void> writeFile(const std::filesystem::path& path,
                                std::span<const std::byte> bytes);
  static Result<std::unique_ptr<OutputFile>> createFor(const OutputTarget& target);
  OutputFile(OutputTarget target, std::string temporary)
      : target_(std::move(target)), temporary_(std::move(temporary)), unfinished_(temporary_) {}

  OutputTarget target_;
  std::string temporary_;
  UnfinishedFile unfinished_;  ///< A signal removes it.
  int file_ = -1;
  bool isThere_ = false;  ///< Whether this object created the temporary file.
};

}  // namespace dermis::samples
