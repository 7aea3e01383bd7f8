// A display without a screen (Xvfb), and a user in front of it (xdotool).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "child_process.h"
#include "kit/render/picture.h"
#include "run_command.h"

namespace dermis::test {

class Display {
 public:
  /// Null where there is none to be had, and then `reason` says why.
  static std::unique_ptr<Display> open(const std::string& folder, int width, int height,
                                       std::string& reason);

  /// ":7"
  const std::string& name() const { return name_; }

  /// xdotool with such arguments.
  CommandResult user(std::vector<std::string> arguments) const;
  /// Waits for a window of such a title, and gives it the keyboard. Its number, or nothing.
  std::optional<std::string> focusWindow(const std::string& title) const;
  void press(const std::vector<std::string>& keys) const;
  void type(const std::string& text) const;

  /// All of the display.
  std::optional<samples::render::Picture> picture() const;

 private:
  Display() = default;
  std::string name_;
  std::unique_ptr<ChildProcess> server_;
};

}  // namespace dermis::test
