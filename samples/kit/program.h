// A program from the command line to the exit status: messages, progress and errors.
#pragma once

#include <cstddef>
#include <exception>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "dermis/result.h"

namespace CLI {
class App;
}

namespace dermis::samples {

enum class ExitStatus : int {
  done = 0,
  verificationFailed = 1,
  wrongUsage = 2,
  badInput = 3,
  noDevice = 4,
  stopped = 5,  ///< output not writable, no window, device lost, out of memory
};

/// One line on standard error: "NAME: error: …".
ExitStatus reportError(ExitStatus status, std::string_view message);
void reportWarning(std::string_view message);
void reportNote(std::string_view message);

/// Mentions the --help of the subcommand that `parseOptions` found, or of the program. The message
/// names the option.
ExitStatus reportWrongUsage(std::string_view message);
/// Report an error of a model file or of a device, with its exit status.
ExitStatus reportModelError(const Error& error);
ExitStatus reportDeviceError(const Error& error);
ExitStatus deviceErrorStatus(const Error& error);

/// The end of the --help of a program that uses all of them.
inline constexpr const char* exitStatusHelp =
    "Exit status: 0 success, 1 verification failed, 2 wrong usage, 3 bad input,\n"
    "4 no usable device, 5 any other error.";

/// Empty if the program should continue. Otherwise help or an error was printed.
std::optional<ExitStatus> parseOptions(CLI::App& app, int argc, char** argv);

/// Returns the value for `main` to return. Reports exceptions of `run`, and a standard output that
/// cannot be written. `run` gets the arguments in UTF-8, on Windows, too.
int runProgram(const char* name, int argc, char** argv, ExitStatus (*run)(int argc, char** argv));

/// Shows the progress of long work, on a terminal only.
class Progress {
 public:
  Progress(std::string what, std::size_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void step();

 private:
  std::string what_;
  std::size_t total_;
  std::size_t done_ = 0;
  bool visible_;
};

/// Thrown by `must`.
class Failure : public std::exception {
 public:
  explicit Failure(Error error) : error_(std::move(error)) {}
  const char* what() const noexcept override { return error_.message.c_str(); }
  const Error& error() const { return error_; }

 private:
  Error error_;
};

/// Returns the value, or throws `Failure` if there is none: for programs that end at the first
/// error.
template <typename T>
T must(Result<T> result) {
  if (!result) throw Failure(result.error());
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}

}  // namespace dermis::samples
