// A display without a screen (Xvfb), a user in front of it (xdotool), and programs on it.
#pragma once

#include <sys/types.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "kit/render/picture.h"
#include "run_command.h"

namespace dermis::test {

/// Asks again and again, until it is so. False: it was not so for a long time.
bool waitUntil(const std::function<bool()>& isSo);

/// A program that runs beside the test, and is killed with this object.
class ChildProcess {
 public:
  /// `output` and `errors` are the files that it writes to. The program is looked for in PATH.
  ChildProcess(const std::vector<std::string>& command, const std::string& folder,
               const std::string& output, const std::string& errors);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  bool isRunning();
  /// Its exit status, when it has ended by itself; -1 if a signal ended it, or it never ended.
  int wait();

 private:
  pid_t child_ = -1;
  std::optional<int> status_;
};

class Display {
 public:
  /// Null if there is none, and then `reason` says why.
  static std::unique_ptr<Display> open(const std::string& folder, int width, int height,
                                       std::string& reason);

  /// ":7"
  const std::string& name() const { return name_; }

  /// xdotool with these arguments.
  CommandResult user(std::vector<std::string> arguments) const;
  /// Waits for a window with this title, and gives it the keyboard. Its number, or nothing.
  std::optional<std::string> focusWindow(const std::string& title) const;
  void press(const std::vector<std::string>& keys) const;

  /// All of the display.
  std::optional<samples::render::Picture> picture() const;

 private:
  Display() = default;
  std::string name_;
  std::unique_ptr<ChildProcess> server_;
};

}  // namespace dermis::test
