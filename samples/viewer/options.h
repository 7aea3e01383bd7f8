// What the viewer is started with, and how it ends.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "dermis/method.h"

namespace dermis::viewer {

enum class ExitStatus : int {
  done = 0,
  wrongUsage = 2,
  badInput = 3,
  noDevice = 4,
  stopped = 5,  ///< no window, device lost, out of memory, a message of the validation layer
};

/// One line on standard error: "dermis_viewer: error: …".
ExitStatus reportError(ExitStatus status, const std::string& message);

struct Options {
  std::string model;  ///< empty: none
  Method method = Method::dualQuaternion;
  std::optional<Method> comparison;  ///< beside it
  std::optional<std::string> animation;
  double time = 0;  ///< seconds
  bool isPaused = false;
  std::uint32_t width = 1280, height = 800;  ///< of the window
  std::string device = "auto";
  std::optional<std::uint32_t> frames;  ///< End after so many.
  std::string screenshot;               ///< written at the end; empty: none
  bool validates = false;
};

/// Nothing: go on; otherwise help was printed, or an error.
std::optional<ExitStatus> readOptions(int argc, char** argv, Options& options);

}  // namespace dermis::viewer
