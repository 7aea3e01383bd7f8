// Runs a program and keeps what it says.
#pragma once

#include <string>
#include <vector>

namespace dermis::test {

struct CommandResult {
  int status = -1;  ///< the exit status; -1 where a signal ended it
  std::string output;
  std::string errors;
};

/// `environment`: NAME=VALUE pairs to add; a name alone removes it.
CommandResult runCommand(const std::vector<std::string>& command,
                         const std::vector<std::string>& environment = {});

/// Why `runOnTerminal` cannot run anything here; empty where it can.
std::string whyNoTerminal();

/// The same with a terminal for standard error.
CommandResult runOnTerminal(const std::vector<std::string>& command);

}  // namespace dermis::test
