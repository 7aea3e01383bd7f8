// Writes files atomically: whole or not at all. All programs write files this way.
//
// A file is written under a temporary name next to its target, synchronized, and then renamed. If
// anything fails before that, the old file is unchanged. Symbolic links are followed: the link
// stays, and the file that it names is replaced. A new file gets the permissions that the umask
// leaves; a replaced file keeps its permissions. Standard output and files that are not regular
// (devices, FIFOs) are written directly ("written through"). On Windows a replaced file gets the
// permissions of a new one, and a link is replaced. A hard link to a replaced file keeps the old
// contents.
#pragma once

#ifndef _WIN32
#include <sys/types.h>
#endif

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "dermis/result.h"

namespace dermis::samples {

/// Every signal that would end the program, unless it is ignored or handled already, removes what
/// is registered below and then ends the program as usual. On Windows, Ctrl+C, Ctrl+Break and
/// closing the console do so. SIGPIPE and SIGXFSZ are ignored: writing then fails as on a full
/// disk. Call it once, when the program begins.
void handleSignals();

/// A signal removes this file as long as the object lives. At most eight files are removed.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(const std::string& path);
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

 private:
  int slot_ = -1;
};

#ifndef _WIN32
/// Sets the child process that a signal kills before it removes files; 0 for none. The caller must
/// set it to 0 again before it reaps the process.
void setUnfinishedChild(pid_t child);
#endif

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

// The rest is for output_file.cpp and output_file_system.cpp.

/// Where output to a file of this name goes. Fails with `ioError`.
Result<OutputTarget> findTarget(const std::filesystem::path& name);

/// Writes to a target that is written through. Fails with `ioError`.
Result<void> writeThrough(const OutputTarget& target, std::span<const std::byte> bytes);

/// A name in a folder that no other file has. It is short, since the name of the target may already
/// have the maximum length.
std::string temporaryNameIn(const std::filesystem::path& folder);

}  // namespace dermis::samples
