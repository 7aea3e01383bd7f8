// How programs end, and what they say on standard error.
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

/// What stands before each message, followed by ": "; "dermis" until `runProgram` says otherwise.
/// `name` must outlive the program.
void setProgramName(const char* name);
/// The subcommand whose --help the hint of `reportWrongUsage` means; empty: the program's own.
void setSubcommandName(std::string name);

/// One line on standard error: "NAME: error: …".
ExitStatus reportError(ExitStatus status, std::string_view message);
void reportWarning(std::string_view message);
void reportNote(std::string_view message);

/// With a hint at the subcommand's --help. The message names the option.
ExitStatus reportWrongUsage(std::string_view message);
/// An error of a model file, and one of a device, with the status that each means.
ExitStatus reportModelError(const Error& error);
ExitStatus reportDeviceError(const Error& error);
ExitStatus deviceErrorStatus(const Error& error);

}  // namespace dermis::samples
