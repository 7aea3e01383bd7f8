// What the viewer is started with.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "dermis/method.h"
#include "program/exit_status.h"

namespace dermis::viewer {

struct Options {
  std::string model;  ///< empty: none
  Method method = Method::dualQuaternion;
  std::optional<Method> comparison;  ///< beside it
  std::optional<std::string> animation;
  double time = 0;  ///< seconds
  bool isPaused = false;
  std::uint32_t width = 1280, height = 800;  ///< of the window
  std::string device = "auto";
  std::string shaders;      ///< the folder that kernels are compiled from; empty: the library's
  std::string shaderCache;  ///< where compiled ones are kept; empty: nowhere
  std::optional<std::uint32_t> frames;  ///< End after so many.
  std::string screenshot;               ///< written at the end; empty: none
  bool validates = false;
};

/// Nothing: go on; otherwise help was printed, or an error.
std::optional<samples::ExitStatus> readOptions(int argc, char** argv, Options& options);

}  // namespace dermis::viewer
