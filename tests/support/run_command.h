// Runs a program and keeps what it says.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace dermis::test {

struct CommandResult {
  int status = -1;  ///< the exit status; -1 where a signal ended it
  int signal = 0;   ///< that signal; 0: it ended by itself
  std::string output = {};
  std::string errors = {};
};

/// `environment`: NAME=VALUE pairs to add; a name alone removes it.
CommandResult runCommand(const std::vector<std::string>& command,
                         const std::vector<std::string>& environment = {});

/// Why `runOnTerminal` cannot run anything here; empty where it can.
std::string whyNoTerminal();
/// Sends a signal to the program as soon as `isTime`, which is asked again and again.
CommandResult runAndSignal(const std::vector<std::string>& command,
                           const std::vector<std::string>& environment,
                           const std::function<bool()>& isTime, int signal);

/// The same with a terminal for standard error.
CommandResult runOnTerminal(const std::vector<std::string>& command);

}  // namespace dermis::test
