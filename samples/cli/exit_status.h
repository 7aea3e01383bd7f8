// What the command says, and how it ends.
#pragma once

#include <string>
#include <string_view>

#include "dermis/result.h"

namespace dermis::cli {

enum class ExitStatus : int {
  done = 0,
  verificationFailed = 1,
  wrongUsage = 2,
  badInput = 3,
  noDevice = 4,
  stopped = 5,  ///< output not writable, device lost, out of memory
};

/// One line on standard error: "dermis: error: …".
ExitStatus reportError(ExitStatus status, std::string_view message);
void reportWarning(std::string_view message);
void reportNote(std::string_view message);

/// An error of a model file, and one of a device, with the status that each means.
ExitStatus reportModelError(const Error& error);
ExitStatus reportDeviceError(const Error& error);

}  // namespace dermis::cli
