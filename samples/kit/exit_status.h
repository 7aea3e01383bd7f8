// Exit statuses, and messages on standard error.
#pragma once

#include <string>
#include <string_view>

#include "dermis/result.h"

namespace dermis::samples {

enum class ExitStatus : int {
  done = 0,
  verificationFailed = 1,
  wrongUsage = 2,
  badInput = 3,
  noDevice = 4,
  stopped = 5,  ///< output not writable, no window, device lost, out of memory
};

/// The name before each message; "dermis" until `runProgram` sets it. `name` must outlive the
/// program.
void setProgramName(const char* name);
/// The subcommand whose --help `reportWrongUsage` mentions; empty for the program itself.
void setSubcommandName(std::string name);

/// One line on standard error: "NAME: error: …".
ExitStatus reportError(ExitStatus status, std::string_view message);
void reportWarning(std::string_view message);
void reportNote(std::string_view message);

/// Mentions the subcommand's --help. The message names the option.
ExitStatus reportWrongUsage(std::string_view message);
/// Report an error of a model file or of a device, with its exit status.
ExitStatus reportModelError(const Error& error);
ExitStatus reportDeviceError(const Error& error);
ExitStatus deviceErrorStatus(const Error& error);

}  // namespace dermis::samples
