// The one way in which programs write files: whole or not at all.
//
// A file is written under a name of its own beside its target, synchronized, and then renamed.
// Until then, whatever goes wrong, what stood at the target is untouched. Symbolic links are
// followed: the link stays, and the file that it names is replaced. A new file gets the permissions
// that the umask leaves, a replaced one keeps those that it had. What is not a regular file
// (devices, FIFOs) and standard output are written through. On Windows a replaced file gets the
// permissions of a new one, and a link is replaced.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "dermis/result.h"
#include "unfinished.h"

namespace dermis::samples {

/// Replaces a file. Fails with `ioError`.
Result<void> writeFile(const std::filesystem::path& path, std::span<const std::byte> bytes);
Result<void> writeFile(const std::filesystem::path& path, const std::string& text);

/// Where output goes.
struct OutputTarget {
  std::filesystem::path name;           ///< as the user gave it
  std::filesystem::path path;           ///< with symbolic links followed
  std::optional<unsigned> permissions;  ///< of the file that is replaced
  bool isThrough = false;               ///< no regular file: it is written through
  int stream = -1;                      ///< the program's standard output or error, if it is that
};

/// A file that another program writes, which is told its temporary name. Without `commit` it is
/// removed.
class OutputFile {
 public:
  /// Makes an empty file: beside the target or, if that is written through, in the folder for
  /// temporary files. Fails with `ioError`.
  static Result<std::unique_ptr<OutputFile>> create(const std::filesystem::path& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& temporaryName() const { return temporary_; }
  /// Fails with `ioError`.
  Result<void> write(std::span<const std::byte> bytes);
  /// Puts what was written in its place. Fails with `ioError`.
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
  bool isThere_ = false;  ///< The temporary file is, and is ours.
};

}  // namespace dermis::samples
